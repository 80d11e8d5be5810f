"""Whole runs with contact laws by expressions and of tight fits, wherever the program uses a contact law."""

from __future__ import annotations

import tomllib
from functools import reduce
from typing import Any

import numpy as np
import pytest
import xarray as xr

import flexclear as fc
from flexclear.dynamics import analyses
from flexclear.dynamics.linear.clearance_response import _separation
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE
from tests.analytic.test_sensitivities import agree
from tests.properties.mechanisms import simulated

#: Flores' damping for c = 0.8 is a = 8(1-c)/(5c) = 0.4
FORCE, NORMAL = "K*depth^1.5*(1 + a*rate/impact_rate)", {"law": "flores", "restitution": 0.8, "stiffness": 1e10}
OWN = {"law": "expression", "force": FORCE, "values": {"K": "1e10 N/m^1.5", "a": 0.4}}
SLIDES, OWN_SLIDES = (
    {"law": "ambrosio", "dynamic": 0.1, "v0": "1 mm/s", "v1": "20 mm/s"},
    {
        "law": "expression",
        "coefficient": "m*min(1, max(0, (slip - v)/(w - v)))",
        "values": {"m": 0.1, "v": "1 mm/s", "w": "20 mm/s"},
    },
)
TIGHT = {"solver.rtol": 1e-10, "solver.integrator": "dop853"}
WHERE = (
    "position",
    "velocity",
    "contact_normal_force",
    "contact_elastic",
    "contact_damping_loss",
    "contact_friction_loss",
)


def scene(name: str, **changes: Any) -> Scene:
    """A scene with other values, or new parts, at some paths."""
    table = tomllib.loads((TREE / f"scenes/checks/{name}.toml").read_text())
    for path, value in (TIGHT | changes).items():
        *outer, last = path.split(".")
        reduce(lambda part, key: part.setdefault(key, {}), outer, table)[last] = value
    return Scene.model_validate(table)


def closes(run: xr.Dataset, within: float = 1e-8) -> None:
    """The books balance to this fraction of the energy that was exchanged."""
    assert np.abs(run["energy_error"].values).max() < within * run.attrs["exchanged_energy"]


def same(one: xr.Dataset, other: xr.Dataset, within: float) -> None:
    """Two runs agree at the output times, and in their events."""
    assert other["event_kind"].values.tolist() == one["event_kind"].values.tolist()
    assert other["event_time"].values == pytest.approx(one["event_time"].values, rel=1e-9)
    times = np.intersect1d(one["time"].values, other["time"].values)
    a, b = (run.drop_duplicates("time").sel(time=times) for run in (one, other))
    assert len(times) > 50
    for name in WHERE:
        assert b[name].values == pytest.approx(a[name].values, rel=within, abs=within * float(np.abs(a[name]).max()))


def slider_crank(**changes: Any) -> Scene:
    return scene("clearance_slider_crank", **{"time.end": "3 ms", "joint.pin.friction": SLIDES} | changes)


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_a_loose_joint_with_laws_of_ones_own_moves_as_with_those_of_the_program(method: str) -> None:
    """Tolerance: rounding grows by a factor of a thousand over the impacts of the run."""
    solver = {"solver.integrator": method, "solver.rtol": 1e-10 if method == "dop853" else 1e-8}
    one = simulated(slider_crank(**{"joint.pin.normal": NORMAL, **solver}))
    other = simulated(slider_crank(**{"joint.pin.normal": OWN, "joint.pin.friction": OWN_SLIDES, **solver}))
    same(one, other, 1e-6 if method == "dop853" else 1e-5)
    closes(other, 1e-8 if method == "dop853" else 1e-7)
    assert other["contact_delivered_restitution"].values == pytest.approx(
        one["contact_delivered_restitution"], abs=1e-5
    )


@pytest.mark.parametrize("form", ["johnson", "radzimovsky", "goldsmith", "esdu-78035", "liu", "pereira", "winkler"])
def test_books_of_a_tight_fit_balance(form: str) -> None:
    layer = {"layer": {"modulus": "2 GPa", "thickness": "1 mm"}} if form == "winkler" else {}
    run = simulated(slider_crank(**{"joint.pin.normal": {"law": "flores", "restitution": 0.8, "form": form, **layer}}))
    closes(run)
    assert (run["event_kind"].values == "closing").sum() > 1
    assert f'"form": "{form}"' in run.attrs["contacts"]


def test_books_of_a_progressive_stop_balance() -> None:
    """The stiffness of the end jumps at a penetration of 1 deg; K d up to it is exact."""
    end = {
        "joint": "hinge",
        "upper": "20 deg",
        "normal": {
            "law": "expression",
            "force": "k*depth + max(0 N m, m*(depth - d))",
            "values": {"k": "20 N m/rad", "m": "200 N m/rad", "d": "1 deg"},
        },
    }
    run = simulated(scene("pendulum", **{"stop.end": end, "time.end": "2 s"}))
    closes(run, 1e-7)  # steps pass the kink of the force in the contact
    assert (run["event_kind"].values == "closing").any()


def test_ideal_joints_rub_by_a_law_of_ones_own() -> None:
    laws = [law | {"radius": "8 mm"} for law in (SLIDES, OWN_SLIDES)]
    one, other = (simulated(scene("pendulum", **{"joint.hinge.friction": law, "time.end": "1 s"})) for law in laws)
    assert other["position"].values[-1] == pytest.approx(one["position"].values[-1], rel=1e-8, abs=1e-9)
    assert float(one["joint_friction_loss"].values[-1].sum()) > 0.0
    closes(other, 1e-7)


def test_a_start_as_the_ideal_mechanism_inverts_the_expression() -> None:
    """The pin lies where the ideal joint's force presses it: 0.1 mm and (F/K)^(2/3) from the middle."""
    runs = [
        simulated(slider_crank(**{"joint.pin.normal": normal, "start.at": "ideal", "time.end": "50 us"}))
        for normal in (NORMAL, OWN)
    ]
    first = [run["contact_normal_force"].values[0, 0] for run in runs]
    assert first[0] > 1.0
    assert first[1] == pytest.approx(first[0], rel=1e-9)


def test_bounds_of_the_clearance_count_the_penetration_of_an_expression() -> None:
    one, other = (slider_crank(**{"joint.pin.normal": normal}).contacts()["pin"] for normal in (NORMAL, OWN))
    assert _separation(other, 1e4) == pytest.approx(_separation(one, 1e4), rel=1e-12)
    assert _separation(other, 1e4) == pytest.approx(1e-4 + (1e5 / 1e10) ** (2.0 / 3.0), rel=1e-12)


def test_derivatives_by_values_of_an_expression() -> None:
    """The restitution by the damping, the peak by the stiffness, and by an exponent that is a value."""
    law = {
        "law": "expression",
        "force": "K*(depth/d)^n*(1 + a*rate/impact_rate)",
        "values": {"K": "3162 N", "d": "1 mm", "n": 1.5, "a": 0.4},
    }
    changed = {"joint.contact.normal": law, "time.end": 0.5, "solver.rtol": 1e-10}
    of = ["ball.position.final", "ball.velocity.final", "contact.peak_force", "contact.impulse"]
    to = {f"joint.contact.normal.values.{name}": 1e-2 for name in ("K", "a", "n")}
    agree(scene("bounce", **changed), of, to, 1e-3)


def test_a_sweep_over_a_value_of_an_expression_keeps_the_code() -> None:
    path, values = TREE / "scenes/checks/bounce.toml", [0.2, 0.4]
    law = {"law": "expression", "force": FORCE, "values": {"K": "1e8 N/m^1.5", "a": 0.4}}
    vary = {"joint.contact.normal.values.a": values}
    found = fc.sweep(path, vary, ["ball.velocity.final"], set={"joint.contact.normal": law, "time.end": 0.3}, workers=1)
    speeds = found["ball.velocity.final"].values[:, 2]
    assert (found["status"] == 0).all()
    for k, a in enumerate(values):
        known = {"joint.contact.normal": law | {"values": {"K": "1e8 N/m^1.5", "a": a}}, "time.end": 0.3}
        one = simulated(load_scene(path, override=known))
        assert speeds[k] == pytest.approx(one["velocity"].values[-1, 0, 2], rel=1e-9)
    assert abs(speeds[0] - speeds[1]) > 1e-2  # more damping, less rebound


def test_members_of_an_ensemble_have_the_law() -> None:
    one = slider_crank(
        **{
            "joint.pin.normal": OWN,
            "joint.pin.friction": OWN_SLIDES,
            "ensemble": {"members": 2, "perturbation": "1 nm"},
        }
    )
    found = analyses.ensemble(one, {}, silent)
    assert found.sizes["member"] == 2
