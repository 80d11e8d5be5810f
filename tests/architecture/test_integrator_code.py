"""A scene reaches and compiles its own integrator and stepping, and no other; numbers of the solver are no code."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from flexclear.dynamics.compile import reach
from flexclear.dynamics.compile.sources import sources
from flexclear.dynamics.effects import Parts, Scheme, scheme_of
from flexclear.dynamics.equations import composite
from flexclear.dynamics.integrate import NAMES
from flexclear.dynamics.integrate.method import keep_nothing
from flexclear.scene.integrators import INTEGRATORS
from flexclear.scene.load import load_scene
from flexclear.scene.registry import lookup
from flexclear.scene.solver import Solver

PACKAGE = "flexclear.dynamics.integrate"
PARTS = Parts(("free",), surfaces=("clearance-spherical",), forms=("hysteretic",))
#: modules of one integrator, reached by those that name it only
PRIVATE = {
    "dop853": {"dop853", "runge_kutta"},
    "dopri5": {"dopri5", "runge_kutta"},
    "rk4": {"rk4", "runge_kutta", "hermite"},
    "adams-bashforth-moulton": {"adams", "rk4", "runge_kutta", "hermite"},
    "generalized-alpha": {"generalized_alpha", "newton", "hermite"},
    "radau": {"radau", "newton", "hermite"},
    "exponential": {"exponential", "modal_basis", "phi_functions", "newton"},
}
STEPPING = {"adaptive", "fixed"}


def reached(scheme: Scheme) -> set[str]:
    """Modules of the family that the machine code of a scheme depends on."""
    modules = {name for text in sources(PARTS, scheme).values() for name in reach.reached(text)}
    return {name.removeprefix(f"{PACKAGE}.") for name in modules if name.startswith(f"{PACKAGE}.")}


@pytest.mark.parametrize("name", NAMES)
def test_an_integrator_reaches_no_other(name: str) -> None:
    every = set().union(*PRIVATE.values())
    assert reached(Scheme(name)) & every == PRIVATE[name]


def test_chosen_and_fixed_steps_are_different_code() -> None:
    assert reached(Scheme("dop853")) & STEPPING == {"adaptive"}
    assert reached(Scheme("dop853", fixed=True)) & STEPPING == {"fixed"}


def test_events_at_step_ends_are_compiled_when_asked_for() -> None:
    assert "step_end_events" not in reached(Scheme("rk4", fixed=True))
    assert "step_end_events" in reached(Scheme("rk4", fixed=True, located=False))


@pytest.mark.parametrize("name", NAMES)
def test_a_method_is_what_the_list_says(name: str) -> None:
    method, traits = lookup(PACKAGE, name, where="test"), INTEGRATORS[name]
    assert method.traits is traits
    given = [lambda *_: None] * 2
    _, _, error, _, keep = method.make_kernels(*given, *([(given[0], composite)] if traits.reads_all else []))
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
    assert set(INTEGRATORS) == set(NAMES)


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
