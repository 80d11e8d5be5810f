"""Flexible bodies that turn fast, next to solutions that no program with floating frames computed.

The values belong to a theory (Rayleigh, Timoshenko, solid), not to a mesh: closed forms, exact transfer matrices, and
geometrically exact beams or bricks with stress stiffening, linearised about the steady turn.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.family import Case, Family, Record, each
from benchmarks.page import Columns, table
from flexclear import dynamics
from flexclear.artifacts.paths import PROJECT
from flexclear.dynamics import analyses
from flexclear.scene.schema import Scene
from flexclear.structure.kinds import kind
from flexclear.structure.modes import bundle
from flexclear.structure.modes.basis import ModeRequest
from flexclear.structure.modes.solution import solve
from flexclear.system.progress import silent

Table = dict[str, Any]
STEEL, ALUMINIUM = (
    {"density": rho, "youngs_modulus": E, "poisson": 0.3} for rho, E in ((7800.0, 210e9), (2700.0, 70e9))
)
#: axes of frames: z along x of the bodies, and those of a blade's hub by the angle between the blade's section and the
#: plane of rotation [deg]
ALONG: Table = {"z": [1.0, 0.0, 0.0], "x": [0.0, 1.0, 0.0]}
#: solid disc of 140 mm diameter and 40 mm length at the end of a shaft: mass [kg], moments of inertia [kg m^2]
DISC = {"mass": 4.802866848808077, "inertia": [0.01176702377957979, 0.006523894136297639, 0.006523894136297639]}


@dataclass(frozen=True)
class Body:
    """A turning body: recipe, reference condition, supports on the driven hub, and the hub's axis and radius.

    supports: `clamped` at frame A, `pins` at A and B, `springs` [N/m] at A and B, or `free`.
    radius: distance of A from the axis [m].  inward: the body points to the axis.
    """

    recipe: Table
    supports: str = "clamped"
    reference: str = "craig-bampton"
    up_to: float | None = None  #: highest normal mode [Hz]; None for a complete basis
    stiffening: bool = False
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    radius: float = 0.0
    inward: bool = False
    springs: float = 0.0
    discs: Mapping[str, Any] = field(default_factory=dict)


def rod(length: float, section: Table, theory: str, elements: int, material: Table = STEEL, **more: Any) -> Table:
    """Return the recipe of a straight beam along x with a frame at each end."""
    frames = {"A": {"x": 0.0}, "B": {"x": length}}
    grid = {"elements": elements, "torsion": "quadratic", "extension": "quadratic", "interfaces": ["A", "B"]}
    shape = {"type": "straight-beam", "length": length}
    return {"theory": theory, "shape": shape, "material": material, "section": section, "frames": frames} | grid | more


def circle(radius: float) -> Table:
    """Return a round section."""
    return {"type": "circle", "radius": radius}


def rectangle(width: float, height: float) -> Table:
    """Return a rectangular section; width along y, height along z."""
    return {"type": "rectangle", "width": width, "height": height}


@cache
def _reduced(recipe: str, reference: str, up_to: float | None, stiffening: bool) -> xr.Dataset:
    mesh = kind.build(json.loads(recipe))
    modes = solve(mesh, reference, requested=ModeRequest(up_to=up_to))
    return bundle.build(mesh, modes, stiffening=stiffening)


def reduced(body: Body) -> xr.Dataset:
    """Return the body's reduced bundle."""
    return _reduced(json.dumps(body.recipe), body.reference, body.up_to, body.stiffening)


def turning(body: Body, speed: float) -> Table:
    """Return the scene of a body on a hub that turns at `speed` [rad/s] about an axis through the origin."""
    shape = body.recipe["shape"]
    length = shape["length"] if "length" in shape else shape["size"][0]
    across = [0.0, 1.0, 0.0] if body.axis[0] else [1.0, 0.0, 0.0]
    axle = {"axes": {"z": list(body.axis), "x": across}}
    out = {"z": [-1.0, 0.0, 0.0], "x": [0.0, -1.0, 0.0]} if body.inward else ALONG
    root = {"position": [body.radius, 0.0, 0.0], "axes": out}
    place: Table = {"position": root["position"]}
    if body.inward:
        place["axes"] = {"x": [-1.0, 0.0, 0.0], "z": [0.0, 0.0, 1.0]}
    hub: Table = {"axle": axle, "A": root, "B": {"position": [length, 0.0, 0.0], "axes": ALONG}}
    bodies: Table = {
        "ground": {"type": "ground", "frames": {"axle": axle}},
        "hub": {"type": "rigid", "mass": 1.0, "com": [0.0] * 3, "inertia": [1.0] * 3, "pose": {}, "frames": hub},
        "rod": {
            "type": "flexible",
            "mesh": "rod.toml",
            "modes": {"reference": body.reference, "count": "all"},
            "pose": place,
        },
    }
    if body.stiffening:
        bodies["rod"]["stiffening"] = {}
    joints: Table = {"axle": {"type": "revolute", "between": ["ground.axle", "hub.axle"]}}
    loads: Table = {}
    between = ["hub.A", "rod.A"]
    if body.supports == "clamped":
        joints["root"] = {"type": "fixed", "between": between}
    elif body.supports == "pins":
        joints["root"] = {"type": "universal", "between": between}
        light = {"mass": 1e-6, "com": [0.0] * 3, "inertia": [1e-12] * 3, "pose": {"position": [length, 0.0, 0.0]}}
        bodies["pin"] = {"type": "rigid", **light, "frames": {"slide": {"axes": ALONG}, "ball": {}}}
        joints["slide"] = {"type": "prismatic", "between": ["hub.B", "pin.slide"]}
        joints["ball"] = {"type": "spherical", "between": ["pin.ball", "rod.B"]}
    else:
        k = body.springs
        joints["free"] = {"type": "free", "between": between}
        loads["A"] = {"type": "bushing", "between": between, "stiffness": [k, k, 1e9, 0.0, 0.0, 1e6]}
        loads["B"] = {"type": "bushing", "between": ["hub.B", "rod.B"], "stiffness": [k, k, 0.0, 0.0, 0.0, 0.0]}
    for name, disc in body.discs.items():
        axes = {"z": [1.0, 0.0, 0.0], "x": [0.0, 1.0, 0.0]}
        bodies[name] = {**disc, "type": "rigid", "com": [0.0] * 3, "frames": {"c": {}}}
        bodies[name]["pose"] = {"position": [body.recipe["frames"][name]["x"], 0.0, 0.0], "axes": axes}
        joints[name] = {"type": "fixed", "between": [f"rod.{name}", f"{name}.c"]}
    law = {"type": "polynomial", "coefficients": [0.0, speed]}
    drive = {"motor": {"joint": "axle", "law": law}}
    return {"title": "turning", "time": {"end": 0.01}, "body": bodies, "joint": joints, "load": loads, "drive": drive}


def vibrations(body: Body, speed: float) -> xr.Dataset:
    """Return small vibrations about the steady turn, in turning axes."""
    scene = Scene.model_validate(turning(body, speed))
    return analyses.frequencies(scene, {"rod": reduced(body)}, silent, moving=True)


def _shaft(theory: str, supports: str, springs: float = 0.0) -> Body:
    return Body(rod(0.8, circle(0.02), theory, 24), supports, springs=springs, up_to=2e4)


def _bar(theory: str, length: float, supports: str) -> Body:
    return Body(rod(length, rectangle(0.03, 0.02), theory, 24), supports, up_to=2e4)


def _disc_at_end(theory: str, *, section: bool) -> Body:
    """Return a shaft with a disc: as a thick section of the beam, or as a rigid body at the end of the shaft."""
    if section:
        parts = [
            {"start": 0.0, "end": 0.35, "section": circle(0.012), "elements": 20},
            {"start": 0.35, "end": 0.39, "section": circle(0.07), "elements": 4},
        ]
        recipe = rod(0.39, {}, theory, 0)
        del recipe["section"], recipe["elements"]
        return Body(recipe | {"shape": {"type": "segmented-beam", "length": 0.39, "segments": parts}})
    lump = {"disc": {"x": 0.35, "com": [0.02, 0.0, 0.0], **DISC}}
    return Body(rod(0.35, circle(0.012), theory, 20, masses=lump))


def _axis(pitch: float) -> tuple[float, float, float]:
    angle = np.radians(pitch)
    return (0.0, float(np.sin(angle)), float(np.cos(angle)))


def _blade(theory: str, pitch: float, *, inward: bool = False) -> Body:
    section, radius = (rectangle(0.02, 0.004), 0.8) if inward else (rectangle(0.04, 0.006), 0.05)
    recipe = rod(0.5, section, theory, 16, ALUMINIUM)
    return Body(recipe, up_to=1e4, stiffening=True, axis=_axis(pitch), radius=radius, inward=inward)


def _solid(shape: Table, root: str = "rigid", material: Table = STEEL) -> Table:
    ties = {"A": ("start", root), "B": ("end", "mean")}
    frames = {name: {"on": {"region": region}, "tie": tie, "axes": ALONG} for name, (region, tie) in ties.items()}
    return {"interfaces": ["A", "B"], "shape": shape, "material": material, "frames": frames}


def _block(*size: float, cells: tuple[int, int, int]) -> Table:
    return {"type": "block", "size": list(size), "element": "hex20", "cells": list(cells)}


def _solid_shaft() -> Body:
    """Return a shaft whose ends are held across the axis in the mean of their faces."""
    cells = {"along": 24, "across": 2, "rings": 1}
    shape = {"type": "cylinder", "radius": 0.02, "length": 0.8, "element": "hex20", "cells": cells}
    return Body(_solid(shape, "mean"), "pins", up_to=5e3)


def _solid_blade(pitch: float) -> Body:
    recipe = _solid(_block(0.5, 0.04, 0.006, cells=(25, 4, 1)), material=ALUMINIUM)
    return Body(recipe, up_to=3e3, stiffening=True, axis=_axis(pitch), radius=0.05)


def _solid_inward() -> Body:
    recipe = _solid(_block(0.5, 0.02, 0.004, cells=(34, 4, 1)), material=ALUMINIUM)
    return Body(recipe, up_to=3e3, stiffening=True, axis=_axis(0.0), radius=0.8, inward=True)


def _friswell() -> Body:
    """Return the two-disc rotor of Friswell et al. (2010), *Dynamics of Rotating Machines*, example 5.9.1."""
    material = {"density": 7810.0, "youngs_modulus": 211e9, "poisson": 0.2992610837}
    frames = {"A": {"x": 0.0}, "d1": {"x": 0.5}, "d2": {"x": 1.0}, "B": {"x": 1.5}}
    discs = {
        "d1": {"mass": 32.58972765304033, "inertia": [0.17808928257067666] * 2 + [0.32956362089137037]},
        "d2": {"mass": 51.5252611115262, "inertia": [0.4235805840543383] * 2 + [0.8050822048675969]},
    }
    recipe = rod(1.5, circle(0.025), "timoshenko", 24, material, frames=frames, interfaces=list(frames))
    return Body(recipe, "springs", springs=1e6, discs=discs, up_to=5e3)


def two_discs(body: Body, kxx: float, kyy: float, kxy: float = 0.0) -> Scene:
    """Return Friswell's rotor at 4000 rpm in two equal bearings of the ground [N/m].

    The hub holds it along and about the axis.
    """
    scene = turning(body, 4000.0 * np.pi / 30.0)
    scene["body"]["ground"]["frames"] |= {name: scene["body"]["hub"]["frames"][name] for name in "AB"}
    K = np.zeros((6, 6))
    K[:2, :2] = [[kxx, kxy], [kxy, kyy]]
    bushings: dict[str, Any] = {name: ([f"ground.{name}", f"rod.{name}"], K.tolist()) for name in "AB"}
    bushings["coupling"] = (["hub.A", "rod.A"], [0, 0, 1e9, 0, 0, 1e6])
    scene["load"] = {n: {"type": "bushing", "between": b, "stiffness": k} for n, (b, k) in bushings.items()}
    return Scene.model_validate(scene)


#: speed of the transients [rad/s]
FASTEST = 2527.0


def twisted(body: Body) -> xr.Dataset:
    """Return the run of a shaft that turns at `FASTEST` while 2 N m at 2000 rad/s twist its free end."""
    scene = turning(body, FASTEST)
    torque = {"type": "harmonic", "amplitude": [2.0], "frequency": ["2000 rad/s"], "phase": [0.0]}
    scene["load"] = {"end": {"type": "point-torque", "frame": "rod.B", "torque": [torque, 0.0, 0.0]}}
    scene["body"]["hub"]["angular_velocity"] = [FASTEST, 0.0, 0.0]
    scene |= {"time": {"end": 0.005}, "output": {"interval": 0.001}}
    return dynamics.simulate(Scene.model_validate(scene), {"rod": reduced(body)}, silent)


def spun_up(*, stiffening: bool) -> xr.Dataset:
    """Return the run of a shaft spun up to `FASTEST` in 50 ms, past several whirls, its end pushed after 5 ms."""
    body = Body(rod(1.2, circle(0.01), "timoshenko", 12), up_to=8e3, stiffening=stiffening)
    scene, span = turning(body, FASTEST), 0.05
    rise = [0.0] * 4 + [FASTEST * span * c / span**k for k, c in ((4, 2.5), (5, -3.0), (6, 1.0))]
    turned = {"type": "polynomial", "coefficients": [0.5 * FASTEST * span, FASTEST], "origin": span}
    spin = [{"start": 0.0, "law": {"type": "polynomial", "coefficients": rise}}, {"start": span, "law": turned}]
    # 2 N (1 - cos(2 pi (t - 5 ms) / 5 ms)) between 5 and 10 ms
    cosine = {"amplitude": [-2.0], "frequency": ["200 Hz"], "phase": [0.5 * np.pi], "offset": 2.0}
    none, wave = {"type": "constant"}, {"type": "harmonic", **cosine}
    pieces = [{"start": t, "law": law} for t, law in ((0.0, none), (0.005, wave), (0.01, none))]
    force = {"type": "piecewise", "sections": pieces}
    scene["drive"]["motor"]["law"] = {"type": "piecewise", "sections": spin}
    scene["load"] = {"end": {"type": "point-force", "frame": "rod.B", "force": [0.0, force, 0.0]}}
    scene |= {"time": {"end": 0.1}, "output": {"interval": 0.01}, "solver": {"rtol": 1e-9}}
    return dynamics.simulate(Scene.model_validate(scene), {"rod": reduced(body)}, silent)


def path_error(run: xr.Dataset) -> np.ndarray:
    """Return the largest error of the end's path after `spun_up` in y and z [m], next to an exact beam."""
    rows = [row for row in known()["7-spin-up"]["values"] if "displacement" in row[0]]
    path = np.array([[value for name, _, value, _ in rows if f"displacement {axis}" in name] for axis in "yz"])
    found = run["frame_position"].sel(frame="rod.B", axis=["y", "z"])
    away = found.sel(time=0.01 * np.arange(1, 11), method="nearest").values.T - path
    return np.asarray(np.abs(away).max(axis=1))


CASES: dict[str, Callable[[], Body]] = {
    "1-clamped-free": lambda: Body(rod(1.2, circle(0.01), "rayleigh", 24), up_to=2e4),
    **{f"2-{t}-pins": partial(_shaft, t, "pins") for t in ("euler-bernoulli", "rayleigh", "timoshenko")},
    **{f"2-{t}-springs": partial(_shaft, t, "springs", 2e7) for t in ("rayleigh", "timoshenko")},
    "3a": lambda: _disc_at_end("timoshenko", section=False),
    "3b": lambda: _disc_at_end("timoshenko", section=True),
    "3b_rayleigh": lambda: _disc_at_end("rayleigh", section=True),
    "4-clamped-free": lambda: _bar("timoshenko", 0.5, "clamped"),
    **{f"4-pins-{t}": partial(_bar, t, 0.8, "pins") for t in ("rayleigh", "timoshenko")},
    **{
        f"5-{t}-pitch{p}": partial(_blade, t, p) for t in ("euler-bernoulli", "rayleigh", "timoshenko") for p in (0, 45)
    },
    "2-solid": _solid_shaft,
    "4-clamped-free-solid": lambda: Body(_solid(_block(0.5, 0.03, 0.02, cells=(20, 2, 2))), up_to=1e4),
    **{f"5-solid-pitch{pitch}": partial(_solid_blade, pitch) for pitch in (0, 45)},
    "6-solid": _solid_inward,
    **{f"6-{t}": partial(_blade, t, 0, inward=True) for t in ("euler-bernoulli", "rayleigh", "timoshenko")},
    "8-5.9.1": _friswell,
}


@cache
def known() -> dict[str, Any]:
    """Return title and values (quantity, speed [rad/s or rpm], value, unit) of each case."""
    return json.loads((PROJECT / "tests" / "reference" / "turning_bodies.json").read_text(encoding="utf-8"))


def values(case: str, speed: float) -> tuple[float, np.ndarray, float]:
    """Return the speed [rad/s], known frequencies in turning axes [rad/s] and growth rate [1/s] of a case."""
    rows = [row for row in known()[case]["values"] if row[1] == speed]
    omega = speed * np.pi / 30.0 if case.startswith("8") else speed
    growth = [value for quantity, _, value, _ in rows if "growth" in quantity]
    found = np.array(
        [value * (2.0 * np.pi if unit == "Hz" else 1.0) for q, _, value, unit in rows if "growth" not in q]
    )
    if case.startswith("8"):
        # fixed axes: backward and forward whirls in turn
        found = np.abs(found + omega * np.array([1.0, -1.0] * (len(found) // 2)))
    return omega, found, max(growth, default=0.0)


def compared(case: str, speed: float) -> Record:
    """Return the differences of a case at a speed (see `difference`)."""
    return difference(case, speed, CASES[case]())


def difference(case: str, speed: float, body: Body) -> Record:
    """Return the largest relative error of the frequencies, and of the growth rate where the motion is unstable."""
    omega, frequencies, growth = values(case, speed)
    found = vibrations(body, omega)
    computed = 2.0 * np.pi * found["frequency"].values
    errors = [float(np.abs(computed / value - 1.0).min()) for value in frequencies]
    fastest = max(0.0, -float(found["decay_rate"].min()))
    record: Record = {"speed": omega, "values": len(errors), "error": max(errors), "growth": fastest}
    return record | ({"growth_error": abs(fastest / growth - 1.0)} if growth else {})


def speeds(case: str) -> list[float]:
    """Return the speeds of a case."""
    return sorted({row[1] for row in known()[case]["values"]})


def _measured(case: Case) -> list[Record]:
    return [compared(case.name, speed) for speed in speeds(case.name)]


def _show(records: list[Record]) -> str:
    rows = []
    for name in CASES:
        of = [record for record in records if record["case"] == name]
        if of:
            rest, worst = min(of, key=lambda r: r["speed"]), max(of, key=lambda r: r["error"])
            row = {
                "title": known()[name]["title"],
                "values": sum(r["values"] for r in of),
                "rest": rest,
                "worst": worst,
            }
            rows.append(row | {"growth": max((r.get("growth_error", 0.0) for r in of), default=0.0)})
    columns: Columns = {
        "case": lambda r: r["title"],
        "values": lambda r: str(r["values"]),
        "error at the lowest speed": lambda r: f"{r['rest']['error']:.1e} at {r['rest']['speed']:.0f} rad/s",
        "largest error": lambda r: f"{r['worst']['error']:.1e} at {r['worst']['speed']:.0f} rad/s",
        "of growth rates": lambda r: f"{r['growth']:.1e}" if r["growth"] else "–",
    }
    return table(rows, columns)


FAMILY = Family(
    what="frequencies and growth rates of flexible bodies that turn fast, next to independent solutions",
    takes="3 min",
    page="rotors.md",
    cases=lambda: [Case(name) for name in CASES],
    measure=each(_measured),
    show=_show,
    quick="3a",
    times=False,
)
