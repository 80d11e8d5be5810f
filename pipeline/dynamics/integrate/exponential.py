r"""Exponential Lobatto collocation of order 6: stiff modes are followed exactly, everything else by a cubic.

The equations are split at every step, :math:`\dot y = A y + g(y)`: A holds the vibrations that the modal stiffness
gives the mechanism in its present pose (`modal_basis`), g is the rest, without stiff modes. In

.. math:: y(\theta h) = y_0 + \theta h\,\varphi_1(\theta h A)\,\dot y_0
          + h \sum_{k=1}^{3} k!\,\theta^{k+1}\varphi_{k+1}(\theta h A)\,d_k

the :math:`d_k` are the coefficients of the cubic through g at Lobatto's nodes, minus its start; the nodes' states are
found by iteration, which converges with h times the slope of g. So steps need not resolve the modes' vibrations, which
keep their phases, and the solution between the nodes is dense output. A needs not be exact: what it lacks is in g.
Without flexible bodies the method is Lobatto IIIA.

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
from flexclear.pipeline.dynamics.integrate.modal_basis import count, damping, lift, read, room, square, turn, work_rate
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
#: steps are so long that corrections fall by this factor per sweep, which goes with their square; no less is aimed at
SWIFT, LEAST = 0.1, 0.01

# Memory between steps -------------------------------------------------------------------------------------------------
# whether the oscillators are those of the present pose, whether there are any, step of the phi functions, length of the
# step before (0: none), its rate of convergence, length of the step whose dense output is requested, the slowest
# convergence within the last attempt
BASIS_HOLDS, BASIS_KNOWN, PHI_STEP, LAST_STEP, RATE, LENGTH, SLOWEST, VECTORS = range(8)
#: vectors over the state: departures of g from its start at the nodes, and those of the step before
DEPARTURE, BEFORE = 0, NODES
#: pairs (z, z') of all oscillators: of the departures, of the slope at the start and of its state, two to work with
OF_SLOPE, OF_STATE, TOTAL, SPARE, N_PAIRS = range(NODES, NODES + 5)
#: sources of a state within the step: the departures and the slope at its start
SOURCES = NODES + 1
PHI = 2 * phi_functions.COUNT
#: floats of an oscillator at a node: its phi functions, and what each source adds to (z, z') by them
AT_NODE = PHI + 2 * SOURCES


def memory(h: np.ndarray) -> int:
    """Floats kept between steps."""
    size = h[m.NV]
    vectors, pairs, nodes = 2 * NODES * h[m.NY], 2 * N_PAIRS * size, (NODES + 1) * AT_NODE * size
    return int(VECTORS + vectors + pairs + nodes + modal_basis.floats(h))


@kernel
def vector(h, i):
    """Where w holds vector i over the state."""
    return h[m.MEMORY] + VECTORS + h[m.NY] * i


@kernel
def pair(h, i):
    """Where w holds pair i of all oscillators."""
    return vector(h, 2 * NODES) + 2 * room(h) * i


@kernel
def phi(h, j, i):
    """Where w holds the phi functions of oscillator i at node j; at the share last asked for with j = NODES."""
    return pair(h, N_PAIRS) + AT_NODE * (room(h) * j + i)


@kernel
def share(h, j, i):
    """Where w holds what the sources add to (z, z') of oscillator i at node j: per source weights of 1 and Lambda."""
    return phi(h, j, i) + PHI


@kernel
def basis(h):
    """Where w holds the oscillators."""
    return phi(h, NODES + 1, 0)


# Exponential quadrature -----------------------------------------------------------------------------------------------
@kernel
def find_phi(h, w, j, step, theta):
    """The phi functions of all oscillators at a share of the step, as of node j, and what the sources do there."""
    o, tau = basis(h), theta * step
    for i in range(count(h)):
        at = phi(h, j, i)
        phi_functions.phi_functions(w, at, w[square(h, o, i)] * tau * tau, w[damping(h, o, i)] * tau)
        first = share(h, j, i) + 2 * NODES
        w[first], w[first + 1] = tau * (w[at + 2] - 1.0), tau * tau * w[at + 3]
        for e in range(NODES):
            plain, turned, power = 0.0, 0.0, theta
            for k in range(NODES):
                power *= theta
                weight = step * FACTORIALS[k + 1] * power * CUBIC[k, e]
                plain += weight * (w[at + 2 * k + 4] - 1.0 / FACTORIALS[k + 2])
                turned += weight * w[at + 2 * k + 5]
            w[share(h, j, i) + 2 * e], w[share(h, j, i) + 2 * e + 1] = plain, tau * turned


@kernel
def combine(h, w, j):
    """What all sources add at node j, as the pair TOTAL."""
    o, apart = basis(h), room(h)
    for i in range(count(h)):
        if w[square(h, o, i)] == 0.0:
            continue
        z = rate = turned = bent = 0.0
        for e in range(SOURCES):
            plain, by = w[share(h, j, i) + 2 * e], w[share(h, j, i) + 2 * e + 1]
            a, b = w[pair(h, e) + i], w[pair(h, e) + apart + i]
            z += plain * a
            rate += plain * b
            turned += by * a
            bent += by * b
        w[pair(h, TOTAL) + i] = z + bent
        w[pair(h, TOTAL) + apart + i] = rate - w[square(h, o, i)] * turned - w[damping(h, o, i)] * bent


@kernel
def clear(h, w):
    """Nothing in the pair TOTAL."""
    for i in range(2 * room(h)):
        w[pair(h, TOTAL) + i] = 0.0


@kernel
def add_term(h, w, j, tau, k, weight, source, factor):
    """Add weight (phi_k(tau Lambda) - 1/k!) factor (z, z') of pair `source` to the pair TOTAL."""
    o, apart = basis(h), room(h)
    for i in range(count(h)):
        at = phi(h, j, i) + 2 * k
        alpha, beta = w[at] - 1.0 / FACTORIALS[k], w[at + 1] * tau
        z, rate = factor * w[pair(h, source) + i], factor * w[pair(h, source) + apart + i]
        bend = -w[square(h, o, i)] * z - w[damping(h, o, i)] * rate
        w[pair(h, TOTAL) + i] += weight * (alpha * z + beta * rate)
        w[pair(h, TOTAL) + apart + i] += weight * (alpha * rate + beta * bend)


@kernel
def cubic_share(theta, e):
    """Integral of the cubic that is 1 at node e alone, from the start to a share of the step, in steps."""
    total, power = 0.0, theta
    for k in range(NODES):
        power *= theta
        total += power / (k + 2.0) * CUBIC[k, e]
    return total


@kernel
def advance_to(h, w, step, theta, j, out):
    """State at a share of the step into w from place out, with the phi functions that stand at node j."""
    first, tau = slope(h, 0), step * theta
    a, b, c = vector(h, DEPARTURE), vector(h, DEPARTURE + 1), vector(h, DEPARTURE + 2)
    wa, wb, wc = step * cubic_share(theta, 0), step * cubic_share(theta, 1), step * cubic_share(theta, 2)
    for i in range(h[m.NY]):
        w[out + i] = w[h[m.Y] + i] + tau * w[first + i] + (wa * w[a + i] + wb * w[b + i] + wc * w[c + i])
    combine(h, w, j)
    lift(h, w, basis(h), pair(h, TOTAL), tau, out)


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
    for i in range(2 * room(h)):
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
    find_phi(h, w, NODES, step, theta)
    advance_to(h, w, step, theta, NODES, out)


@kernel
def error(h, f, w, n, step):
    """Norm of the local error, 1 at the tolerance: of fourth order, held up by one of third.

    The next step may be as much longer as its sweeps shall converge.
    """
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
    most = h[m.CONTROL] + m.MOST_GROWTH
    w[most] = min(w[most], np.sqrt(SWIFT / max(w[h[m.MEMORY] + SLOWEST], LEAST)))
    if fourth == 0.0:
        return 0.0
    return fourth**2 / np.sqrt(fourth**2 + 0.01 * third**2)


def make_kernels(evaluate: Callable, retract: Callable, complete: Callable) -> tuple:
    """The method's kernels; complete: evaluates, and leaves what the oscillators are made of."""
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
            complete(h, f, w, n, w[h[m.CONTROL] + m.TIME], h[m.Y], slope(h, NODE))
            n[m.EVALUATIONS] += 1
            renew(h, f, w, n)
        if w[o + PHI_STEP] != step:
            for e in range(NODES):
                find_phi(h, w, e, step, C[e])
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
        rate, w[o + SLOWEST] = w[o + RATE], 0.0
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
                if last_norm > enough:
                    w[o + SLOWEST] = max(w[o + SLOWEST], now)
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
        if n[m.STATE] == h[m.Y_NEW] and n[m.ABRIDGED] == 0:
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
