"""Tables in expressions of loads against the functions that they sample."""

from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import quad
from scipy.interpolate import CubicSpline

import flexclear as fc
from flexclear.dynamics import analyses
from flexclear.dynamics import lookup as lookups
from flexclear.dynamics.sensitivity.dataset import sensitivities
from flexclear.dynamics.specialise import dual, symbols
from flexclear.scene.load import scene_of
from flexclear.scene.tables import LookupTable
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import silent
from tests.analytic.test_expressions import MASS, slide
from tests.properties.mechanisms import Table, simulated

#: of the damper, sampled on 41 speeds, and of the map, a polynomial that bicubic pieces hold exactly
DAMPER, STIFF = 20.0, {"k": "300 N/m", "l": "2000 N/m^3", "c": "4 N s/m", "e": "3 N s/m^2"}
POLYNOMIAL = "-k * rail.position - l * rail.position^3 - c * rail.velocity - e * rail.position * rail.velocity"


def lookup(file: str, *of: tuple[str, str], between: str = "cubic") -> Table:
    columns = [{"column": name, "unit": unit} for name, unit in of]
    return {"file": file, "of": columns, "value": {"column": "force", "unit": "N"}, "between": between}


@pytest.fixture
def tables(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> dict[str, Table]:
    """A damper over its speed in mm/s, and a map over position and speed whose rows are shuffled."""
    monkeypatch.chdir(tmp_path)
    speeds, places = np.linspace(-2.0, 2.0, 41), np.linspace(-0.2, 0.2, 7)
    rows = [f"{1e3 * v!r},{float(DAMPER * np.tanh(v))!r}" for v in speeds.tolist()]
    (tmp_path / "damper.csv").write_text("speed,force\n" + "\n".join(rows) + "\n", encoding="utf-8-sig")
    grid = [(x, v) for x in places.tolist() for v in speeds[::10].tolist()]
    force = [300.0 * x + 2000.0 * x**3 + 4.0 * v + 3.0 * x * v for x, v in grid]
    shuffled = np.random.default_rng(1).permutation(len(grid))
    text = "\n".join(f"{grid[k][0]!r},{grid[k][1]!r},{force[k]!r}" for k in shuffled)
    (tmp_path / "map.csv").write_text(f"# measured\nplace,speed,force\n{text}\n")
    damper, over = lookup("damper.csv", ("speed", "mm/s")), (("place", "m"), ("speed", "m/s"))
    return {"damper": damper, "map": lookup("map.csv", *over)}


def test_a_table_over_two_quantities_is_its_bicubic_polynomial(tables: dict[str, Table]) -> None:
    force = {"force": "-table(map, rail.position, rail.velocity)", "tables": {"map": tables["map"]}}
    found = simulated(scene_of(slide(force, 0.15, speed=1.0)))
    known = simulated(scene_of(slide({"force": POLYNOMIAL, "values": STIFF}, 0.15, speed=1.0)))
    np.testing.assert_allclose(found.joint_position, known.joint_position, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(found.load_work, known.load_work, rtol=0.0, atol=1e-12)
    assert float(abs(found.energy_error).max()) < 1e-11


@pytest.mark.parametrize("between, within", [("cubic", 3e-6), ("linear", 3e-3)])
def test_a_damper_by_a_table_slows_a_mass_as_its_function_does(
    tables: dict[str, Table], between: str, within: float
) -> None:
    """Errors of interpolation at a spacing h of 0.1 m/s: h^4/384 max|F''''| for splines, h^2/8 max|F''| for lines."""
    table = tables["damper"] | {"between": between}
    load = {"force": "-table(damper, rail.velocity)", "tables": {"damper": table}}
    found = simulate_table(load, solver={"rtol": 1e-9})
    # m v' = -F tanh v: sinh v = sinh v0 exp(-F t/m)
    speed = np.arcsinh(np.sinh(1.5) * np.exp(-DAMPER / MASS * found.time.values))
    np.testing.assert_allclose(found.joint_velocity.values[:, 0], speed, rtol=0.0, atol=within)
    # of 2.25 J, at a tolerance of 1e-9; the third derivative of a spline jumps at each point
    assert float(abs(found.energy_error).max()) < 5e-7


def simulate_table(load: Table, **more: Any) -> xr.Dataset:
    return simulated(scene_of(slide(load, 0.0, 0.3, 1.5, **more)))


def test_a_table_and_its_slope_are_continuous_and_lines_bend_at_points(tables: dict[str, Table]) -> None:
    """On numbers with derivatives, next to a point; SciPy's spline through the same points."""
    speeds = np.linspace(-2.0, 2.0, 41)
    spline = CubicSpline(speeds, DAMPER * np.tanh(speeds))
    for between in ("cubic", "linear"):
        given = LookupTable.model_validate(tables["damper"] | {"between": between})
        numbers = np.array(lookups.numbers(given))
        assert len(numbers) == lookups.length(given.halvings())
        table = symbols.Indexed(numbers.__getitem__)
        at = [0.3, 0.3 - 1e-12, 0.3 + 1e-12, 1.9999, -2.0, 2.0]
        found = [lookups.curve(table, *given.halvings(), dual.Dual(x, np.ones(1))) for x in at]
        value, slope = np.array([one.value for one in found]), np.array([one.change[0] for one in found])
        np.testing.assert_allclose(value[1:3], value[0], rtol=0.0, atol=1e-10)
        if between == "cubic":
            np.testing.assert_allclose(value, spline(at), rtol=0.0, atol=1e-13 * DAMPER)
            np.testing.assert_allclose(slope, spline(at, 1), rtol=0.0, atol=1e-11 * DAMPER)
        else:
            steps = np.diff(DAMPER * np.tanh([0.2, 0.3, 0.4])) / 0.1
            np.testing.assert_allclose(slope[[1, 2]], steps, rtol=1e-11)
        with np.errstate(invalid="ignore"):
            assert all(np.isnan(lookups.curve(table, *given.halvings(), x)) for x in (2.001, -2.001))


def test_a_run_ends_where_it_leaves_a_table_and_says_so(tables: dict[str, Table]) -> None:
    """20 N + F tanh v exceed F: v grows from 1.5 to 2 m/s at a time given by an integral."""
    load = {"force": "push - table(damper, rail.velocity)", "tables": {"damper": tables["damper"]}}
    until = quad(lambda v: MASS / (40.0 - DAMPER * np.tanh(v)), 1.5, 2.0)[0]
    says = rf"at t = {until:.4f}\d* s: load push: speed = 2 m/s leaves table damper \(damper.csv\), whose points are"
    with pytest.raises(SolverError, match=says):
        simulate_table(load | {"values": {"push": "40 N"}})
    limited = {"force": "push - table(damper, min(rail.velocity, 2 m/s))", "tables": load["tables"]}
    found = simulate_table(limited | {"values": {"push": "40 N"}})
    assert float(found.joint_velocity[-1, 0]) > 3.0


def test_sensitivities_and_the_stiffness_of_an_equilibrium_go_through_a_table(tables: dict[str, Table]) -> None:
    force = {"force": "push - table(map, rail.position, rail.velocity)", "values": {"push": "40 N"}}
    by_table = scene_of(slide(force | {"tables": {"map": tables["map"]}}))
    known = scene_of(slide({"force": f"push {POLYNOMIAL}", "values": STIFF | {"push": "40 N"}}))
    at = [analyses.frequencies(one, {}, silent) for one in (by_table, known)]
    for name in ("frequency", "damping_ratio", "position"):
        np.testing.assert_allclose(at[0][name], at[1][name], rtol=1e-12, atol=1e-14)
    changes = [sensitivities(one, {}, silent, ["slide.position"], ["body.slide.mass"]) for one in (by_table, known)]
    found, expected = (one["slide.position"].values for one in changes)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_several_members_look_up_a_table_together(tables: dict[str, Table]) -> None:
    """The lanes of an ensemble find intervals of their own: each member is the run of its own start."""
    pytest.importorskip("numba")
    load = {"force": "-table(map, rail.position, rail.velocity)", "tables": {"map": tables["map"]}}
    starts = [0.05, 0.1, 0.15, -0.12]
    apart = [simulated(scene_of(slide(load, x, speed=0.5))).joint_position.values[-1, 0] for x in starts]
    made = scene_of(slide(load, 0.05, speed=0.5))
    swept = fc.sweep(made, {"body.slide.pose.position.2": starts}, ["rail.position.final"], workers=1)
    np.testing.assert_allclose(swept["rail.position.final"].values, apart, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize(
    "force, words",
    [
        ("table(damper, rail.position)", r"table\(damper, ...\) is over a value in m/s, not a value in m"),
        ("table(damper, slide.velocity)", r"is over a value in m/s, not a vector"),
        ("table(damper, rail.velocity, 1 m)", r"is over 1 quantities, not 2"),
        ("table(damper, 1 m/s) + table(dumper, 1 m/s)", r"there is no table 'dumper' \(known: damper\)"),
        ("table(damper, rail.velocity) * 1 m", r"its value is in N m"),
        ("4 N", r"tables.damper is not used"),
    ],
)
def test_a_wrong_use_of_a_table_is_refused(tables: dict[str, Table], force: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        scene_of(slide({"force": force, "tables": {"damper": tables["damper"]}}))
