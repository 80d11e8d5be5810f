"""Small scenes, each of a class of mechanisms that is hard to integrate, to start or to judge."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np

from flexclear.scene.load import scene_of
from flexclear.scene.schema import Scene

Table = dict[str, Any]
#: stiffness of a shaft's end [N/m, N/rad, N m/rad], and its disc [kg, kg m^2, m]
SIDE, MIXED, SLOPE = 164163.04446739165, 20520.380558423956, 3420.0634264039927
MASS, ACROSS, ALONG, ARM = 3.0, 0.02, 0.036, 0.25
#: axes that are parallel to none of the world's
OBLIQUE = {"z": [2.0, 6.0, 3.0], "x": [-3.0, 1.0, 0.0]}
UPRIGHT = {"z": [0.0, 0.0, 1.0], "x": [1.0, 0.0, 0.0]}


def _scene(end: float, **parts: Any) -> Scene:
    return scene_of({"title": "hard case", "time": {"end": end}, "output": {"interval": end / 100}, **parts})


def _body(frames: Table, mass: float = 1.0, inertia: float = 0.01, **more: Any) -> Table:
    return {"type": "rigid", "mass": mass, "inertia": [inertia] * 3, "pose": {}, "frames": frames, **more}


def _ground(**frames: Any) -> Table:
    return {"type": "ground", "frames": frames}


# Rotors ---------------------------------------------------------------------------------------------------------------


def rotor(speed: float, unbalance: float = 0.0, axes: Mapping[str, list[float]] = UPRIGHT, size: float = 1.0) -> Scene:
    """Return a disc at the end of a massless shaft on a driven hub; unbalance: offset of its centre along x [m].

    size: factor of all lengths, the unbalance included; forces per displacement, and frequencies, are unchanged.
    """
    K = np.diag([SIDE, SIDE, 1e8, SLOPE * size**2, SLOPE * size**2, 1e5 * size**2])
    K[0, 4] = K[4, 0] = -MIXED * size
    K[1, 3] = K[3, 1] = MIXED * size
    arm, z = ARM * size, np.array(axes["z"]) / np.linalg.norm(axes["z"])
    hub = _body({"o": {}, "s": {"position": [0.0, 0.0, arm]}}, 1.0, 0.01 * size**2, pose={"axes": axes})
    pose = {"position": (arm * z).tolist(), "axes": axes}
    disc = _body({"o": {}}, MASS, com=[unbalance * size, 0.0, 0.0], pose=pose)
    disc["inertia"] = [moment * size**2 for moment in (ACROSS, ACROSS, ALONG)]
    return _scene(
        0.01,
        body={"ground": _ground(o={"axes": axes}), "hub": hub, "disc": disc},
        joint={
            "axle": {"type": "revolute", "between": ["ground.o", "hub.o"]},
            "float": {"type": "free", "between": ["hub.s", "disc.o"]},
        },
        load={"shaft": {"type": "bushing", "between": ["hub.s", "disc.o"], "stiffness": K.tolist()}},
        drive={"motor": {"joint": "axle", "law": {"type": "polynomial", "coefficients": [0.0, speed]}}},
    )


def deflection(speed: float) -> float:
    """Return the deflection of the shaft's end per unbalance, in the rotating axes.

    (K - Omega^2 diag(m, I_t - I_p)) (x, p) = (m Omega^2 e, 0); Genta (2005), Dynamics of Rotating Systems, sec. 2.6.
    """
    K = np.array([[SIDE, -MIXED], [-MIXED, SLOPE]])
    return float(np.linalg.solve(K - speed**2 * np.diag([MASS, ACROSS - ALONG]), [MASS * speed**2, 0.0])[0])


# Contacts and stops ---------------------------------------------------------------------------------------------------


def driven_into_a_stop() -> Scene:
    """Return a slide that its drive moves 10 mm into a stop: no coordinate is free."""
    return _scene(
        0.9,
        body={"ground": _ground(o={}), "slide": _body({"o": {}})},
        joint={"rail": {"type": "prismatic", "between": ["ground.o", "slide.o"]}},
        drive={"motor": {"joint": "rail", "law": {"type": "harmonic", "amplitude": [0.1], "frequency": [20.0]}}},
        stop={"end": {"joint": "rail", "upper": 0.09, "normal": {"law": "hertz", "stiffness": 1e6}}},
    )


def bounce(height: float = 0.2, **solver: Any) -> Scene:
    """Return a ball that falls onto a stiff plane, from a height [m] above it or from inside it."""
    normal = {"law": "hertz", "stiffness": 1e8}
    plane = {"type": "ball-on-plane", "between": ["ground.f", "ball.c"], "ball_radius": 0.1, "normal": normal}
    return _scene(
        1.0,
        body={"ground": _ground(f={}), "ball": _body({"c": {}}, pose={"position": [0.0, 0.0, 0.1 + height]})},
        joint={"floor": plane},
        load={"weight": {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]}},
        solver=solver,
    )


def graze(depth: float, rtol: float) -> Scene:
    """Return a mass on a spring, 10 rad/s and 0.1 m, that meets a plane at `depth` before its lowest point [m]."""
    return _ball_on_a_spring(-0.12 + depth, {"law": "hertz", "stiffness": 1e8}, rtol)


def _ball_on_a_spring(height: float, normal: Table, rtol: float, unit: float = 1.0) -> Scene:
    """Return a ball on a spring above a plane at a height [m]; unit: factor of the ball's lengths."""
    plane = {"type": "ball-on-plane", "between": ["ground.f", "ball.c"], "ball_radius": 0.02 * unit, "normal": normal}
    floor, place = {"position": [0.0, 0.0, height]}, {"position": [0.0, 0.0, 0.1 * unit]}
    return _scene(
        3.0,
        body={"ground": _ground(o={}, f=floor), "ball": _body({"o": {}, "c": {}}, 1.0, 0.01 * unit**2, pose=place)},
        joint={"rail": {"type": "prismatic", "between": ["ground.o", "ball.o"]}, "floor": plane},
        load={"spring": {"type": "joint-spring", "joint": "rail", "stiffness": 100.0}},
        solver={"rtol": rtol},
    )


def small_bounce(unit: float) -> Scene:
    """Return a lossy ball on a spring that meets a plane; `unit` scales all lengths, and forces per mass as well."""
    normal = {"law": "lankarani-nikravesh", "restitution": 0.6, "stiffness": 1e6 * unit**-0.5}
    return _ball_on_a_spring(-0.09 * unit, normal, 1e-10, unit)


# Sizes, turns, controllers, frames ------------------------------------------------------------------------------------


def stage_next_to_a_crane() -> Scene:
    """Return a stage that vibrates by 1 nm next to a swinging jib of 100 m, without any connection."""
    jib = _body({"o": {}}, 1e5, 1e6, com=[100.0, 0.0, 0.0])
    stage = _body({"o": {}}, pose={"position": [1.0, 0.0, 1e-9]})
    return _scene(
        2.0,
        body={"ground": _ground(o={}, q={"position": [1.0, 0.0, 0.0]}), "stage": stage, "jib": jib},
        joint={
            "rail": {"type": "prismatic", "between": ["ground.q", "stage.o"]},
            "hinge": {"type": "revolute", "between": ["ground.o", "jib.o"]},
        },
        load={
            "weight": {"type": "gravity", "acceleration": [0.0, -9.81, 0.0]},
            "spring": {"type": "joint-spring", "joint": "rail", "stiffness": 400.0},
        },
        solver={"rtol": 1e-10},
    )


def wound_bushing() -> Scene:
    """Return a free body on an isotropic bushing that turns by 3.54 rad to either side."""
    spinning = _body({"o": {}}, angular_velocity=[0.0, 0.0, 50.0])
    stiffness = [1000.0, 1000.0, 1000.0, 2.0, 2.0, 2.0]
    load = {"type": "bushing", "between": ["ground.o", "body.o"], "stiffness": stiffness}
    return _scene(1.0, body={"ground": _ground(o={}), "body": spinning}, load={"bushing": load})


def fast_sampler() -> Scene:
    """Return a controller whose period is too long for its gain."""
    control = {"type": "sampled-pid", "joint": "rail", "reference": 0.1, "proportional": 5e3, "period": 0.1}
    return _scene(
        6.0,
        body={"ground": _ground(o={}), "slide": _body({"o": {}})},
        joint={"rail": {"type": "prismatic", "between": ["ground.o", "slide.o"]}},
        load={"control": control},
    )


def meshed_loop() -> Scene:
    """Return a turning planar four-bar; its coupler's frames, as of a mesh, are off by up to 2.4e-7 m."""
    off = [[1.1e-7, -1.9e-7, 9e-8], [-2e-7, 6e-8, -1.2e-7]]
    corners = np.array([[0.0, 0.0, 0.0], [0.0, 0.05, 0.0], [0.2, 0.15, 0.0], [0.2, 0.0, 0.0]])
    bodies: Table = {"ground": _ground(o0={}, o3={"position": [0.2, 0.0, 0.0]})}
    for k, name in enumerate(("crank", "coupler", "rocker")):
        ends = np.array([np.zeros(3), corners[k + 1] - corners[k]]) + (np.array(off) if k == 1 else 0.0)
        frames = {end: {"position": p.tolist()} for end, p in zip("ab", ends, strict=True)}
        bodies[name] = _body(frames, pose={"position": corners[k].tolist()})
    bodies["coupler"]["frame_tolerance"] = 5e-7
    pins = (("o0", "ground.o0", "crank.a"), ("A", "crank.b", "coupler.a"), ("B", "coupler.b", "rocker.a"))
    joint = {n: {"type": "revolute", "between": [a, b]} for n, a, b in (*pins, ("o3", "ground.o3", "rocker.b"))}
    law = {"type": "polynomial", "coefficients": [0.0, 10.0]}
    return _scene(1.0, body=bodies, joint=joint, drive={"motor": {"joint": "o0", "law": law}})


def quick_return() -> Scene:
    """Return a driven crank whose pin slides in the slot of a rocker, the slot without clearance."""
    bodies = {"ground": _ground(o={}, p={"position": [0.0, -0.2, 0.0]})}
    bodies["crank"] = _body({"o": {}, "pin": {"position": [0.08, 0.0, 0.0]}})
    pose = {"position": [0.0, -0.2, 0.0], "rotation_vector": [0.0, 0.0, float(np.arctan2(0.2, 0.08))]}
    bodies["rocker"] = _body({"p": {}, "slot": {"position": [0.2, 0.0, 0.0]}}, pose=pose)
    pins = {"o": ("ground.o", "crank.o"), "p": ("ground.p", "rocker.p"), "slot": ("rocker.slot", "crank.pin")}
    joint = {n: {"type": "slot" if n == "slot" else "revolute", "between": [*pair]} for n, pair in pins.items()}
    drive = {"motor": {"joint": "o", "law": {"type": "polynomial", "coefficients": [0.0, 10.0]}}}
    return _scene(1.0, body=bodies, joint=joint, drive=drive)


# Scenes that say too little about themselves --------------------------------------------------------------------------


def strobed(solver: Table) -> Scene:
    """Return a mass on a spring, 20 rad/s, whose outputs are a period apart."""
    period = 2.0 * np.pi / 20.0
    return _scene(
        10.0 * period,
        body={"ground": _ground(o={}), "mass": _body({"o": {}}, pose={"position": [0.0, 0.0, 0.01]})},
        joint={"rail": {"type": "prismatic", "between": ["ground.o", "mass.o"]}},
        load={"spring": {"type": "joint-spring", "joint": "rail", "stiffness": 400.0}},
        output={"interval": period},
        solver=solver,
    )


def resting_on_a_stop(**stop: Any) -> Scene:
    """Return a lever that its weight holds on a stop of 1e6 N m/rad, at its equilibrium; stop: more of its keys."""
    turned = {"axes": {"z": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]}}
    end = {"joint": "hinge", "upper": 0.0, "normal": {"law": "hertz", "exponent": 1, "stiffness": 1e6}}
    return _scene(
        0.01,
        body={"ground": _ground(o=turned), "lever": _body({"o": turned}, com=[0.5, 0.0, 0.0])},
        joint={"hinge": {"type": "revolute", "between": ["ground.o", "lever.o"]}},
        load={"weight": {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]}},
        stop={"end": end | stop},
        start={"at": "equilibrium"},
    )


def block_without_mass(mass: float = 1e-9) -> Scene:
    """Return a slider-crank whose weight moves it, and whose block has a negligible mass [kg]."""
    along = {"axes": {"z": [1.0, 0.0, 0.0], "x": [0.0, 1.0, 0.0]}}
    bodies = {
        "ground": _ground(o={}, guide=along),
        "crank": _body({"a": {}, "b": {"position": [0.5, 0.0, 0.0]}}),
        "rod": _body({"a": {}, "b": {"position": [1.0, 0.0, 0.0]}}, com=[0.5, 0.0, 0.0]),
        "block": _body({"a": {}, "guide": along}, mass, mass),
    }
    for name in ("crank", "rod", "block"):
        del bodies[name]["pose"]
    pins = {"main": ("ground.o", "crank.a"), "pin": ("crank.b", "rod.a"), "wrist": ("rod.b", "block.a")}
    joint = {name: {"type": "revolute", "between": list(ends)} for name, ends in pins.items()}
    joint["guide"] = {"type": "prismatic", "between": ["ground.guide", "block.guide"]}
    weight = {"type": "gravity", "acceleration": [0.0, -9.81, 0.0]}
    start = {"main": {"position": 1.0}, "guide": {"near": 1.2}}
    return _scene(1.0, body=bodies, joint=joint, load={"weight": weight}, start={"joint": start})


def held_tendon(force: float = 100.0) -> Scene:
    """Return two joints that a gear couples, held at rest against a tendon with a force [N]."""
    thigh, shank = (_body({"hinge": {}, "end": {"position": end}}) for end in ([0.4, 0.0, 0.0], [0.06, 0.03, 0.0]))
    del thigh["pose"], shank["pose"]
    joint = {"hip": ("ground.hip", "thigh.hinge"), "knee": ("thigh.end", "shank.hinge")}
    tendon = {"type": "line-expression", "between": ["ground.origin", "shank.end"], "force": f"{force} N"}
    return _scene(
        0.01,
        body={"ground": _ground(hip={}, origin={"position": [-0.05, 0.06, 0.0]}), "thigh": thigh, "shank": shank},
        joint={name: {"type": "revolute", "between": list(frames)} for name, frames in joint.items()},
        gear={"couple": {"first": "hip", "second": "knee", "ratio": 0.5}},
        start={"joint": {"hip": {"position": "20 deg"}, "knee": {"position": "10 deg"}}},
        drive={"hip": {"joint": "hip", "law": "20 deg"}},
        load={"tendon": tendon},
    )


def cam_of_points(count: int) -> Scene:
    """Return a slide that a spline moves by 50 mm (1 - cos(2 pi t / 1 s)), which begins and ends at rest at 0."""
    times = np.linspace(0.0, 1.0, count)
    values = 0.05 - 0.05 * np.cos(2.0 * np.pi * times)
    return _scene(
        1.0,
        body={"ground": _ground(o={}), "slide": _body({"o": {}})},
        joint={"rail": {"type": "prismatic", "between": ["ground.o", "slide.o"]}},
        drive={"cam": {"joint": "rail", "law": {"type": "spline", "time": times.tolist(), "value": values.tolist()}}},
    )


def row_of_slides() -> Scene:
    """Return five slides, each on the one before, of which the third alone is given a velocity."""
    names = ["ground", *(f"s{k}" for k in range(1, 6))]
    bodies = {name: _body({"o": {}}) for name in names[1:]}
    bodies["s3"]["velocity"] = [0.0, 0.0, 2.0]
    rails = {b: {"type": "prismatic", "between": [f"{a}.o", f"{b}.o"]} for a, b in itertools.pairwise(names)}
    return _scene(0.01, body={"ground": _ground(o={}), **bodies}, joint=rails)
