"""Layouts identified from Table 8: the closed form, the kinematics behind it, and the scenes made of it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks import layouts
from benchmarks.layouts import DANGLE, DZ, Layout, answer, jacobians, poses
from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.stages.scenes import find_scene
from papers.wang_wang_2019.published import TABLE8

TREE = Path(__file__).resolve().parents[2]
TAKEN = (0.07, 0.15, 0.35)


def lengths(layout: Layout, z: float, angle: float) -> np.ndarray:
    """Lengths of the legs in a pose, from the places of their ends alone."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return np.linalg.norm(layout.A @ turn.T + [0.0, 0.0, z] - layout.B, axis=1)


def test_poses_have_the_lengths_of_the_legs() -> None:
    layout, extensions = layouts.fitted(*TAKEN), np.linspace(0.0, 0.06, 7)
    for extension, z, angle in zip(extensions, *poses(layout, extensions), strict=True):
        requested = layout.leg + np.array([extension, extension, 0.0, 0.0])
        assert lengths(layout, z, angle) == pytest.approx(requested, abs=1e-13)  # rounding of lengths below 0.5 m


def test_the_answer_to_leg_1_is_that_of_finite_changes() -> None:
    """A change of legs 1 and 2 by halves is the symmetric part of one of leg 1: strokes 2 um apart."""
    layout, step = layouts.fitted(*TAKEN), 1e-6
    for extension in (0.0, 0.03, 0.06):
        (below, above), angles = poses(layout, extension + np.array([-step, step]))
        z, angle = poses(layout, np.array([extension]))
        move = np.linalg.solve(jacobians(layout, z, angle)[0], [1.0, 0.0, 0.0, 0.0])
        # central differences: error step^2 / leg^2, and rounding over the step
        assert move[0] == pytest.approx((above - below) / (4.0 * step), rel=1e-7)
        assert move[2] == pytest.approx(np.diff(angles)[0] / (4.0 * step), rel=1e-7)


def test_fitted_layouts_have_table_8_s_sensitivities() -> None:
    for numbers in (TAKEN, (0.04, 0.3, 0.24), (0.06, 0.06, 0.36)):
        reported = answer(layouts.fitted(*numbers))
        assert reported.dz * layouts.CLEARANCE == pytest.approx(1e-3 * TABLE8.displacement, rel=1e-9)
        assert reported.dangle * layouts.CLEARANCE == pytest.approx(TABLE8.angle, rel=1e-9)


def test_other_layouts_do_not() -> None:
    first = answer(layouts.FIRST)
    assert abs(first.dz / DZ - 1.0) > 0.3
    assert abs(first.dangle / DANGLE - 1.0) < 0.05


def test_crossing_legs_have_no_room() -> None:
    a, b = np.array([[0.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]])
    up = np.array([[0.0, 0.0, 1.0]])
    below, above = np.array([[0.5, 0.3, -1.0]]), np.array([[0.5, 0.3, 1.0]])
    assert layouts._distance(a, b, below, above) == pytest.approx(0.3, abs=1e-12)
    aside = np.array([[0.4, 0.0, 0.0]])
    assert layouts._distance(a, b, b + 0.5 * up + aside, b + up) == pytest.approx(_ends(), abs=1e-12)


def _ends() -> float:
    """Least distance of the end (1, 0, 0) to the segment from (1.4, 0, 0.5) to (1, 0, 1), by its formula."""
    p, c, d = np.array([1.0, 0.0, 0.0]), np.array([1.4, 0.0, 0.5]), np.array([1.0, 0.0, 1.0])
    t = np.clip((p - c) @ (d - c) / ((d - c) @ (d - c)), 0.0, 1.0)
    return float(np.linalg.norm(p - c - t * (d - c)))


#: the scenes are typed in mm with ten digits after the point or more [m]
TYPED = 1e-13


def test_the_scenes_are_of_the_layout_that_the_log_takes() -> None:
    records = [json.loads(line) for line in (TREE / "benchmarks" / "log" / "geometry.jsonl").read_text().splitlines()]
    taken = [r for r in records if r.get("case") == "members"][-1]
    layout = layouts.fitted(taken["ay"], taken["bx"], taken["by"])
    assert layout.height == pytest.approx(taken["height"], abs=1e-12)
    for name in ("ideal", "csj", "far_free", "far_csj_cb", "variants/prismatic_60mm_far_csj_fixed"):
        same(f"sps4/{name}", layout)


def test_edits_make_the_first_layout_s_scenes() -> None:
    for name in ("first", "first_far_csj_free"):
        same(f"sps4/variants/{name}", layouts.FIRST)


def same(name: str, layout: Layout) -> None:
    """That the edits which make this layout out of a scene change nothing but the digits of numbers."""
    plain = load_scene(find_scene(name))
    along = 0.06 if "prismatic_60mm" in name else 0.0
    places = layouts.edits(layout, flexible="rod1" in plain.flexible(), along=along)
    for (place, one), (_, other) in zip(numbers(plain), numbers(load_scene(find_scene(name), places)), strict=True):
        assert one == pytest.approx(other, abs=TYPED), place


def numbers(scene: Scene) -> list[tuple[str, np.ndarray]]:
    """Where the bodies of a scene are, as rotation matrices and positions, and their frames, by place."""
    found = []
    for name, body in scene.body.items():
        for frame, pose in {**getattr(body, "frames", {}), "pose": getattr(body, "pose", None)}.items():
            if pose is not None:
                turn = quaternion_to_matrix(pose.as_quaternion())
                found.append((f"{name}.{frame}", np.vstack([turn, pose.position])))
    return found
