"""The ledger of energy: what came in, what is stored, what was lost and to what; and that it closes."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.errors import SolverError
from flexclear.pipeline.core.integrators import INTEGRATORS
from flexclear.pipeline.core.scene.solver import Solver
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.equations.observation import Observed
from flexclear.pipeline.dynamics.model.model import Model
from flexclear.pipeline.dynamics.run.trajectory import Trajectory

Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]
#: rounding of the largest energies, which may cancel in the balance
ROUNDING = 1e-12
#: no contact law is known to a thousandth of its energy; a run of chosen steps that is off by more says something
#: else. Where more is asked for, more is kept: of three hundred hard cases at rtol 1e-10 (benchmarks/stability) none is
#: off by 1e-6, unless something is wrong; what damps by its order is not told from a fault that soon. Fixed steps are
#: for comparison: their error is to be seen, unless it is as large as everything
CHOSEN, STRICT, PER_RTOL, FIXED = 1e-3, 1e-4, 1e5, 1.0
#: steps of many vibrations leave up to half of this in the work of forces that swing while the drives' speeds change
LONG, LONG_PER_RTOL = 2e-2, 50.0


def series(model: Model, seen: Observed) -> Variables:
    """The variables of the ledger, total and by cause."""
    ledger = seen.state[:, model.speeds.stop :]
    kinetic, potential, elastic = (seen.energy[name] for name in ("kinetic", "potential", "elastic"))
    slots = ledger[:, m.CONTACT_SLOTS : m.CONTACT_SLOTS + m.CONTACT_LEDGER.size * len(model.contacts)]
    lost = m.named(m.CONTACT_LEDGER, slots)
    # friction's slot is its work; what bent bristles still hold of it is not lost
    damping, friction = lost["damping"], lost["friction"] - seen.touch["bent"]
    work, modal = ledger[:, m.DRIVE_WORK], ledger[:, m.MODAL_LOSS]
    dissipated = modal + damping.sum(axis=1) + friction.sum(axis=1)
    balance = kinetic + potential + elastic + dissipated - work
    loaded: Variables = {}
    if model.loads:
        load_work, load_loss = ledger[:, model.arrays.size(m.LOAD_SLOT) :].T[:2]
        dissipated, balance = dissipated + load_loss, balance + load_loss - load_work
        loaded = {"load_work": (("time",), load_work), "load_loss": (("time",), load_loss)}
    if model.parts.joint_frictions:
        first = model.arrays.size(m.RUBBING_SLOT)
        rubbed = ledger[:, first : first + model.arrays.size(m.N_RUBBING)]
        dissipated, balance = dissipated + rubbed.sum(axis=1), balance + rubbed.sum(axis=1)
        loaded["joint_friction_loss"] = (("time", "rubbing"), rubbed)
    variables: Variables = {
        "kinetic": (("time",), kinetic),
        "potential": (("time",), potential),
        "elastic": (("time",), elastic),
        "dissipated": (("time",), dissipated),
        "drive_work": (("time",), work),
        "energy_error": (("time",), balance - balance[0]),
        "constraint_error": (("time",), seen.residual),
        **loaded,
    }
    if model.numbering.flexible:
        variables["modal_damping_loss"] = (("time",), modal)
    if model.contacts:
        variables["contact_elastic"] = (("time", "contact"), seen.touch["stored"] + seen.touch["bent"])
        variables["contact_damping_loss"] = (("time", "contact"), damping)
        variables["contact_impulse"] = (("time", "contact"), lost["impulse"])
        variables["contact_friction_loss"] = (("time", "contact"), friction)
    return variables


def usual(solver: Solver) -> float:
    """Energy error, as a share of what is turned over, beyond which a run is refused when the scene does not say."""
    if solver.step is not None:
        return FIXED
    if INTEGRATORS[solver.integrator].dissipative:
        return CHOSEN
    usual = max(STRICT, min(CHOSEN, PER_RTOL * solver.rtol))
    return max(usual, min(LONG, LONG_PER_RTOL * solver.rtol)) if INTEGRATORS[solver.integrator].long_steps else usual


def require_closed(model: Model, trajectory: Trajectory, seen: Observed) -> None:
    """SolverError when the ledger is off by more than the scene's tolerance times the energy turned over."""
    totals = {name: values for name, (_, values) in series(model, seen).items()}
    error = np.abs(totals["energy_error"])
    turning = [n for n in ("kinetic", "potential", "elastic", "dissipated", "drive_work", "load_work") if n in totals]
    turned = max(float(np.ptp(totals[n])) for n in turning)
    turned = max(turned, float(totals["kinetic"].max()))
    largest = max(float(np.abs(totals[n]).max()) for n in turning)
    solver = model.scene.solver
    tolerance = solver.ledger_tolerance or usual(solver)
    worst = int(np.argmax(error)) if np.isfinite(error).all() else int(np.argmin(np.isfinite(error)))
    if error[worst] <= tolerance * turned + ROUNDING * largest:
        return
    first = int(np.argmax(~(error <= tolerance * turned + ROUNDING * largest)))
    raise SolverError(
        f"at t = {trajectory.time[first]:.6g} s: the energy balance does not close: the error is up to "
        f"{error[worst]:.3g} J where {turned:.3g} J are exchanged (tolerance {tolerance:g}, "
        f"[solver.ledger_tolerance]); lost so far: {_losses(model, totals, first)}; "
        "choose a smaller rtol or step, or another integrator"
    )


def _losses(model: Model, totals: dict[str, np.ndarray], t: int) -> str:
    parts = []
    for c, contact in enumerate(model.contacts):
        for cause in ("damping", "friction"):
            parts.append(f"{totals[f'contact_{cause}_loss'][t, c]:.3g} J to the {cause} of {contact.words}")
    if "modal_damping_loss" in totals:
        parts.append(f"{totals['modal_damping_loss'][t]:.3g} J to modal damping")
    for k, name in enumerate(model.scene.rubbing()):
        parts.append(f"{totals['joint_friction_loss'][t, k]:.3g} J to the friction of joint {name}")
    if "load_loss" in totals:
        parts.append(f"{totals['load_loss'][t]:.3g} J to the loads")
    return ", ".join(parts) or "nothing"
