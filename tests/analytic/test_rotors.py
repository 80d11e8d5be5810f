"""Blades on a hub with a radius, at steady speed: their frequencies, and what counts as steady."""

import numpy as np
import pytest
from numpy.polynomial import Legendre
from scipy.linalg import eigh

from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.dynamics import analyses
from tests.analytic.test_turning_beams import flapping_and_lagging
from tests.properties.mechanisms import GRAVITY, Table, joint, scene
from tests.reference.turning_beams import WRIGHT

#: speed of the hub [rad/s]; radius of the hub, distance of the blade's centre from its hinge [m]; mass [kg]
OMEGA, RADIUS, ARM, MASS = 60.0, 0.3, 0.4, 0.5
#: about its centre, along it, in the plane of turning and out of it [kg m^2]
ALONG, FLAT, UPRIGHT = 0.001, 0.02, 0.0205


def blades(hinge: tuple[float, float, float], count: int = 1, size: float = 1.0, **more: object) -> Table:
    """Rigid blades at the rim of a driven hub, each on a hinge; hinge: its axis where the blade lies along x.

    size: all lengths are as much shorter, and inertias.
    """
    bodies: Table = {
        "ground": {"type": "ground", "frames": {"axle": {}}},
        "hub": {"type": "rigid", "mass": 1.0, "inertia": [size**2] * 3, "pose": {}, "frames": {"axle": {}}},
    }
    joints = {"axle": joint("revolute", "ground.axle", "hub.axle")}
    for k in range(count):
        turn = 2.0 * np.pi * k / count
        c, s = np.cos(turn), np.sin(turn)
        out = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        axes = {"z": (out @ hinge).tolist(), "x": out[:, 0].tolist()}
        rim = (size * RADIUS * out[:, 0]).tolist()
        bodies["hub"]["frames"][f"rim{k}"] = {"position": rim, "axes": axes}
        bodies[f"blade{k}"] = {
            "type": "rigid", "mass": MASS, "com": [size * ARM, 0.0, 0.0],
            "inertia": [size**2 * J for J in (ALONG, FLAT, UPRIGHT)],
            "pose": {"position": rim, "rotation_vector": [0.0, 0.0, turn]},
            "frames": {"root": {"axes": {"z": list(hinge), "x": [1.0, 0.0, 0.0]}}},
        }  # fmt: skip
        joints[f"hinge{k}"] = joint("revolute", f"hub.rim{k}", f"blade{k}.root")
    drive = {"motor": {"joint": "axle", "law": {"type": "polynomial", "coefficients": [0.0, OMEGA]}}}
    return scene(bodies, joints, drive=drive, **more)


def steady(table: Table) -> np.ndarray:
    """Angular frequencies of small motions about steady turning [rad/s]."""
    found = analyses.frequencies(Scene.model_validate(table), {}, lambda fraction, text: None, moving=True)
    return 2.0 * np.pi * found.frequency.values


LAG = OMEGA * np.sqrt(RADIUS * MASS * ARM / (UPRIGHT + MASS * ARM**2))
FLAP = OMEGA * np.sqrt((RADIUS * MASS * ARM + UPRIGHT - ALONG + MASS * ARM**2) / (FLAT + MASS * ARM**2))


@pytest.mark.parametrize("size", [1.0, 1e-6])
@pytest.mark.parametrize("hinge, known", [((0.0, 0.0, 1.0), LAG), ((0.0, 1.0, 0.0), FLAP)], ids=["lag", "flap"])
def test_a_hinged_blade_vibrates_as_the_centrifugal_force_pulls_it(
    hinge: tuple[float, float, float], known: float, size: float
) -> None:
    """In the plane (frequency/Omega)^2 = e S / I, across it (e S + I_z - I_x) / I_y, S = m a, I about the hinge."""
    # a smooth closed form, differenced to 1e-9
    assert steady(blades(hinge, size=size)) == pytest.approx([known], rel=1e-9)


def test_blades_whose_forces_balance_in_the_hub_are_steady_too() -> None:
    """Nothing is left of their centrifugal forces at the axle."""
    assert steady(blades((0.0, 0.0, 1.0), count=3)) == pytest.approx([LAG] * 3, rel=1e-9)


def test_a_blade_that_weight_moves_is_not_steady() -> None:
    """The axle lies level, so that the weight pulls the blade now forward, now back."""
    level = {"gravity": {**GRAVITY["gravity"], "acceleration": [0.0, -9.81, 0.0]}}
    with pytest.raises(SolverError, match="not steady"):
        steady(blades((0.0, 0.0, 1.0), load=level))
    slight = {"gravity": {**GRAVITY["gravity"], "acceleration": [0.0, -1e-3, 0.0]}}
    with pytest.raises(SolverError, match="not steady"):  # 4e-7 of the centrifugal acceleration
        steady(blades((0.0, 0.0, 1.0), load=slight))


def ritz(gamma: float, radius: float, lagging: bool) -> np.ndarray:
    """Three frequencies of a turning cantilever on a hub, in units of sqrt(E I / (rho A)) / L^2; radius in lengths.

    Galerkin's method for w'''' - gamma^2 (T w')' - [gamma^2 w in the plane] = omega^2 w with the tension
    T = ((1 + r)^2 - (x + r)^2) / 2 and x^2 times Legendre's polynomials.
    """
    x = Legendre.identity(domain=[0.0, 1.0])
    shapes = [x * x * Legendre.basis(k, domain=[0.0, 1.0]) for k in range(14)]
    tension = 0.5 * ((1.0 + radius) ** 2 - (x + radius) ** 2)

    def product(f: Legendre, g: Legendre) -> float:
        whole = (f * g).integ()
        return float(whole(1.0) - whole(0.0))

    bending = np.array([[product(f.deriv(2), g.deriv(2)) for f in shapes] for g in shapes])
    pulling = np.array([[product(tension * f.deriv(), g.deriv()) for f in shapes] for g in shapes])
    mass = np.array([[product(f, g) for f in shapes] for g in shapes])
    stiffness = bending + gamma**2 * (pulling - (mass if lagging else 0.0))
    return np.sqrt(eigh(stiffness, mass, eigvals_only=True)[:3])


def test_galerkins_method_has_wrights_frequencies_without_a_hub() -> None:
    for k, known in enumerate(WRIGHT[6]):
        assert ritz(6.0, 0.0, lagging=k == 1) == pytest.approx(known, rel=1e-9)


@pytest.mark.parametrize("radius", [0.1, 1.0])
def test_a_turning_cantilever_on_a_hub_has_the_frequencies_of_its_equation(radius: float) -> None:
    """The beam is 1 m long."""
    flap, lag = flapping_and_lagging(6.0, **{"body.hub.frames.seat.position": (radius, 0.0, 0.0)})
    # sixteen elements and a basis of 20 coordinates leave 3e-4 at most, as without a hub
    assert flap == pytest.approx(ritz(6.0, radius, lagging=False), rel=3e-4)
    assert lag == pytest.approx(ritz(6.0, radius, lagging=True), rel=3e-4)
