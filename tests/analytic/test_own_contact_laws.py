"""Whole runs with contact laws by expressions and of tight fits, wherever the program uses a contact law."""

from __future__ import annotations

import re
import tomllib
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import flexclear as fc
from flexclear.dynamics import analyses
from flexclear.dynamics.linear.clearance_response import _separation
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
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


def same(one: xr.Dataset, other: xr.Dataset, within: float, of_times: float = 1e-9) -> None:
    """Two runs agree at the output times, and in their events."""
    assert other["event_kind"].values.tolist() == one["event_kind"].values.tolist()
    assert other["event_time"].values == pytest.approx(one["event_time"].values, rel=of_times)
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


# Tables ---------------------------------------------------------------------------------------------------------------
def table(points: Any, of: list[tuple[str, str]], unit: str, between: str = "cubic") -> dict[str, Any]:
    columns = [{"column": name, "unit": one} for name, one in of]
    value = {"column": "value", "unit": unit}
    return {"file": "made.csv", "of": columns, "value": value, "between": between, "points": points}


#: K depth^1.5 with K = 1e10 N/m^1.5, at penetrations up to 0.4 mm that are denser where the curve bends
SPRING = table([(4e-4 * x**2, 8e4 * x**3) for x in np.linspace(0.0, 1.0, 41).tolist()], [("depth", "m")], "N")
STRIBECK, FAST = "(d + (s - d)*exp(-(slip/v)^2))*tanh(slip/w)", np.linspace(0.0, 1.0, 401) ** 2 * 20.0
COEFFICIENTS = (0.08 + 0.04 * np.exp(-((FAST / 2.0) ** 2))) * np.tanh(FAST / 0.5)


def test_a_constant_table_is_its_constant() -> None:
    corners = [(v, f, 0.1) for v in (0.0, 100.0) for f in (0.0, 1e6)]
    flat = table(corners, [("slip", "m/s"), ("force", "N")], "1", "linear")
    coefficient = OWN_SLIDES["coefficient"].replace("m*", "table(mu, slip, normal_force)*")
    values = {name: value for name, value in OWN_SLIDES["values"].items() if name != "m"}
    looked_up = OWN_SLIDES | {"coefficient": coefficient, "values": values, "tables": {"mu": flat}}
    one, other = (simulated(slider_crank(**{"joint.pin.friction": law})) for law in (OWN_SLIDES, looked_up))
    same(one, other, 1e-6)


def test_a_sampled_stribeck_curve_is_that_curve() -> None:
    """Splines through 401 points miss it by 1e-8 of friction at most; rounding grows over the impacts."""
    values = {"d": 0.08, "s": 0.12, "v": "2 m/s", "w": "0.5 m/s"}
    known = {"law": "expression", "coefficient": STRIBECK, "values": values}
    sampled = table(np.c_[FAST, COEFFICIENTS].tolist(), [("slip", "m/s")], "1")
    law = {"law": "expression", "coefficient": "table(mu, slip)", "tables": {"mu": sampled}}
    one, other = (simulated(slider_crank(**{"joint.pin.friction": one})) for one in (known, law))
    same(one, other, 1e-5, 1e-7)
    closes(other)
    assert float(other["contact_friction_loss"].values[-1].sum()) > 1e-3


def test_books_balance_with_a_force_by_a_table() -> None:
    """The energy is that of each piece of the spline, which is near K d^1.5."""
    law = OWN | {"force": "table(f, depth)*(1 + a*rate/impact_rate)", "values": {"a": 0.4}, "tables": {"f": SPRING}}
    one, other = (simulated(slider_crank(**{"joint.pin.normal": normal})) for normal in (OWN, law))
    closes(other)
    closings = [run["event_time"].values[run["event_kind"].values == "closing"][:3] for run in (one, other)]
    assert closings[1] == pytest.approx(closings[0], rel=1e-3)
    assert other["contact_normal_force"].values.max() > 100.0


def test_an_ideal_joint_rubs_by_a_table() -> None:
    sampled = table(np.c_[FAST, COEFFICIENTS].tolist(), [("slip", "m/s")], "1")
    values = {"d": 0.08, "s": 0.12, "v": "2 m/s", "w": "0.5 m/s"}
    laws = (
        {"law": "expression", "radius": "0.2 m", "coefficient": STRIBECK, "values": values},
        {"law": "expression", "radius": "0.2 m", "coefficient": "table(mu, slip)", "tables": {"mu": sampled}},
    )
    one, other = (simulated(scene("pendulum", **{"joint.hinge.friction": law, "time.end": "1 s"})) for law in laws)
    assert other["position"].values[-1] == pytest.approx(one["position"].values[-1], rel=1e-6)
    assert float(one["joint_friction_loss"].values[-1].sum()) > 1e-2
    slow = laws[1] | {"tables": {"mu": table([(0.0, 0.0), (0.01, 0.1)], [("slip", "m/s")], "1", "linear")}}
    with pytest.raises(SolverError, match=r"joint hinge: slip = 0\.01 m/s leaves table mu"):
        simulated(scene("pendulum", **{"joint.hinge.friction": slow, "time.end": "1 s"}))


def test_a_run_ends_where_a_contact_leaves_its_table_and_says_so() -> None:
    slow = table([(0.0, 0.0), (0.5, 0.1), (1.0, 0.1)], [("slip", "m/s")], "1", "linear")
    law = {"law": "expression", "coefficient": "table(mu, slip)", "tables": {"mu": slow}}
    says = r"contact pin: slip = [0-9.]+ m/s leaves table mu \(made.csv\), whose points are at 0 to 1 m/s"
    with pytest.raises(SolverError, match=says):
        simulated(slider_crank(**{"joint.pin.friction": law}))
    thin = table([(1e-6 * k, 1.0 * k) for k in range(3)], [("depth", "m")], "N")
    spring = {"law": "expression", "force": "table(f, depth)", "tables": {"f": thin}}
    with pytest.raises(SolverError, match=r"contact pin: depth = [0-9.e-]+ m leaves table f"):
        simulated(slider_crank(**{"joint.pin.normal": spring}))


def test_derivatives_go_through_the_table_of_a_contact() -> None:
    deep = table([(0.05 * x**2, 0.05 * x**3) for x in np.linspace(0.0, 1.0, 21).tolist()], [("depth", "m")], "m")
    law = {
        "law": "expression",
        "force": "K*table(f, depth)*(1 + a*rate/impact_rate)",
        "values": {"K": "1e6 N/m", "a": 0.4},
        "tables": {"f": deep},
    }
    changed = {"joint.contact.normal": law, "time.end": 0.5, "solver.rtol": 1e-10}
    of = ["ball.position.final", "ball.velocity.final", "contact.peak_force", "contact.impulse"]
    agree(scene("bounce", **changed), of, {f"joint.contact.normal.values.{name}": 1e-2 for name in ("K", "a")}, 1e-3)


def test_the_file_of_a_contact_is_searched_for_next_to_the_scene(tmp_path: Path) -> None:
    rows = "\n".join(f"{x},{1e8 * x**1.5}" for x in np.linspace(0.0, 0.01, 30).tolist())
    (tmp_path / "spring.csv").write_text(f"depth,force\n{rows}\n")
    text = (TREE / "scenes/checks/bounce.toml").read_text()
    columns = 'of = { column = "depth", unit = "m" }, value = { column = "force", unit = "N" }'
    normal = (
        f'normal = {{ law = "expression", force = "table(f, depth)", tables.f = {{ file = "spring.csv", {columns} }} }}'
    )
    (tmp_path / "my.toml").write_text(re.sub("normal = .*", normal, text))
    law: Any = load_scene(tmp_path / "my.toml").joint["contact"]
    assert len(law.normal.tables["f"].points) == 30
    (tmp_path / "spring.csv").write_text("depth,force\n0,0\n1,nan\n")
    with pytest.raises(InputError, match=r"spring\.csv has values that are no finite numbers"):
        load_scene(tmp_path / "my.toml")
