"""A scene reaches and compiles its own integrator and stepping, and no other; numbers of the solver are no code."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.core.integrators import INTEGRATORS
from pipeline.core.scene.load import load_scene
from pipeline.dynamics.compile import functions
from pipeline.dynamics.compile.sources import sources
from pipeline.dynamics.effects import Parts, Scheme, scheme_of
from pipeline.dynamics.integrate import NAMES
from stages import s4_simulate

PACKAGE = "pipeline.dynamics.integrate"
PARTS = Parts(("free",), surfaces=("clearance-spherical",), forms=("hysteretic",))
#: modules of one integrator, reached by those that name it only
PRIVATE = {
    "dop853": {"dop853", "runge_kutta"},
    "dopri5": {"dopri5", "runge_kutta"},
    "rk4": {"rk4", "runge_kutta", "hermite"},
    "adams-bashforth-moulton": {"adams", "rk4", "runge_kutta", "hermite"},
    "generalized-alpha": {"generalized_alpha", "newton", "hermite"},
    "radau": {"radau", "newton", "hermite"},
}
STEPPING = {"adaptive", "fixed"}


def reached(scheme: Scheme) -> set[str]:
    """Modules of the family that the machine code of a scheme depends on."""
    modules = {name for text in sources(PARTS, scheme).values() for name in functions.reached(text)}
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


def test_scenes_and_family_know_the_same_names() -> None:
    assert set(INTEGRATORS) == set(NAMES)


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


@pytest.mark.parametrize("solver", [{}, {"step": 1e-5}, {"integrator": "rk4", "step": 1e-5, "events": "at step ends"}])
def test_the_key_of_a_run_holds_what_its_code_reaches(root: Path, solver: dict) -> None:
    scene = load_scene(root / "scenes" / "sps4" / "csj.toml", {"solver": solver})
    known = functions.SOURCES.closure(["stages.s4_simulate", *s4_simulate.modules(scene)]).keys()
    assert {f"{PACKAGE}.{name}" for name in reached(scheme_of(scene.solver))} <= set(known)
