/* Four-bar of scenes/checks/clearance_four_bar.toml with loose pins B, C and D, in the crank's angle and in place and
   angle of coupler and rocker: mass matrix, generalised forces to the left of the equations, and gaps of the pins with
   their derivatives, by columns. */

#include <math.h>

static const double masses[3] = {0.5, 1.0, 0.8}, clearance = 2e-4, gravity = 9.81, ground = 0.3;

void mass(unsigned n, const double *q, double *M, unsigned nz, double *z) {
    const double diagonal[7] = {1e-3 + 0.25e-2 * masses[0], masses[1], masses[1], 8e-3, masses[2], masses[2], 4e-3};
    for (int k = 0; k < 49; k++) M[k] = k % 8 ? 0.0 : diagonal[k / 8];
}

void forces(unsigned n, const double *q, const double *v, double *f, unsigned nz, double *z) {
    for (int k = 0; k < 7; k++) f[k] = 0.0;
    f[0] = gravity * masses[0] * 0.05 * cos(q[0]);
    f[2] = gravity * masses[1];
    f[5] = gravity * masses[2];
}

/* Place p of a point of a body at a distance from its middle, times a sign added to that in p, with derivatives in J. */
static void point(const double *q, int body, double along, double sign, double p[2], double J[7][2]) {
    const int at = 3 * body - 2, angle = body ? at + 2 : 0; /* the crank's distance is from its axle */
    if (body) p[0] += sign * q[at], J[at][0] += sign, p[1] += sign * q[at + 1], J[at + 1][1] += sign;
    p[0] += sign * along * cos(q[angle]), J[angle][0] -= sign * along * sin(q[angle]);
    p[1] += sign * along * sin(q[angle]), J[angle][1] += sign * along * cos(q[angle]);
}

/* bodies whose points meet at a pin, -1 the ground, and distances from their middles */
static const struct { int outer, inner; double from, to; } pins[3] = {{0, 1, 0.1, -0.15}, {1, 2, 0.15, 0.1}, {-1, 2, 0.0, -0.1}};

static void pin(int k, const double *q, double *y, double *W) {
    double p[2] = {0.0, 0.0}, J[7][2] = {{0.0}};
    point(q, pins[k].inner, pins[k].to, 1.0, p, J);
    if (pins[k].outer < 0) p[0] -= ground;
    else point(q, pins[k].outer, pins[k].from, -1.0, p, J);
    const double distance = sqrt(p[0] * p[0] + p[1] * p[1]);
    if (y) y[0] = clearance - distance;
    for (int i = 0; i < 7 && W; i++) W[i] = distance > 0.0 ? -(p[0] * J[i][0] + p[1] * J[i][1]) / distance : 0.0;
}

#define PIN(k)                                                                                                  \
    void gap##k(unsigned n, const double *q, unsigned rows, double *y, unsigned nz, double *z) {                \
        pin(k, q, y, 0);                                                                                        \
    }                                                                                                           \
    void slope##k(unsigned n, const double *q, unsigned rows, double *W, unsigned nz, double *z) {              \
        pin(k, q, 0, W);                                                                                        \
    }

PIN(0)
PIN(1)
PIN(2)
