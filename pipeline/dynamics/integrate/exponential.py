r"""Exponential Lobatto collocation of order 6: stiff modes are followed exactly, everything else by a cubic.

The equations are split at every step, :math:`\dot y = A y + g(y)`: A holds the vibrations that the modal stiffness
gives the mechanism in its present pose (`modal_basis`), g is what is left, without stiff modes. In

.. math:: y(\theta h) = y_0 + \theta h\,\varphi_1(\theta h A)\,\dot y_0
          + h \sum_{k=1}^{3} k!\,\theta^{k+1}\varphi_{k+1}(\theta h A)\,d_k

the :math:`d_k` are the coefficients of the cubic through g at Lobatto's nodes, minus its start; the nodes' states are
found by iteration, which converges with h times the slope of g. So steps need not resolve the modes' vibrations, which
are kept with their phases, and the solution between the nodes is dense output. A needs not be exact: what it lacks is
in g. Without flexible bodies the method is Lobatto IIIA.

Source: Hochbruck & Ostermann, Exponential integrators, *Acta Numerica* 19 (2010), sec. 2.2 (collocation);
Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.7 (Lobatto IIIA) and
II.10 (two error estimates in one).
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial

import numpy as np

from flexclear.pipeline.core.integrators import INTEGRATORS
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate import modal_basis, phi_functions
from flexclear.pipeline.dynamics.integrate.method import Method, slope
from flexclear.pipeline.dynamics.integrate.modal_basis import count, damping, lift, read, square, turn, work_rate
from flexclear.pipeline.dynamics.integrate.newton import limit
from flexclear.pipeline.dynamics.integrate.norms import scaled_norm, set_error_scales
from flexclear.pipeline.dynamics.kernels import kernel

# rows of SLOPES: start of the step, a node, its end, error estimate, search for events
NODE, LAST, ESTIMATE, ROWS, ERROR_ORDER = 1, 2, 3, 5, 4
NODES = 3
#: Lobatto's nodes after the start of the step
C = np.array([(5.0 - np.sqrt(5.0)) / 10.0, (5.0 + np.sqrt(5.0)) / 10.0, 1.0])
#: coefficient of theta^(k + 1) in the cubic that is zero at the start and 1 at node j alone
CUBIC = np.linalg.inv(np.array([[c ** (k + 1) for k in range(NODES)] for c in C]))
#: error estimates: what the cubic does that the parabola through all nodes but the second inner one does not, and the
#: straight line through the ends; weights of (k - 1)! phi_k, the second for two coefficients of the cubic
CUBIC_OR_PARABOLA = np.array([0.0, C[0], -(1.0 + C[0]), 1.0])
PARABOLA_OR_LINE, CUBIC_OR_LINE = np.array([0.0, -1.0, 1.0, 0.0]), np.array([0.0, -1.0, 0.0, 1.0])
FACTORIALS = np.array([1.0 * factorial(k) for k in range(NODES + 2)])
MOST_SWEEPS = 10
#: how much of the slowest convergence is forgotten from step to step
FORGETTING = 0.3

# Memory between steps -------------------------------------------------------------------------------------------------
# whether the oscillators are those of the present pose, whether there are any, step of the phi functions, length of the
# step before (0: none), its rate of convergence, length of the step whose dense output is asked for
BASIS_HOLDS, BASIS_KNOWN, PHI_STEP, LAST_STEP, RATE, LENGTH, VECTORS = range(7)
#: vectors over the state: departures of g from its start at the nodes, and those of the step before
DEPARTURE, BEFORE = 0, NODES
#: pairs (z, z') of all oscillators: of the departures, of the slope at the start and of its state, two to work with
OF_SLOPE, OF_STATE, TOTAL, SPARE, N_PAIRS = range(NODES, NODES + 5)
PHI = 2 * phi_functions.COUNT


def memory(nq: int, nv: int, ny: int) -> int:
    """Floats kept between steps."""
    return VECTORS + 2 * NODES * ny + 2 * N_PAIRS * nv + (NODES + 1) * PHI * nv + modal_basis.floats(nv, ny)


@kernel
def vector(h, i):
    """Where w holds vector i over the state."""
    return h[m.MEMORY] + VECTORS + h[m.NY] * i


@kernel
def pair(h, i):
    """Where w holds pair i of all oscillators."""
    return vector(h, 2 * NODES) + 2 * h[m.NV] * i


@kernel
def phi(h, j, i):
    """Where w holds the phi functions of oscillator i at node j; at the share last asked for with j = NODES."""
    return pair(h, N_PAIRS) + PHI * (h[m.NV] * j + i)


@kernel
def basis(h):
    """Where w holds the oscillators."""
    return phi(h, NODES + 1, 0)


# Exponential quadrature -----------------------------------------------------------------------------------------------
@kernel
def find_phi(h, w, j, tau):
    """The phi functions of all oscillators after a time tau, as those of node j."""
    o = basis(h)
    for i in range(count(h)):
        phi_functions.phi_functions(w, phi(h, j, i), w[square(h, o, i)] * tau * tau, w[damping(h, o, i)] * tau)


@kernel
def add_term(h, w, j, tau, k, weight, source, factor):
    """Add weight (phi_k(tau Lambda) - 1/k!) factor (z, z') of pair `source` to the pair TOTAL."""
    o, nv = basis(h), h[m.NV]
    for i in range(count(h)):
        at = phi(h, j, i) + 2 * k
        alpha, beta = w[at] - 1.0 / FACTORIALS[k], w[at + 1] * tau
        z, rate = factor * w[pair(h, source) + i], factor * w[pair(h, source) + nv + i]
        bend = -w[square(h, o, i)] * z - w[damping(h, o, i)] * rate
        w[pair(h, TOTAL) + i] += weight * (alpha * z + beta * rate)
        w[pair(h, TOTAL) + nv + i] += weight * (alpha * rate + beta * bend)


@kernel
def clear(h, w):
    """Nothing in the pair TOTAL."""
    for i in range(2 * h[m.NV]):
        w[pair(h, TOTAL) + i] = 0.0


@kernel
def advance_to(h, w, step, theta, j, out):
    """State at a share of the step into w from place out, with the phi functions that stand at node j."""
    clear(h, w)
    first, size = slope(h, 0), h[m.NY]
    for c in range(size):
        w[out + c] = w[h[m.Y] + c] + step * theta * w[first + c]
    add_term(h, w, j, step * theta, 1, step * theta, OF_SLOPE, 1.0)
    for e in range(NODES):
        total, power = 0.0, theta
        for k in range(NODES):
            power *= theta
            total += power / (k + 2.0) * CUBIC[k, e]
            add_term(h, w, j, step * theta, k + 2, step * FACTORIALS[k + 1] * power, e, CUBIC[k, e])
        d = vector(h, DEPARTURE + e)
        for c in range(size):
            w[out + c] += step * total * w[d + c]
    lift(h, w, basis(h), pair(h, TOTAL), step * theta, out)


@kernel
def difference(h, w, step, coefficient, weights, out):
    """Add the integral over the step of one coefficient of the cubic times a polynomial, given by weights of phi."""
    for k in range(1, NODES + 1):
        weight = step * weights[k] * FACTORIALS[k]
        if weight == 0.0:
            continue
        for e in range(NODES):
            add_term(h, w, NODES - 1, step, k + 1, weight, e, CUBIC[coefficient, e])
            d, plain = vector(h, DEPARTURE + e), weight / FACTORIALS[k + 1] * CUBIC[coefficient, e]
            for c in range(h[m.NY]):
                w[out + c] += plain * w[d + c]


# Departures -----------------------------------------------------------------------------------------------------------
@kernel
def depart(h, w, step, e):
    """Departure of g at node e from its start, by the node's state in Y_STAGE, its slope, and its pair TOTAL."""
    d, o, work = vector(h, DEPARTURE + e), basis(h), pair(h, SPARE)
    read(h, w, o, h[m.Y_STAGE], work)
    for i in range(2 * h[m.NV]):
        w[work + i] = w[pair(h, OF_STATE) + i] - w[work + i]
    turn(h, w, o, work)
    for c in range(h[m.NY]):
        w[d + c] = w[slope(h, NODE) + c] - w[slope(h, 0) + c]
    lift(h, w, o, work, C[e] * step, d)
    w[d + h[m.NQ] + h[m.NV] + m.DRIVE_WORK] -= work_rate(h, w, o, pair(h, TOTAL))
    read(h, w, o, d, pair(h, e))


@kernel
def predict(h, w, step):
    """Departures by the cubic of the step before; none without one."""
    length = w[h[m.MEMORY] + LAST_STEP]
    for e in range(NODES):
        d, x = vector(h, DEPARTURE + e), 1.0 + C[e] * step / length if length > 0.0 else 1.0
        for c in range(h[m.NY]):
            w[d + c] = 0.0
        for b in range(NODES):
            rise = ((CUBIC[2, b] * x + CUBIC[1, b]) * x + CUBIC[0, b]) * x - (1.0 if b == NODES - 1 else 0.0)
            if length > 0.0:
                before = vector(h, BEFORE + b)
                for c in range(h[m.NY]):
                    w[d + c] += rise * w[before + c]
        read(h, w, basis(h), d, pair(h, e))


@kernel
def begin(h, f, w, n):
    """Neither oscillators of this pose nor a step before are known."""
    o = h[m.MEMORY]
    w[o + BASIS_HOLDS] = w[o + LAST_STEP] = 0.0
    w[o + RATE] = 1.0


@kernel
def extend(h, f, w, n, step):
    """The dense output is there."""
    w[h[m.MEMORY] + LENGTH] = step


@kernel
def interpolate(h, w, theta, out):
    """State at the share `theta` of the step, stored in w from `out`."""
    step = w[h[m.MEMORY] + LENGTH]
    find_phi(h, w, NODES, theta * step)
    advance_to(h, w, step, theta, NODES, out)


@kernel
def error(h, f, w, n, step):
    """Norm of the local error, 1 at the tolerance: of fourth order, held up by one of third."""
    out, size = slope(h, ESTIMATE), h[m.NY]
    norms = (0.0, 0.0)
    for which in range(2):
        clear(h, w)
        for c in range(size):
            w[out + c] = 0.0
        if which == 0:
            difference(h, w, step, 2, CUBIC_OR_PARABOLA, out)
        else:
            difference(h, w, step, 1, PARABOLA_OR_LINE, out)
            difference(h, w, step, 2, CUBIC_OR_LINE, out)
        lift(h, w, basis(h), pair(h, TOTAL), step, out)
        norms = (norms[1], scaled_norm(h, w, out))
    fourth, third = norms
    if fourth == 0.0:
        return 0.0
    return fourth**2 / np.sqrt(fourth**2 + 0.01 * third**2)


def make_kernels(evaluate: Callable, retract: Callable) -> tuple:
    """The method's kernels."""
    find_oscillators = modal_basis.make_find_oscillators(retract)

    @kernel
    def renew(h, f, w, n):
        """The oscillators of the state that has just been evaluated."""
        o = h[m.MEMORY]
        find_oscillators(h, f, w, n, basis(h), w[o + BASIS_KNOWN] > 0.0)
        n[m.JACOBIANS] += 1
        w[o + BASIS_HOLDS], w[o + BASIS_KNOWN], w[o + PHI_STEP] = 1.0, 1.0, 0.0

    @kernel
    def prepare(h, f, w, n, step):
        """Oscillators, phi functions, and what is read off the start of the step."""
        o = h[m.MEMORY]
        if w[o + BASIS_HOLDS] == 0.0:
            evaluate(h, f, w, n, w[h[m.CONTROL] + m.TIME], h[m.Y], slope(h, NODE))
            n[m.EVALUATIONS] += 1
            renew(h, f, w, n)
        if w[o + PHI_STEP] != step:
            for e in range(NODES):
                find_phi(h, w, e, C[e] * step)
            w[o + PHI_STEP] = step
        read(h, w, basis(h), slope(h, 0), pair(h, OF_SLOPE))
        read(h, w, basis(h), h[m.Y], pair(h, OF_STATE))

    @kernel
    def sweep(h, f, w, n, step):
        """New departures at all nodes, each with those before it; False when one cannot be evaluated."""
        for e in range(NODES):
            advance_to(h, w, step, C[e], e, h[m.Y_STAGE])
            evaluate(h, f, w, n, w[h[m.CONTROL] + m.TIME] + C[e] * step, h[m.Y_STAGE], slope(h, NODE))
            n[m.EVALUATIONS] += 1
            if n[m.EVALUATION] != m.OK:
                return False
            depart(h, w, step, e)
        return True

    @kernel
    def attempt(h, f, w, n, step):
        """State Y_NEW after a step from Y; False when the iteration fails."""
        o, last_norm, enough = h[m.MEMORY], 0.0, limit(w[h[m.CONTROL] + m.RTOL])
        set_error_scales(h, f, w, h[m.Y])
        prepare(h, f, w, n, step)
        predict(h, w, step)
        advance_to(h, w, step, 1.0, NODES - 1, h[m.Y_NEW])
        rate = w[o + RATE]
        for k in range(MOST_SWEEPS):
            if not sweep(h, f, w, n, step):
                return False
            advance_to(h, w, step, 1.0, NODES - 1, h[m.Y_STAGE])
            for c in range(h[m.NY]):
                end = w[h[m.Y_STAGE] + c]
                w[h[m.Y_STAGE] + c], w[h[m.Y_NEW] + c] = end - w[h[m.Y_NEW] + c], end
            norm = scaled_norm(h, w, h[m.Y_STAGE])
            if not norm <= 1e300:
                return False
            if k > 0:
                now = norm / last_norm if last_norm > 0.0 else 0.0
                if now >= 1.0 and norm > enough:
                    return False
                rate = max(FORGETTING * rate, now)
            left = norm * (rate / (1.0 - rate)) if rate < 0.5 else norm
            if k > 0 and left <= enough:
                w[o + RATE] = rate
                return True
            last_norm = norm
        return False

    @kernel
    def keep(h, f, w, n, step):
        """The cubic of an accepted step predicts the next one's; its end, where evaluated last, gives oscillators."""
        for i in range(NODES * h[m.NY]):
            w[vector(h, BEFORE) + i] = w[vector(h, DEPARTURE) + i]
        w[h[m.MEMORY] + LAST_STEP], w[h[m.MEMORY] + BASIS_HOLDS] = step, 0.0
        if n[m.STATE] == h[m.Y_NEW]:
            renew(h, f, w, n)

    return begin, attempt, error, extend, keep


METHOD = Method(
    traits=INTEGRATORS["exponential"],
    slopes=ROWS,
    last=LAST,
    dense=0,
    make_kernels=make_kernels,
    interpolate=interpolate,
    error_order=ERROR_ORDER,
    memory=memory,
)
