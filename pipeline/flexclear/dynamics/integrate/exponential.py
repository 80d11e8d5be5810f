r"""Exponential Lobatto collocation of order 6: stiff modes are integrated exactly, everything else by a cubic.

The equations are split at every step, :math:`\dot y = A y + g(y)`: A holds the vibrations that the modal stiffness
gives the mechanism in its present pose (`modal_basis`), g is the rest, without stiff modes. In

.. math:: y(\theta h) = y_0 + \theta h\,\varphi_1(\theta h A)\,\dot y_0
          + h \sum_{k=1}^{3} k!\,\theta^{k+1}\varphi_{k+1}(\theta h A)\,d_k

the :math:`d_k` are the coefficients of the cubic through g at Lobatto's nodes, minus its start. Sweeps iterate the
nodes' states; they converge with h times the slope of g. So steps need not resolve the modes' vibrations, which keep
their phases, and the solution between the nodes is dense output. A need not be exact: g contains its error. Without
flexible bodies the method is Lobatto IIIA.

Source: Hochbruck & Ostermann, Exponential integrators, *Acta Numerica* 19 (2010), sec. 2.2 (collocation);
Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.7 (Lobatto IIIA) and
II.10 (two error estimates in one).
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import modal_basis, phi_functions
from flexclear.dynamics.integrate.method import AWAITS, LOST, MADE, Method, await_rates, slope, vector
from flexclear.dynamics.integrate.modal_basis import count, lift, modal_values, oscillation, turn, work_rate
from flexclear.dynamics.integrate.newton import limit
from flexclear.dynamics.integrate.norms import scaled_norm, set_error_scales
from flexclear.dynamics.kernels import kernel
from flexclear.scene.integrators import INTEGRATORS

# rows of SLOPES: start of the step, a node, its end, error estimate, search for events
NODE, LAST, ESTIMATE, ROWS, ERROR_ORDER = 1, 2, 3, 5, 4
NODES = 3
#: Lobatto's nodes after the start of the step
C = np.array([(5.0 - np.sqrt(5.0)) / 10.0, (5.0 + np.sqrt(5.0)) / 10.0, 1.0])
#: coefficient of theta^(k + 1) in the cubic that is zero at the start and 1 at node j alone
CUBIC = np.linalg.inv(np.array([[c ** (k + 1) for k in range(NODES)] for c in C]))
#: error estimates: differences of the cubic from the parabola through all nodes but the second inner one, and from the
#: straight line through the ends; coefficients of theta to theta^3 for coefficients of the cubic
CUBIC_OR_PARABOLA = np.array([C[0], -(1.0 + C[0]), 1.0])
PARABOLA_OR_LINE, CUBIC_OR_LINE = np.array([-1.0, 1.0, 0.0]), np.array([-1.0, 0.0, 1.0])
#: quadratures of the departures: up to each node, up to the fraction last requested, and the error estimates
ANYWHERE, THIRD, FOURTH, N_QUADRATURES = NODES, NODES + 1, NODES + 2, NODES + 3
#: of each quadrature the coefficient of theta^(k + 1) for each departure
POLYNOMIALS = np.array(
    [
        *[CUBIC] * (NODES + 1),
        np.outer(PARABOLA_OR_LINE, CUBIC[1]) + np.outer(CUBIC_OR_LINE, CUBIC[2]),
        np.outer(CUBIC_OR_PARABOLA, CUBIC[2]),
    ]
)
FACTORIALS = np.array([1.0 * factorial(k) for k in range(NODES + 2)])

# Memory between steps -------------------------------------------------------------------------------------------------
# floats: whether the oscillators belong to the present pose, whether any are known, step of the phi functions, length
# of the previous step (0: none), its rate of convergence, length of the step whose dense output is requested, the
# slowest convergence within the last attempt; of the present attempt the norm of the last correction, and its faded
# slowest convergence
BASIS_HOLDS, BASIS_KNOWN, PHI_STEP, LAST_STEP, RATE, LENGTH, SLOWEST, CORRECTED, CONVERGING, FLOATS = range(10)
#: vectors: departures of g from its start at the nodes, and those of the step before
DEPARTURE, BEFORE, VECTORS = 0, NODES, 2 * NODES
#: pairs (z, z') of all oscillators: of the departures, of the slope at the start and of its state, two to work with
OF_SLOPE, OF_STATE, TOTAL, SPARE, N_PAIRS = range(NODES, NODES + 5)
#: sources of a state within the step: the departures and the slope at its start
SOURCES = NODES + 1


@kernel
def quadrature(d, j, i):
    """Return the row of QUADRATURES of oscillator i in quadrature j."""
    return d.quadratures[d.nv * j + i]


# Exponential quadrature -----------------------------------------------------------------------------------------------
@kernel
def find_phi(d, j, step, theta):
    """Compute phi functions and source weights of all oscillators at a fraction of the step, for quadrature j.

    Error estimates refer to the whole step, as its last node does, so they use the phi functions of that node.
    """
    tau, whole = theta * step, j >= THIRD
    slope_too = 0.0 if whole else 1.0
    for i in range(count(d)):
        if not whole:
            at = d.at_quadratures + m.QUADRATURES.size * (d.nv * j + i) + m.QUADRATURES.phi
            phi_functions.phi_functions(d.w, at, d.oscillators[i].square * tau * tau, d.oscillators[i].damping * tau)
        phi, share = quadrature(d, NODES - 1 if whole else j, i).phi, quadrature(d, j, i).share
        share[2 * NODES] = slope_too * tau * (phi[2] - 1.0)
        share[2 * NODES + 1] = slope_too * tau * tau * phi[3]
        for e in range(NODES):
            plain, turned, power = 0.0, 0.0, theta
            for k in range(NODES):
                power *= theta
                weight = step * FACTORIALS[k + 1] * power * POLYNOMIALS[j, k, e]
                plain += weight * (phi[2 * k + 4] - 1.0 / FACTORIALS[k + 2])
                turned += weight * phi[2 * k + 5]
            share[2 * e], share[2 * e + 1] = plain, tau * turned


@kernel
def combine(d, j):
    """Sum the contributions of all sources by quadrature j in the pair TOTAL."""
    for i in range(count(d)):
        one, share, total = d.oscillators[i], quadrature(d, j, i).share, oscillation(d, TOTAL, i)
        if one.square == 0.0:
            continue
        z = rate = turned = bent = 0.0
        for e in range(SOURCES):
            plain, by, source = share[2 * e], share[2 * e + 1], oscillation(d, e, i)
            z += plain * source.z
            rate += plain * source.rate
            turned += by * source.z
            bent += by * source.rate
        total.z, total.rate = z + bent, rate - one.square * turned - one.damping * bent


@kernel
def plain_weight(theta, j, e):
    """Return the weight of departure e in quadrature j without oscillators, in steps."""
    total, power = 0.0, theta
    for k in range(NODES):
        power *= theta
        total += power / (k + 2.0) * POLYNOMIALS[j, k, e]
    return total


@kernel
def add_departures(d, step, theta, j, out):
    """Add quadrature j of the departures, and of the slope, to the state in w from index out on."""
    a, b, c = vector(d, DEPARTURE), vector(d, DEPARTURE + 1), vector(d, DEPARTURE + 2)
    wa, wb, wc = step * plain_weight(theta, j, 0), step * plain_weight(theta, j, 1), step * plain_weight(theta, j, 2)
    for i in range(d.ny):
        d.w[out + i] += wa * d.w[a + i] + wb * d.w[b + i] + wc * d.w[c + i]
    combine(d, j)
    lift(d, TOTAL, theta * step, out)


@kernel
def advance_to(d, step, theta, j, out):
    """Store the state at a fraction of the step in w from index out, by quadrature j, whose phi functions are known."""
    tau = step * theta
    for i in range(d.ny):
        d.w[out + i] = d.y[i] + tau * d.slopes[i]
    add_departures(d, step, theta, j, out)


# Departures -----------------------------------------------------------------------------------------------------------
@kernel
def depart(d, step, e):
    """Compute the departure of g at node e from its start, from the node's state in Y_STAGE, slope and pair TOTAL."""
    departure, node = vector(d, DEPARTURE + e), slope(d, NODE)
    modal_values(d, d.at_y_stage, SPARE)
    for i in range(count(d)):
        start, now = oscillation(d, OF_STATE, i), oscillation(d, SPARE, i)
        now.z, now.rate = start.z - now.z, start.rate - now.rate
    turn(d, SPARE)
    for c in range(d.ny):
        d.w[departure + c] = d.w[node + c] - d.slopes[c]
    lift(d, SPARE, C[e] * step, departure)
    d.w[departure + d.nq + d.nv + m.DRIVE_WORK] -= work_rate(d, TOTAL)
    modal_values(d, departure, e)


@kernel
def predict(d, step):
    """Predict the departures by the cubic of the previous step; zeros without one."""
    length = d.memory[LAST_STEP]
    for e in range(NODES):
        departure, x = vector(d, DEPARTURE + e), 1.0 + C[e] * step / length if length > 0.0 else 1.0
        for c in range(d.ny):
            d.w[departure + c] = 0.0
        for b in range(NODES if length > 0.0 else 0):
            rise, before = -1.0 if b == NODES - 1 else 0.0, vector(d, BEFORE + b)
            rise += ((CUBIC[2, b] * x + CUBIC[1, b]) * x + CUBIC[0, b]) * x
            for c in range(d.ny):
                d.w[departure + c] += rise * d.w[before + c]
        modal_values(d, departure, e)


@kernel
def begin(d):
    """Discard the oscillators and the previous step."""
    d.memory[BASIS_HOLDS] = d.memory[LAST_STEP] = 0.0
    d.memory[RATE] = 1.0


@kernel
def extend(d, step):
    """Note the length of the step: the collocation polynomial is the dense output."""
    d.memory[LENGTH] = step


@kernel
def interpolate(d, theta, out):
    """Store the state at the fraction `theta` of the step in w from `out`."""
    step = d.memory[LENGTH]
    find_phi(d, ANYWHERE, step, theta)
    advance_to(d, step, theta, ANYWHERE, out)


@kernel
def error(d, step):
    """Return the norm of the local error, 1 at the tolerance: of fourth order, bounded below by one of third.

    The next step grows at most so far that its sweeps converge.
    """
    out, size = slope(d, ESTIMATE), d.ny
    norms = (0.0, 0.0)
    for j in range(THIRD, N_QUADRATURES):
        for c in range(size):
            d.w[out + c] = 0.0
        add_departures(d, step, 1.0, j, out)
        norms = (norms[1], scaled_norm(d, out))
    third, fourth = norms
    # step lengths aim at corrections that fall by this factor per sweep, which goes with their square; the least rate
    # used
    d.most_growth = min(d.most_growth, np.sqrt(0.1 / max(d.memory[SLOWEST], 0.01)))
    if fourth == 0.0:
        return 0.0
    return fourth**2 / np.sqrt(fourth**2 + 0.01 * third**2)


def make_kernels(evaluate: Callable, lists: Any) -> tuple:
    """Build the method's kernels."""
    find_oscillators = modal_basis.make_find_oscillators(lists)

    @kernel
    def prepare(d, step):
        """Compute oscillators, phi functions, and the oscillators' parts of state and slope at the step's start."""
        if d.memory[BASIS_HOLDS] == 0.0:
            find_oscillators(d, d.memory[BASIS_KNOWN] > 0.0)
            d.evaluations += 1
            d.jacobians += 1
            d.memory[BASIS_HOLDS], d.memory[BASIS_KNOWN], d.memory[PHI_STEP] = 1.0, 1.0, 0.0
        if d.memory[PHI_STEP] != step:
            for e in range(NODES):
                find_phi(d, e, step, C[e])
            find_phi(d, THIRD, step, 1.0)
            find_phi(d, FOURTH, step, 1.0)
            d.memory[PHI_STEP] = step
        modal_values(d, d.at_slopes, OF_SLOPE)
        modal_values(d, d.at_y, OF_STATE)

    @kernel
    def visit(d, step, e):
        """Request the rates at node e."""
        advance_to(d, step, C[e], e, d.at_y_stage)
        return await_rates(d, d.time + C[e] * step, d.at_y_stage, slope(d, NODE))

    @kernel
    def correct(d, step):
        """Compute Y_NEW from the departures of a sweep; return the norm of its change."""
        advance_to(d, step, 1.0, NODES - 1, d.at_y_stage)
        for c in range(d.ny):
            end = d.y_stage[c]
            d.y_stage[c], d.y_new[c] = end - d.y_new[c], end
        return scaled_norm(d, d.at_y_stage)

    @kernel
    def converged(d, norm, k):
        """Return the status of the attempt after sweep k: MADE, LOST, or AWAITS when another sweep follows."""
        enough, last_norm, rate = limit(d.rtol), d.memory[CORRECTED], d.memory[CONVERGING]
        if not norm <= 1e300:
            return LOST
        if k > 0:
            now = norm / last_norm if last_norm > 0.0 else 0.0
            if now >= 1.0 and norm > enough:
                return LOST
            # the slowest rate of convergence counts less by this factor from sweep to sweep
            rate = max(0.3 * rate, now)
            if last_norm > enough:
                d.memory[SLOWEST] = max(d.memory[SLOWEST], now)
        d.memory[CORRECTED], d.memory[CONVERGING] = norm, rate
        left = norm * (rate / (1.0 - rate)) if rate < 0.5 else norm
        if k > 0 and left <= enough:
            d.memory[RATE] = rate
            return MADE
        return AWAITS if k + 1 < 10 else LOST

    @kernel
    def proceed(d, step):
        """Step from Y to Y_NEW, by new departures node after node; LOST when the iteration fails."""
        if d.stage == 0:
            set_error_scales(d, d.at_y)
            prepare(d, step)
            predict(d, step)
            advance_to(d, step, 1.0, NODES - 1, d.at_y_new)
            d.memory[CONVERGING], d.memory[SLOWEST] = d.memory[RATE], 0.0
            return visit(d, step, 0)
        if d.evaluation != m.OK:
            return LOST
        sweep, e = (d.stage - 1) // NODES, (d.stage - 1) % NODES
        depart(d, step, e)
        if e + 1 < NODES:
            return visit(d, step, e + 1)
        come = converged(d, correct(d, step), sweep)
        return visit(d, step, 0) if come == AWAITS else come

    @kernel
    def keep(d, step):
        """Store the cubic of an accepted step for the next prediction."""
        for i in range(NODES * d.ny):
            d.w[vector(d, BEFORE) + i] = d.w[vector(d, DEPARTURE) + i]
        d.memory[LAST_STEP], d.memory[BASIS_HOLDS] = step, 0.0

    return begin, proceed, error, extend, keep


METHOD = Method(
    traits=INTEGRATORS["exponential"],
    room=m.Room(ROWS, 0, FLOATS, VECTORS, oscillations=N_PAIRS, quadratures=N_QUADRATURES),
    last=LAST,
    make_kernels=make_kernels,
    interpolate=interpolate,
    staged=True,
    error_order=ERROR_ORDER,
)
