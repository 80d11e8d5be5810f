"""Flexible bodies that turn fast, against closed forms and solutions that no floating frame was used for.

Values: `tests/reference/turning_bodies.json`, with their theories and routes in docs/rotors.md.
"""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.families import turning
from benchmarks.families.turning import ALONG, CASES, STEEL, Body, circle, compared, known, rectangle, rod, vibrations
from flexclear.dynamics import analyses
from flexclear.scene.schema import Scene
from flexclear.structure.kinds import kind
from flexclear.system.progress import silent

#: 1.2 m of 20 mm steel, clamped to its hub, every coordinate of three elements
SHAFT = Body(rod(1.2, circle(0.01), "rayleigh", 3))


def frequencies(body: Body, speed: float) -> np.ndarray:
    """Of small motions about the steady turn, in turning axes [rad/s]."""
    values: np.ndarray = 2.0 * np.pi * vibrations(body, speed)["frequency"].values
    return values


def nearest(values: np.ndarray, wanted: float) -> float:
    return float(values[np.argmin(np.abs(values - wanted))])


@pytest.mark.parametrize("theory", ["rayleigh", "euler-bernoulli", "timoshenko"])
def test_torsion_of_a_shaft_does_not_know_that_it_turns(theory: str) -> None:
    """c_t/(4 L), at rest as at four times that angular speed; with shapes linear in the modes it fell to zero."""
    shaft = replace(SHAFT, recipe=SHAFT.recipe | {"theory": theory})
    exact = 2.0 * np.pi * 670.400662
    rest, fast = (nearest(frequencies(shaft, speed), exact) for speed in (0.0, 16000.0))
    # quadratic twist in three elements: (h k)^4 / 720 with h k = pi / 6 is 1.0e-4
    assert rest == pytest.approx(exact, rel=2e-4)
    # derivatives of the right-hand side are exact; eigenvalues lie up to 1e6 times this one
    assert fast == pytest.approx(rest, rel=1e-7)


def test_torsion_of_a_solid_shaft_does_not_know_it_either() -> None:
    """Hoop and radial stress of the spin cancel the softening, up to rho Omega^2 R^2 / E = 3e-5."""
    frames = {n: {"on": {"region": r}, "tie": "rigid", "axes": ALONG} for n, r in (("A", "start"), ("B", "end"))}
    cells = {"along": 4, "across": 2, "rings": 1}
    shape = {"type": "cylinder", "radius": 0.01, "length": 0.2, "element": "hex20", "cells": cells}
    shaft = Body({"interfaces": ["A", "B"], "shape": shape, "material": STEEL, "frames": frames}, up_to=3e4)
    exact = 2.0 * np.pi * 670.400662 * 6.0
    rest, fast = (nearest(frequencies(shaft, speed), exact) for speed in (0.0, 3000.0))
    # without the stresses: 1 - (3000 / 25274)^2 / 2, lower by 7e-3
    assert fast == pytest.approx(rest, rel=1e-4)


@pytest.mark.parametrize("theory", ["rayleigh", "timoshenko", "euler-bernoulli"])
def test_whirl_does_not_depend_on_the_reference_condition_of_a_complete_basis(theory: str) -> None:
    """Other conditions tie another frame to the same motion; linear shapes differed by 5e-3 to 0.3."""
    speed = 3.0 * 799.55346
    recipe = rod(0.8, circle(0.02), theory, 3)
    bodies = [
        Body(recipe, "pins"),
        Body(recipe, "pins", "free-free"),
        Body(recipe | {"interfaces": ["B", "A"]}, "pins"),
    ]
    first, *others = (frequencies(body, speed)[:10] for body in bodies)
    for other in others:
        assert other == pytest.approx(first, rel=1e-6)


@pytest.mark.parametrize(
    "case", ["2-rayleigh-pins", "2-timoshenko-pins", "2-euler-bernoulli-pins", "3a", "4-clamped-free"]
)
def test_whirl_meets_closed_forms_as_well_as_at_rest(case: str) -> None:
    """Forward and backward whirls of three theories, a thick disc, a rectangular shaft with its unstable ranges."""
    body, of = CASES[case](), turning.speeds(case)
    coarse = body if "elements" not in body.recipe else replace(body, recipe=body.recipe | {"elements": 8}, up_to=6e3)
    at_rest = turning.difference(case, of[0], coarse)
    for speed in (of[len(of) // 2], of[-1]):
        found = turning.difference(case, speed, coarse)
        # forward whirls in turning axes are differences of frequency and speed, up to five times smaller than either
        assert found["error"] < 6.0 * at_rest["error"] + 1e-6
        # growth: a difference of two stiffnesses, so its error is that of their ratio to it
        assert found.get("growth_error", 0.0) < 20.0 * at_rest["error"] + 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_every_case_meets_its_solution(case: str) -> None:
    """Up to the mesh's error, and the order of the axial strain where a blade is pulled."""
    of = turning.speeds(case)
    # at 71 rad/s, 1.4 % below buckling, the frequency of the solid is a difference of 6 times its mesh's error at rest
    errors = [compared(case, speed)["error"] for speed in (of[0], of[-2] if case == "6-solid" else of[-1])]
    strained = 2e-3 if case.startswith(("5", "6")) else 0.0
    # blades at 45 degrees twist under the propeller moment by 0.02 rad; inward ones are close to buckling
    allowance = {"5": 5e-3, "6": 2e-2}.get(case[0], 0.0)
    assert errors[1] < 6.0 * errors[0] + strained + allowance + 1e-5


def test_a_blade_stiffens_in_torsion_by_its_tension_and_the_propeller_moment() -> None:
    """467.70 Hz at 600 rad/s by exact beams and by Houbolt & Brooks (1957); 445.73 Hz at rest."""
    blade = CASES["5-rayleigh-pitch0"]()
    coarse = replace(blade, recipe=blade.recipe | {"elements": 4}, up_to=3e3)
    rest, fast = (nearest(frequencies(coarse, speed), 2.0 * np.pi * f) for speed, f in ((0.0, 445.73), (600.0, 467.7)))
    exact = (2.0 * np.pi) ** 2 * (467.70362**2 - 445.733566**2)
    # the axial strain at the root is 2e-3
    assert fast**2 - rest**2 == pytest.approx(exact, rel=5e-3)


def test_a_blade_at_45_degrees_bends_in_the_axes_that_its_propeller_moment_twists() -> None:
    """289.625 rad/s at 300 rad/s by exact beams; without inertia of the coupling by twist, 6.7e-4 less."""
    blade = CASES["5-rayleigh-pitch45"]()
    found = frequencies(replace(blade, recipe=blade.recipe | {"elements": 8}, up_to=3e3), 300.0)
    # the axial strain at the root is 5e-4, the twist 5e-3 rad
    assert nearest(found, 289.625) == pytest.approx(289.625, rel=3e-4)


def test_a_strip_buckles_sideways_as_its_elastica_does() -> None:
    """1.0037 times Prandtl's load 4.0126 sqrt(E I2 G J) / L^2, from the Kirchhoff rod's bifurcation by shooting."""
    E, length, width, height = 70e9, 0.5, 0.04, 0.002
    strip = Body(rod(length, rectangle(width, height), "rayleigh", 4, turning.ALUMINIUM), stiffening=True)
    torsion = float(kind.build(strip.recipe)["second_moment"].values[0, 0])
    prandtl = 4.0126 * E * np.sqrt(width * height**3 / 12.0 * torsion / 2.6) / length**2
    table = turning.turning(strip, 0.0)
    loads, squares = (0.98, 0.995), []
    for load in loads:
        table["load"] = {"end": {"type": "point-force", "frame": "rod.B", "force": [0.0, load * prandtl, 0.0]}}
        found = analyses.frequencies(Scene.model_validate(table), {"rod": turning.reduced(strip)}, silent)
        squares.append(float(found["frequency"][0]) ** 2)
    # bending before it raises the load; a third of this rise is of fourth order in the deformation
    critical = loads[1] + (loads[1] - loads[0]) * squares[1] / (squares[0] - squares[1])
    assert critical == pytest.approx(1.0037, abs=1.8e-3)


def test_twisting_a_turning_shaft_takes_the_energy_that_it_takes_at_rest() -> None:
    """Elastic energy each millisecond, by the modal series of the twist; it was four times too large."""
    run = turning.twisted(SHAFT)
    rows = [row for row in known()["7-torque"]["values"] if row[0] == "elastic energy"][:5]
    found = [float(run["elastic"].sel(time=t, method="nearest")) for _, t, _, _ in rows]
    # six twist coordinates: frequencies 1e-4 high, and the series' rest, are some 1e-3 of the largest energy, 6e-3 J
    assert found == pytest.approx([value for _, _, value, _ in rows], abs=3e-5)
    # next to the kinetic energy of the hub, 3.2e6 J
    assert float(np.abs(run["energy_error"]).max()) < 1e-12 * float(run["kinetic"].max())


def test_a_rectangular_shaft_is_unstable_between_its_two_critical_speeds() -> None:
    bar = Body(rod(0.5, rectangle(0.03, 0.02), "timoshenko", 4), up_to=8e3)
    low, high = 421.051395, 631.072533
    rates = [
        float(vibrations(bar, speed)["decay_rate"].min())
        for speed in (0.99 * low, 1.01 * low, 0.99 * high, 1.01 * high)
    ]
    assert [rate < -1.0 for rate in rates] == [False, True, True, False]


@pytest.mark.slow
@pytest.mark.parametrize("stiffening", [False, True])
def test_a_shaft_is_spun_up_and_struck_as_a_geometrically_exact_beam(stiffening: bool) -> None:
    """To 2527 rad/s in 50 ms, past several whirls, with a push of 4 N on its free end after 5 ms: path of that end."""
    away = turning.path_error(turning.spun_up(stiffening=stiffening))
    # in the plane of the push, 2.3e-4 m, frequencies 1e-5 high shift the phase of 40 waves by some 1e-3; across it the
    # end moves by 4.8e-6 m, through rotary inertia
    assert away[0] < 1.5e-6
    assert away[1] < 4e-7
