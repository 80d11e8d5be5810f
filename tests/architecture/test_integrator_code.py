"""A scene compiles its own integrator and stepping, and no other; numbers of the solver are no code."""

import re
from pathlib import Path

import pytest
from pydantic import ValidationError

from flexclear.dynamics.compile import calls
from flexclear.dynamics.compile.sources import sources_of_functions
from flexclear.dynamics.effects import Parts, Scheme, scheme_of
from flexclear.dynamics.integrate import METHODS
from flexclear.dynamics.integrate.method import keep_nothing
from flexclear.scene.integrators import INTEGRATORS
from flexclear.scene.load import load_scene
from flexclear.scene.solver import Solver

PARTS = Parts(("free",), surfaces=("clearance-spherical",), forms=("hysteretic",))


def composed(scheme: Scheme) -> str:
    """Generated source of steps."""
    return sources_of_functions(PARTS, scheme)["advance"]


@pytest.mark.parametrize("name", METHODS)
def test_steps_compose_their_own_method_and_no_other(name: str) -> None:
    assert re.findall(r'METHODS\["([\w-]+)"\]', composed(Scheme(name))) == [name]


def test_chosen_and_fixed_steps_are_different_code() -> None:
    assert "stepping=adaptive" in composed(Scheme("dop853"))
    assert "stepping=fixed" in composed(Scheme("dop853", fixed=True))


def test_events_at_step_ends_are_compiled_when_asked_for() -> None:
    assert "AT_STEP_ENDS" not in composed(Scheme("rk4", fixed=True))
    assert "AT_STEP_ENDS" in composed(Scheme("rk4", fixed=True, located=False))


@pytest.mark.parametrize("name", METHODS)
def test_a_method_is_what_the_list_says(name: str) -> None:
    method, traits = METHODS[name], INTEGRATORS[name]
    assert method.traits is traits
    _, _, error, _, keep = method.make_kernels(lambda *_: None, calls)
    assert (error is not None) is traits.estimates is (method.error_order > 0)
    # an implicit method remembers its polynomial or its slopes to predict by, a multistep one needs them
    assert (keep is not keep_nothing) is (method.room.vectors > 0)
    # stability limits who tells of stiffness and who hands over; to a method that it does not limit
    if traits.implicit:
        assert method.stability is None
        assert not traits.hands_over_to
    else:
        assert INTEGRATORS[traits.hands_over_to].implicit


def test_scenes_and_family_know_the_same_names() -> None:
    assert set(INTEGRATORS) == set(METHODS)


def test_the_table_of_the_page_says_what_the_list_says(root: Path) -> None:
    page = (root / "docs" / "integrators.md").read_text()
    table = {row[1]: row[2:] for row in (line.split("|") for line in page.splitlines()) if len(row) == 6}
    rows = {name.strip(" `"): (what, steps) for name, (what, steps, *_) in table.items() if name.startswith(" `")}
    assert list(rows) == list(INTEGRATORS)
    for name, traits in INTEGRATORS.items():
        what, steps = rows[name]
        assert f"order {traits.order}" in what
        assert ("implicit" in what) is traits.implicit
        assert ("chosen" in steps) is traits.estimates


@pytest.mark.parametrize(
    "one, other",
    [
        ({"step": 1e-5}, {"step": 1e-6}),
        ({"integrator": "generalized-alpha"}, {"integrator": "generalized-alpha", "rho_inf": 0.1}),
        ({}, {"rtol": 1e-6}),
    ],
    ids=["step", "rho_inf", "rtol"],
)
def test_no_number_of_the_solver_is_compiled_in(root: Path, one: dict, other: dict) -> None:
    path = root / "scenes" / "sps4" / "csj.toml"
    schemes = {scheme_of(load_scene(path, {"solver": solver}).solver) for solver in (one, other)}
    assert len(schemes) == 1


def test_a_parameter_that_is_none_has_its_default_and_one_that_is_no_number_is_refused() -> None:
    assert Solver(integrator="generalized-alpha", step=1e-3, rho_inf=None) == Solver(
        integrator="generalized-alpha", step=1e-3
    )
    for value in (float("nan"), float("inf"), "nan", True):
        with pytest.raises(ValidationError, match="rho_inf"):
            Solver(integrator="generalized-alpha", step=1e-3, rho_inf=value)
