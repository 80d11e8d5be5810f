"""The cases of the atlas, and a scene for each: the 4-SPS/PS mechanism with its parameters free.

One parameter at a time is moved over its range, and there are random points of all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.family import Case
from benchmarks.geometry.identify import Layout
from benchmarks.geometry.scenes import ROD_CENTRE, ROD_END, edits
from flexclear.pipeline.core.scene.load import compose, scene_of
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.workflow.fingerprint import TREE

CLEARANCE, STIFFNESS = 0.5e-3, 1.3631e11  # Table 3 [m], eq. (26) with its data [N/m^1.5]
#: radii of the joint circles, start height [m], and the angles of the joints that are far from singular [deg]
RADIUS_A, RADIUS_B, HEIGHT = 0.1, 0.2, 0.35
ANGLE_A, ANGLE_B, SINGULAR = 30.0, 60.0, 45.0
STROKE, LIFT = 0.18, 0.06  # duration [s] and change of the driven legs [m]
#: evaluations after which a case counts as refused: with rigid bodies about a minute; a hundred strokes take half of it
CAP = 8_000_000
#: Craig-Bampton counts that cut no pair of equal frequencies: 6 static modes and pairs, torsion, axial
MODES = (0, 6, 8, 10, 11, 13, 15, 30)
#: ranges over which single parameters are varied; logarithmic ones by decades
RANGES: dict[str, tuple[float, ...]] = {
    "clearance": tuple(np.geomspace(1e-6, 2e-3, 14).tolist()),
    "stiffness": tuple(np.geomspace(1e-2, 1e4, 13).tolist()),
    "restitution": tuple(np.linspace(0.0, 1.0, 11).tolist()),
    "friction": tuple(np.linspace(0.0, 0.5, 11).tolist()),
    "speed": tuple(np.geomspace(0.1, 20.0, 10).tolist()),
    "mass": tuple(np.geomspace(1e-3, 1e3, 13).tolist()),
    "modes": MODES,
    "damping": (0.0, 0.001, 0.005, 0.01, 0.02, 0.05),
    "nearness": (0.0, *(1.0 - np.geomspace(1e-1, 1e-6, 6)).tolist()),
    "joints": (1, 2, 3, 4, 5),
    "strokes": (1, 10, 100),
}
#: the parameter that another one needs to mean anything
ALONG: dict[str, dict[str, Any]] = {"damping": {"modes": 13}}


@dataclass(frozen=True)
class Parameters:
    """One point of the atlas; the defaults are the paper's clearance model.

    clearance [m]; stiffness, speed and mass: factors; modes: elastic coordinates kept, 0 for a rigid rod; damping:
    modal damping ratio; nearness: 0 for the scene's geometry, 1 for the singular one (aligned squares); joints: number
    of clearance joints (A1..A4, C); strokes: how often the motion is repeated.
    """

    clearance: float = CLEARANCE
    stiffness: float = 1.0
    restitution: float = 0.9
    friction: float = 0.15
    speed: float = 1.0
    mass: float = 1.0
    modes: int = 0
    damping: float = 0.0
    nearness: float = 0.0
    joints: int = 1
    strokes: int = 1


def cases(seed: int, random: int) -> list[Case]:
    """All single sweeps, and so many random points; other seeds give others of the same kind."""
    return [*_sweeps(), *_random(seed, random)]


def sweep(case: str) -> str:
    """The parameter that moves in a case of this name, or `random`."""
    return case.partition(" ")[0]


def _sweeps() -> Iterator[Case]:
    for name, values in RANGES.items():
        base = replace(Parameters(), **ALONG.get(name, {}))
        for value in values:
            change: dict[str, Any] = {name: value}
            yield Case(f"{name} {value:.6g}", replace(base, **change))


def _random(seed: int, count: int) -> Iterator[Case]:
    """Every parameter uniform over its range (logarithmic where it spans decades); flexible rods in one of four."""
    random = np.random.default_rng(seed)
    for k in range(count):
        flexible = random.random() < 0.25
        yield Case(
            f"random {seed}/{k + 1}",
            Parameters(
                clearance=float(np.exp(random.uniform(np.log(1e-6), np.log(2e-3)))),
                stiffness=float(np.exp(random.uniform(np.log(1e-2), np.log(1e4)))),
                restitution=float(random.uniform(0.0, 1.0)),
                friction=float(random.choice([0.0, random.uniform(0.0, 0.5)])),
                speed=float(np.exp(random.uniform(np.log(0.1), np.log(20.0)))),
                mass=float(np.exp(random.uniform(np.log(1e-3), np.log(1e3)))),
                modes=int(random.choice(MODES[1:6])) if flexible else 0,
                damping=float(random.uniform(0.0, 0.05)) if flexible else 0.0,
                nearness=float(1.0 - 10.0 ** random.uniform(-6.0, 0.0)),
                joints=int(random.integers(1, 6)),
            ),
        )


def scene(p: Parameters, rtol: float | None = None) -> Scene:
    """The scene of a point. Raises InputError when it cannot be described."""
    moved = edits(layout(p.nearness), flexible=bool(p.modes)) if p.nearness else {}
    table = compose(TREE / "scenes" / "sps4" / "variants" / "first_csj.toml")
    _scale_mass(table["body"]["platform"], p.mass)
    joint = _contact(table["joint"]["A1"], p)
    for name in ("A1", "A2", "A3", "A4", "C")[: p.joints]:
        table["joint"][name] = {**joint, "between": list(table["joint"][name]["between"])}
    if p.modes:
        table["body"]["rod1"] = _flexible(table["body"]["rod1"], p)
    _time(table, p)
    table["solver"] = {"evaluations": CAP} | ({"rtol": rtol} if rtol else {})
    table.pop("ensemble", None)
    made = scene_of(table, moved)
    made._name = "stability"
    return made


def layout(nearness: float) -> Layout:
    """Joints on two circles, from the scene's own angles (0) to those of aligned squares, which are singular (1)."""
    angles = np.deg2rad([own + nearness * (SINGULAR - own) for own in (ANGLE_A, ANGLE_B)])
    (ax, ay), (bx, by) = (
        radius * np.array([np.cos(angle), np.sin(angle)])
        for radius, angle in zip((RADIUS_A, RADIUS_B), angles, strict=True)
    )
    return Layout(float(ax), float(ay), float(bx), float(by), HEIGHT)


def _contact(joint: Mapping[str, Any], p: Parameters) -> dict[str, Any]:
    found = {k: v for k, v in joint.items() if k not in ("socket_material", "ball_material", "source")}
    found["clearance"] = p.clearance
    found["normal"] = {**joint["normal"], "restitution": p.restitution, "stiffness": STIFFNESS * p.stiffness}
    if p.friction > 0.0:
        found["friction"] = {**joint["friction"], "static": p.friction, "dynamic": p.friction / 1.5}
    else:
        found.pop("friction")
    return found


def _flexible(rod: Mapping[str, Any], p: Parameters) -> dict[str, Any]:
    """The paper's rod with Craig-Bampton modes; its mesh frame lies at the lower end, x along the rod."""
    z, x = (np.array(rod["pose"]["axes"][k]) for k in "zx")
    lower = np.array(rod["pose"]["position"]) - (ROD_END - ROD_CENTRE) * z / np.linalg.norm(z)
    return {
        "type": "flexible",
        "mesh": str(TREE / "meshes" / "actuated_rod.toml"),
        "modes": {"reference": "craig-bampton", "count": p.modes, "interfaces": ["bottom", "top"]},
        "pose": {"position": lower.tolist(), "axes": {"x": z.tolist(), "y": x.tolist()}},
    } | ({"damping": p.damping} if p.damping else {})


def _scale_mass(body: dict[str, Any], factor: float) -> None:
    if factor != 1.0:
        body["mass"] = f"{float(body['mass'].split()[0]) * factor} kg"
        body["inertia"] = [f"{float(i.split()[0]) * factor} kg mm^2" for i in body["inertia"]]


def _time(table: dict[str, Any], p: Parameters) -> None:
    """Strokes one after the other, each `speed` times as fast as the paper's."""
    half = 0.5 * STROKE / p.speed
    starts = [k * half for k in range(2 * p.strokes)]
    law = {
        "type": "step",
        "start": starts,
        "end": [s + half for s in starts],
        "change": [LIFT, -LIFT] * p.strokes,
    }
    for leg in ("P1", "P2"):
        table["drive"][leg] = {"joint": leg, "law": law}
    table["time"] = {"end": 2 * p.strokes * half}
    table["output"] = {"interval": p.strokes * STROKE / p.speed / 1800}
