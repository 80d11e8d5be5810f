"""Bushings with unsymmetric matrices, as bearings have them: whirl, work and vibrations against closed forms."""

import numpy as np
import pytest

from flexclear.dynamics import analyses
from flexclear.scene.schema import Scene
from flexclear.system.progress import silent
from tests.properties.mechanisms import Table, rigid, scene, simulate

#: a mass on springs with a force across the displacement [kg, N/m]; with z = x + iy, m z'' + k z = i kc z
MASS, DIRECT = 2.0, 800.0


def cross_coupled(direct: float, across: float) -> list[list[float]]:
    """Stiffness matrix with `across` from y to x and its opposite from x to y; the other displacements have springs."""
    matrix = np.diag([direct, direct, 600.0, 5.0, 6.0, 7.0])
    matrix[0, 1], matrix[1, 0] = across, -across
    return [[float(entry) for entry in row] for row in matrix]


def whirling(across: float, direct: float = DIRECT, end: float = 1.0, **more: object) -> Table:
    mount = {"type": "bushing", "between": ["ground.o", "b.o"], "symmetric": False}
    loads = {"mount": {**mount, "stiffness": cross_coupled(direct, across), **more}}
    bodies = {
        "ground": {"type": "ground", "frames": {"o": {}}},
        "b": rigid(MASS, 0.01, {"o": {}}, pose={"position": [1e-3, 0.0, 0.0]}, velocity=[0.0, 0.01, 0.0]),
    }
    return scene(bodies, {}, end, load=loads)


@pytest.mark.parametrize("across", [300.0, -300.0])
def test_a_cross_coupled_bearing_whirls_by_its_closed_form_and_its_energy_is_booked(across: float) -> None:
    """With m l^2 + k + i kc = 0 one whirl grows; the energy gained is 2 kc times the area that the path encloses."""
    run = simulate(whirling(across))
    root = np.sqrt((-DIRECT + 1j * across) / MASS)
    t, start, speed = run.time.values, 1e-3, 0.01j
    known = start * np.cosh(root * t) + speed / root * np.sinh(root * t)
    found = run.position.values[:, 0, 0] + 1j * run.position.values[:, 0, 1]
    size = np.abs(known).max()
    assert size > 5.0 * start
    # rtol 1e-12 over some hundred steps
    assert np.abs(found - known).max() < 1e-9 * size
    rate = start * root * np.sinh(root * t) + speed * np.cosh(root * t)
    energy = 0.5 * MASS * np.abs(rate) ** 2 + 0.5 * DIRECT * np.abs(known) ** 2
    assert run.load_work.values == pytest.approx(energy - energy[0], abs=1e-8 * energy.max())
    assert np.abs(run.energy_error).max() < 1e-9 * energy.max()


@pytest.mark.parametrize("turns", [1.0, -1.0])
def test_the_work_of_cross_coupling_on_a_circle_is_twice_its_area(turns: float) -> None:
    """Drives carry the mass round a circle: 2 kc pi r^2 of work in each direction, and none of the damping across."""
    radius, across, seconds = 0.03, 250.0, 0.5
    sine = {"type": "harmonic", "amplitude": radius, "frequency": f"{1.0 / seconds} Hz"}
    cosine = {**sine, "phase": f"{90.0 * turns} deg"}
    axes = {"x": {"z": [1, 0, 0], "x": [0, 1, 0]}, "y": {"z": [0, 1, 0], "x": [1, 0, 0]}}
    frames = {name: {"axes": one} for name, one in axes.items()}
    bodies = {
        "ground": {"type": "ground", "frames": {"o": {}, **frames}},
        "slide": rigid(1.0, 0.01, frames, pose={}),
        "b": rigid(MASS, 0.01, {"o": {}, **frames}, pose={"position": [0.0, turns * radius, 0.0]}),
    }
    joints = {
        "X": {"type": "prismatic", "between": ["ground.x", "slide.x"]},
        "Y": {"type": "prismatic", "between": ["slide.y", "b.y"]},
    }
    damping = np.zeros((6, 6))
    damping[0, :2], damping[1, :2] = [4.0, 9.0], [-9.0, 4.0]
    mount = whirling(across, damping=damping.tolist())["load"]
    drives = {"X": {"joint": "X", "law": sine}, "Y": {"joint": "Y", "law": cosine}}
    run = simulate(scene(bodies, joints, seconds, load=mount, drive=drives))
    x, y = (run.position.sel(body="b").values[:, k] for k in (0, 1))
    assert x == pytest.approx(radius * np.sin(2.0 * np.pi * run.time.values / seconds), abs=1e-12)
    sense = np.sign(np.sum(x[:-1] * y[1:] - y[:-1] * x[1:]))
    area = np.pi * radius**2
    # integrals of squares of sines at rtol 1e-12
    assert run.load_work.values[-1] == pytest.approx(sense * 2.0 * across * area, rel=1e-9)
    speed = 2.0 * np.pi * radius / seconds
    assert run.load_loss.values[-1] == pytest.approx(4.0 * speed**2 * seconds, rel=1e-9)


@pytest.mark.parametrize("direct, across", [(DIRECT, 300.0), (DIRECT, 5e3), (0.0, 300.0), (-200.0, 300.0)])
def test_vibrations_on_cross_coupled_bearings_are_those_of_the_closed_form(direct: float, across: float) -> None:
    """With m l^2 + k +- i kc = 0; springs across the plane and against rotation are free of it."""
    table = whirling(across, direct)
    table["body"]["b"] |= {"pose": {}, "velocity": [0.0, 0.0, 0.0]}
    small = analyses.frequencies(Scene.model_validate(table), {}, silent)
    whirl = np.sqrt((-direct + 1j * across) / MASS)
    known = [whirl, -whirl.conjugate(), *(1j * np.sqrt([600.0 / MASS, 500.0, 600.0, 700.0]))]
    found = -small.decay_rate.values + 2j * np.pi * small.frequency.values
    for value in known:
        assert np.abs(found - value).min() < 1e-9 * abs(value)
    assert len(found) == len(known)


def test_a_rotor_settles_under_its_weight_across_its_bearings() -> None:
    """Where the force across the displacement exceeds the one along it, x = K^-1 m g all the same."""
    table = whirling(5.0 * DIRECT)
    table["load"]["gravity"] = {"type": "gravity", "acceleration": [0.0, -9.81, 0.0]}
    found = analyses.equilibrium(Scene.model_validate(table), {}, silent)
    known = np.linalg.solve([[DIRECT, 5.0 * DIRECT], [-5.0 * DIRECT, DIRECT]], [0.0, -MASS * 9.81])
    assert found.position.sel(body="b").values[:2] == pytest.approx(known, abs=1e-12)
