/* Slider-crank of Flores, Leine & Glocker (2010), Multibody System Dynamics 23, 165-190, table 1, in the angles of crank,
   rod and slider: mass matrix, generalised forces to the left of the equations, and gaps of the slider's four corners
   with their derivatives, by columns. */

#include <math.h>

static const double crank = 0.153, rod = 0.306, m1 = 0.038, m2 = 0.038, m3 = 0.076;
static const double half_length = 0.05, half_height = 0.025, clearance = 1e-3, gravity = 9.81;
static const double coupling = (0.5 * 0.038 + 0.076) * 0.153 * 0.306;

void mass(unsigned n, const double *q, double *M, unsigned nz, double *z) {
    for (int k = 0; k < 9; k++) M[k] = 0.0;
    M[0] = 7.4e-5 + (0.25 * m1 + m2 + m3) * crank * crank;
    M[4] = 5.9e-4 + (0.25 * m2 + m3) * rod * rod;
    M[8] = 2.7e-6;
    M[1] = M[3] = coupling * cos(q[0] - q[1]);
}

void forces(unsigned n, const double *q, const double *v, double *f, unsigned nz, double *z) {
    double spin = coupling * sin(q[0] - q[1]);
    f[0] = spin * v[1] * v[1] + gravity * (0.5 * m1 + m2 + m3) * crank * cos(q[0]);
    f[1] = -spin * v[0] * v[0] + gravity * (0.5 * m2 + m3) * rod * cos(q[1]);
    f[2] = 0.0;
}

static void corner(const double *q, unsigned rows, double *y, double *W, double x, double side) {
    double c = cos(q[2]), s = sin(q[2]), along = x * half_length, up = side * half_height;
    double place[2] = {crank * cos(q[0]) + rod * cos(q[1]) + along * c - up * s,
                       crank * sin(q[0]) + rod * sin(q[1]) + along * s + up * c};
    double dx[3] = {-crank * sin(q[0]), -rod * sin(q[1]), -along * s - up * c};
    double dy[3] = {crank * cos(q[0]), rod * cos(q[1]), along * c - up * s};
    for (int k = 0; k < 3 && W; k++) {
        W[rows * k] = -side * dy[k];
        if (rows > 1) W[rows * k + 1] = dx[k];
    }
    if (y) y[0] = half_height + clearance - side * place[1];
    if (y && rows > 1) y[1] = place[0];
}

#define CORNER(k, x, side)                                                                                      \
    void gap##k(unsigned n, const double *q, unsigned rows, double *y, unsigned nz, double *z) {                \
        corner(q, rows, y, 0, x, side);                                                                         \
    }                                                                                                           \
    void slope##k(unsigned n, const double *q, unsigned rows, double *W, unsigned nz, double *z) {              \
        corner(q, rows, 0, W, x, side);                                                                         \
    }

CORNER(0, 1.0, 1.0)
CORNER(1, -1.0, 1.0)
CORNER(2, 1.0, -1.0)
CORNER(3, -1.0, -1.0)
