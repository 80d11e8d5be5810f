"""Blades and beams that turn, steadily or spun up: right with geometric stiffening, else the linear theory."""

from functools import cache

import numpy as np
import pytest
import xarray as xr
from numpy.polynomial import Legendre
from scipy.linalg import eigh

from flexclear import dynamics
from flexclear.dynamics import analyses
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import SolverError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE, bundles, frequencies
from tests.properties.mechanisms import GRAVITY, Table, joint, rigid, scene
from tests.reference.turning_beams import SPIN_UP, WRIGHT

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
        "hub": rigid(1.0, size**2, {"axle": {}}, pose={}),
    }
    joints = {"axle": joint("revolute", "ground.axle", "hub.axle")}
    for k in range(count):
        turn = 2.0 * np.pi * k / count
        c, s = np.cos(turn), np.sin(turn)
        out = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        axes = {"z": (out @ hinge).tolist(), "x": out[:, 0].tolist()}
        rim = (size * RADIUS * out[:, 0]).tolist()
        bodies["hub"]["frames"][f"rim{k}"] = {"position": rim, "axes": axes}
        root = {"root": {"axes": {"z": list(hinge), "x": [1.0, 0.0, 0.0]}}}
        pose = {"position": rim, "rotation_vector": [0.0, 0.0, turn]}
        inertia = [size**2 * J for J in (ALONG, FLAT, UPRIGHT)]
        bodies[f"blade{k}"] = rigid(MASS, inertia, root, com=[size * ARM, 0.0, 0.0], pose=pose)
        joints[f"hinge{k}"] = joint("revolute", f"hub.rim{k}", f"blade{k}.root")
    drive = {"motor": {"joint": "axle", "law": {"type": "polynomial", "coefficients": [0.0, OMEGA]}}}
    return scene(bodies, joints, drive=drive, **more)


def steady(table: Table) -> np.ndarray:
    """Angular frequencies of small motions about steady turning [rad/s]."""
    found = analyses.frequencies(Scene.model_validate(table), {}, silent, moving=True)
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
    # 4e-7 of the centrifugal acceleration
    slight = {"gravity": {**GRAVITY["gravity"], "acceleration": [0.0, -1e-3, 0.0]}}
    with pytest.raises(SolverError, match="not steady"):
        steady(blades((0.0, 0.0, 1.0), load=slight))


# Cantilevers ---------------------------------------------------------------------------------------------------------

#: sqrt(E I / (rho A)) / L^2 of meshes/checks/slender_beam.toml [rad/s]
UNIT = np.sqrt(200e9 / 7850.0) * 1e-3
LENGTH = 10.0


def turning(gamma: float) -> tuple[str, object]:
    return "drive.axle.law.coefficients", (0.0, gamma * UNIT)


def flapping_and_lagging(gamma: float, **changes: object) -> tuple[np.ndarray, np.ndarray]:
    """First three frequencies across and within the plane of turning, in units of UNIT."""
    overrides = (turning(gamma), *changes.items())
    found = frequencies("checks/rotating_beam", overrides, moving=True)
    size = np.abs(found.frame_translation.sel(frame="beam.tip").values).max(axis=1)
    omega = 2.0 * np.pi * found.frequency.values / UNIT
    bends = size.max(axis=1) > 0.1 * size.max()  # the others twist
    across = size.argmax(axis=1) == 2
    return omega[bends & across][:3], omega[bends & ~across][:3]


@pytest.mark.parametrize("gamma", WRIGHT)
def test_a_turning_cantilever_has_wrights_frequencies(gamma: int) -> None:
    """The table is required to 1e-3. Sixteen elements and a basis of 20 coordinates leave 3e-4 at most."""
    flap, lag = flapping_and_lagging(gamma)
    assert flap == pytest.approx(WRIGHT[gamma][0], rel=3e-4)
    assert lag == pytest.approx(WRIGHT[gamma][1], rel=3e-4)


def ritz(gamma: float, radius: float, lagging: bool) -> np.ndarray:
    """Three frequencies of a turning cantilever on a hub, in units of UNIT; radius in lengths, here 1 m.

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


@pytest.mark.parametrize("radius", [0.1, 1.0])
def test_a_turning_cantilever_on_a_hub_has_the_frequencies_of_its_equation(radius: float) -> None:
    flap, lag = flapping_and_lagging(6.0, **{"body.hub.frames.seat.position": (radius, 0.0, 0.0)})
    # sixteen elements and a basis of 20 coordinates leave 3e-4 at most, as without a hub
    assert flap == pytest.approx(ritz(6.0, radius, lagging=False), rel=3e-4)
    assert lag == pytest.approx(ritz(6.0, radius, lagging=True), rel=3e-4)


def test_linear_shapes_let_a_turning_cantilever_soften() -> None:
    """Floating frames with linear shapes: flapping does not change, lagging falls to omega^2 - Omega^2."""
    rest = np.array(WRIGHT[0][0])
    flap, lag = flapping_and_lagging(3, **{"body.beam.stiffening": None})
    # 16 elements and 20 coordinates: 1e-4; the squares differ by nearly as much as they are
    assert flap == pytest.approx(rest, rel=2e-4)
    assert lag == pytest.approx(np.sqrt(rest**2 - 9.0), rel=2e-4)


def test_beyond_its_first_frequency_the_linear_beam_bends_away() -> None:
    """Gamma = 4 > 3.516: the first lagging motion grows, as Kane, Ryan and Banerjee found it in programs of 1987."""
    overrides = (turning(4.0), ("body.beam.stiffening", None))
    found = frequencies("checks/rotating_beam", overrides, moving=True)
    growth = UNIT * np.sqrt(16.0 - WRIGHT[0][0][0] ** 2)
    assert -found.decay_rate.values.min() == pytest.approx(growth, rel=1e-4)


# Spun up ------------------------------------------------------------------------------------------------------------


def tip(found: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Motion of the tip along and across the undeformed axis, shape (time,) each [m]."""
    w, _, _, z = found["quaternion"].sel(body="hub").values.T
    angle = 2.0 * np.arctan2(z, w)
    r = (found.frame_position.sel(frame="beam.tip") - found.frame_position.sel(frame="beam.root")).values
    along, across = np.cos(angle) * r[:, 0] + np.sin(angle) * r[:, 1], np.cos(angle) * r[:, 1] - np.sin(angle) * r[:, 0]
    return along - LENGTH, across


SCENES: dict[str, tuple[str, dict[str, object]]] = {
    "6 rad/s with stiffening": ("checks/spinup_beam_stiffened", {}),
    "2 rad/s with stiffening": ("checks/spinup_beam", {"body.beam.stiffening": {}}),
    "2 rad/s linear FFR": ("checks/spinup_beam", {}),
}


@cache
def spun(case: str) -> xr.Dataset:
    """The run of a case at a tolerance that energies need, see below."""
    name, overrides = SCENES[case]
    scene = load_scene(TREE / "scenes" / f"{name}.toml", {**overrides, "solver.rtol": 1e-12})
    return dynamics.simulate(scene, bundles(scene), silent)


@pytest.mark.parametrize("case", SCENES)
def test_a_beam_spun_up_lags_and_recovers_as_assumed_modes_say(case: str) -> None:
    """The deflection is required to 1 % of its largest; two modal bases of one theory agree to 1e-4."""
    known = np.array(SPIN_UP[case])
    found = spun(case)
    rows = [int(np.argmin(np.abs(found.time.values - t))) for t in known[:, 0]]
    along, across = tip(found)
    largest = np.abs(known[:, 1]).max()
    assert across[rows] == pytest.approx(known[:, 1], abs=1e-4 * largest)
    foreshortened = known[:, 3] if "stiffening" in case else 0.0
    # the axial vibration of 1e-6 m has six modes there and fewer here
    assert along[rows] == pytest.approx(known[:, 2] + foreshortened, abs=3e-6)


@pytest.mark.parametrize("case", SCENES)
def test_energy_and_work_of_the_spin_up_agree(case: str) -> None:
    """A shortening that were not Lagrangian would show at 1e-4.

    Axial modes that nothing moves limit the steps by stability and ring up to the tolerance, at random: at neighbouring
    tolerances of 1e-10 the error is anything from 2e-15 to 2e-11 of the energy, whatever groups its norm has.
    At 1e-12 what rings is a hundred times smaller, its energy ten thousand times: of some thirty such runs the worst
    had 3e-14.
    """
    found = spun(case)
    assert np.abs(found.energy_error).max() < 1e-12 * found.kinetic.max()
    assert found.drive_work.values[-1] == pytest.approx(found.kinetic.values[-1] + found.elastic.values[-1], rel=1e-12)
