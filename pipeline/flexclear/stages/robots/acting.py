"""What acts on the joints of a compiled model, as parts of a scene: gravity, springs, dampers, friction, rotors, stops,
actuators."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from flexclear.dynamics.model.merge import GROUND, Placement
from flexclear.stages.robots.mechanism import OBJECT, Assembly, Coordinate, clean, placement

DISABLED, TRANSMISSION = mujoco.mjtDisableBit, mujoco.mjtTrn
GAIN, BIAS, DYNAMICS = mujoco.mjtGain, mujoco.mjtBias, mujoco.mjtDyn
#: speeds at which friction loss has its full value, of angles [rad/s] and lengths [m/s]: MuJoCo's is a constraint
FULL_FRICTION = {True: 0.05, False: 0.01}
#: a force [N] or torque [N m] that stands for none, where an actuator is limited on one side alone
UNLIMITED = 1e12
#: frame of the ground about which the rotors turn
ROTORS = "rotors"


def take_loads(at: Assembly) -> None:
    """Add gravity, springs, dampers and friction of joints and of the lines between two sites."""
    model = at.model
    off = model.opt.disableflags
    at.draft.comments["load"] = "loads: gravity; springs, dampers, friction of joints; actuators"
    if np.any(model.opt.gravity) and not off & DISABLED.mjDSBL_GRAVITY:
        acceleration = clean(model.opt.gravity)
        at.draft.add("load", at.take("gravity", "load"), {"type": "gravity", "acceleration": acceleration})
        for b in np.flatnonzero(model.body_gravcomp) if model.ngravcomp else ():
            owner, here = at.places[b]
            if owner == GROUND:
                continue
            name = at.take(f"{owner}_gravity_compensation", "load")
            frame = at.frame(owner, name, here.of(Placement(np.array(model.body_ipos[b]))))
            force = -model.body_gravcomp[b] * model.body_mass[b] * model.opt.gravity
            at.draft.add("load", name, {"type": "point-force", "frame": frame, "force": clean(force)})
    for j, one in at.joints.items():
        if model.jnt_actgravcomp[j] and model.ngravcomp and model.jnt_actfrclimited[j]:
            at.draft.changed.append(f"gravity compensation of joint {one.joint} is not limited with its actuators")
        stiffness = 0.0 if off & DISABLED.mjDSBL_SPRING else model.jnt_stiffness[j]
        damping = 0.0 if off & DISABLED.mjDSBL_DAMPER else model.dof_damping[one.speed]
        loss = 0.0 if off & DISABLED.mjDSBL_FRICTIONLOSS else model.dof_frictionloss[one.speed]
        if np.any(model.jnt_stiffnesspoly[j]) or np.any(model.dof_dampingpoly[one.speed]) or model.jnt_springyield[j]:
            at.draft.lost.append(f"stiffness and damping of joint {one.joint} beyond the linear term")
        if one.single:
            _load_coordinate(at, one, stiffness, damping, loss)
        else:
            _load_ball(at, one, stiffness, damping, loss, model.qpos_spring[one.address :])
        if armature := model.dof_armature[one.speed]:
            _add_rotor(at, one, armature)
    _take_lines(at)


def _load_coordinate(at: Assembly, one: Coordinate, stiffness: float, damping: float, loss: float) -> None:
    """Add spring, damper and friction along a coordinate."""
    rest = at.model.qpos_spring[one.address]
    if stiffness:
        spring = {"type": "joint-spring", "joint": one.joint, "stiffness": stiffness, "rest": rest}
        at.draft.add("load", at.take(f"{one.joint}_spring", "load"), spring)
    if not damping and not loss:
        return
    part = {"type": "joint-friction", "joint": one.joint, "viscous": damping}
    if loss:
        full = FULL_FRICTION[one.turns]
        part["coulomb"] = {"static": loss, "dynamic": loss, "v_static": full, "v_dynamic": 2.0 * full}
        part["source"] = "assumed: the speeds v_static and v_dynamic"
    at.draft.add("load", at.take(f"{one.joint}_friction", "load"), part)


def _load_ball(at: Assembly, one: Coordinate, stiffness: float, damping: float, loss: float, rest: np.ndarray) -> None:
    """Add a bushing for spring and damper of a ball joint, or of a free one."""
    if loss:
        at.draft.lost.append(f"friction loss of joint {one.joint}, a {one.type} one")
    if not stiffness and not damping:
        return
    first, second = at.draft.parts["joint"][one.joint]["between"]
    free, ball = one.type == "free", at.take(f"{one.joint}_spring", "load")
    place = placement(rest[:3], rest[3:7]) if free else placement(np.zeros(3), rest[:4])
    if free or np.any(rest[1:4]):
        body, _, frame = first.partition(".")
        given = at.draft.parts["body"][body]["frames"][frame]
        start = placement(given.get("position", [0, 0, 0]), given.get("quaternion", [1, 0, 0, 0]))
        first = at.frame(body, ball, start.of(place))
    part: dict[str, Any] = {"type": "bushing", "between": [first, second]}
    for key, number in (("stiffness", stiffness), ("damping", damping)):
        if number:
            part[key] = [number * free] * 3 + [number] * 3
    if damping:
        at.draft.changed.append(f"damping of {one.joint} acts on the rate of the rotation vector: equal if it is small")
    at.draft.add("load", ball, part)


def _add_rotor(at: Assembly, one: Coordinate, armature: float) -> None:
    """Add a rotor that turns as the coordinate moves: the armature, an inertia along this coordinate alone."""
    if not one.single:
        at.draft.lost.append(f"armature of joint {one.joint}, a {one.type} one: {armature:.6g} kg m^2")
        return
    name, draft = at.take(f"{one.joint}_rotor", "body"), at.draft
    bearing, between = at.take(f"{name}_bearing", "joint"), [f"{GROUND}.{ROTORS}", f"{name}.axis"]
    draft.parts["body"][GROUND].setdefault("frames", {}).setdefault(ROTORS, {})
    # its mass does nothing: it turns about its own centre
    rotor = {"type": "rigid", "mass": armature, "inertia": [armature] * 3, "geometry": [], "frames": {"axis": {}}}
    draft.add("body", name, rotor, f"armature of {one.joint}, as the inertia of a rotor that turns with it")
    draft.add("joint", bearing, {"type": "revolute", "between": between})
    coupled = {"first": one.joint, "second": bearing, "ratio": 1 if one.turns else "1 rad/m"}
    draft.add("gear", at.take(f"{name}_gear", "gear"), coupled)


def _take_lines(at: Assembly) -> None:
    """Add tendons between two sites as springs and dampers; list the others."""
    model, other, off = at.model, [], at.model.opt.disableflags
    for t in range(model.ntendon):
        name, first = at.name(OBJECT.mjOBJ_TENDON, t, "tendon"), model.tendon_adr[t]
        sites = [model.wrap_objid[w] for w in range(first, first + model.tendon_num[t])]
        kinds = {mujoco.mjtWrap(int(model.wrap_type[w])) for w in range(first, first + model.tendon_num[t])}
        low, high = model.tendon_lengthspring[t]
        stiffness = 0.0 if off & DISABLED.mjDSBL_SPRING else model.tendon_stiffness[t]
        damping = 0.0 if off & DISABLED.mjDSBL_DAMPER else model.tendon_damping[t]
        if np.any(model.tendon_stiffnesspoly[t]) or np.any(model.tendon_dampingpoly[t]) or model.tendon_springyield[t]:
            at.draft.lost.append(f"stiffness and damping of tendon {name} beyond the linear term")
        if kinds != {mujoco.mjtWrap.mjWRAP_SITE} or len(sites) != 2 or (stiffness and low != high):
            other.append(name)
            continue
        if not stiffness and not damping:
            continue
        between = []
        for site in sites:
            owner = model.site_bodyid[site]
            between.append(at.frame_of(owner, name, placement(model.site_pos[site], model.site_quat[site])))
        part = {"type": "spring-damper", "between": between, "stiffness": stiffness, "damping": damping}
        at.draft.add("load", name, {**part, "free_length": low})
    if other:
        at.draft.lost.append(f"tendons: {', '.join(other)}")
    if limited := int(np.sum(model.tendon_limited | (model.tendon_frictionloss > 0) | (model.tendon_armature > 0))):
        at.draft.lost.append(f"limits, friction loss or armature of tendons: {limited}")


def take_stops(at: Assembly) -> None:
    """Add the limits of coordinates as stops, with the stiffness that MuJoCo's parameters mean at the model's zero."""
    model, others = at.model, list[str]()
    if model.opt.disableflags & DISABLED.mjDSBL_LIMIT:
        return
    for j, one in at.joints.items():
        if model.jnt_limited[j] and not one.single:
            others.append(one.joint)
        ends = {key: end for key, end in zip(("lower", "upper"), model.jnt_range[j], strict=True) if np.isfinite(end)}
        if not model.jnt_limited[j] or not one.single or not ends:
            continue
        stiffness, damping = _of_limit(model, j, one)
        normal = {"law": "kelvin-voigt", "stiffness": stiffness, "damping": damping}
        part = {"joint": one.joint, **ends, "normal": normal}
        if not model.jnt_range[j][0] < at.q[one.address] < model.jnt_range[j][1]:
            part["initial_approach_speed"] = 0
        at.draft.add("stop", at.take(f"{one.joint}_ends", "stop"), part)
    if at.draft.parts.get("stop"):
        at.draft.comments["stop"] = (
            "stops: limits of the joints; stiffness and damping are assumed, from solref and the inertia at zero"
        )
        at.draft.changed.append("limits are stops with a stiffness [N m/rad, N/m]; MuJoCo's are soft (solref, solimp)")
    if others:
        at.draft.lost.append(f"limits of joints that are spherical or free: {', '.join(others)}")


def _of_limit(model: Any, j: int, one: Coordinate) -> tuple[float, float]:
    """Return stiffness and damping of a limit: its reference acceleration times the inertia along the coordinate."""
    first, second = model.jnt_solref[j]
    depth, inertia = model.jnt_solimp[j][1], 1.0 / max(model.dof_invweight0[one.speed], 1e-12)
    if first > 0.0:
        return inertia / (depth * first**2 * second**2), 2.0 * inertia / first
    return -inertia * first / depth, -inertia * second


def take_actuators(at: Assembly, control: np.ndarray, activation: np.ndarray) -> None:
    """Add actuators as forces, or as controllers with their gains; control, activation: at the start."""
    model = at.model
    if model.opt.disableflags & DISABLED.mjDSBL_ACTUATION:
        at.draft.lost.append(f"actuators, which the file disables: {model.nactuator}")
        return
    for a in range(model.nactuator):
        name = at.name(OBJECT.mjOBJ_ACTUATOR, a, "actuator")
        why = _why_no_counterpart(model, a)
        on_site = model.actuator_trntype[a] == TRANSMISSION.mjTRN_SITE
        one = None if on_site else at.joints.get(model.actuator_trnid[a][0])
        if why is None and one is not None and not one.single:
            why = f"it acts on a {one.type} joint"
        group = int(model.actuator_group[a])
        if group >= 0 and int(model.opt.disableactuator) >> group & 1:
            why = f"the file disables its group {group}"
        if why is not None:
            at.draft.lost.append(f"actuator {name}: {why}")
            continue
        dynamics = DYNAMICS(int(model.actuator_dyntype[a]))
        u = [float(control[model.actuator_ctrladr[a]]), 0.0]
        if model.actuator_ctrllimited[a] and not model.opt.disableflags & DISABLED.mjDSBL_CLAMPCTRL:
            u[0] = float(np.clip(u[0], *model.actuator_ctrlrange[a]))
        if dynamics == DYNAMICS.mjDYN_INTEGRATOR:
            u = [float(activation[model.actuator_actadr[a]]), u[0]]
            if model.actuator_actlimited[a] and u[1]:
                low, high = model.actuator_actrange[a]
                at.draft.lost.append(f"limits of the activation of actuator {name}: {low:.6g} to {high:.6g}")
        elif dynamics != DYNAMICS.mjDYN_NONE:
            constant = model.actuator_dynprm[a][0]
            at.draft.changed.append(f"actuator {name} acts at once, without its filter of {constant:.6g} s")
        if one is None:
            _push_site(at, a, name, u[0])
        else:
            _push_joint(at, a, name, one, u)


def _why_no_counterpart(model: Any, a: int) -> str | None:
    """Return why an actuator has no counterpart, or None."""
    gain, bias = GAIN(int(model.actuator_gaintype[a])), BIAS(int(model.actuator_biastype[a]))
    dynamics, via = DYNAMICS(int(model.actuator_dyntype[a])), TRANSMISSION(int(model.actuator_trntype[a]))
    linear = {DYNAMICS.mjDYN_NONE, DYNAMICS.mjDYN_INTEGRATOR, DYNAMICS.mjDYN_FILTER, DYNAMICS.mjDYN_FILTEREXACT}
    if gain not in (GAIN.mjGAIN_FIXED, GAIN.mjGAIN_AFFINE) or bias not in (BIAS.mjBIAS_NONE, BIAS.mjBIAS_AFFINE):
        return f"its force is of type {gain.name.removeprefix('mjGAIN_').lower()}"
    if dynamics not in linear or model.actuator_plugin[a] >= 0 or model.actuator_delay[a]:
        return "its activation has a state of its own"
    if via == TRANSMISSION.mjTRN_SITE:
        still = gain == GAIN.mjGAIN_FIXED and bias == BIAS.mjBIAS_NONE and dynamics != DYNAMICS.mjDYN_INTEGRATOR
        return None if still and model.actuator_trnid[a][1] < 0 else "its force on a site changes with time or motion"
    if via not in (TRANSMISSION.mjTRN_JOINT, TRANSMISSION.mjTRN_JOINTINPARENT):
        return f"it acts through a {via.name.removeprefix('mjTRN_').lower()}"
    if not model.actuator_gear[a][0]:
        return "its gear is 0"
    if model.actuator_armature[a] or model.actuator_damping[a] or np.any(model.actuator_dampingpoly[a]):
        return "it has an armature or a damping of its own"
    return None


def _push_site(at: Assembly, a: int, name: str, u: float) -> None:
    """Add force and torque of an actuator on a site, in the site's axes."""
    model, site, k = at.model, at.model.actuator_trnid[a][0], at.model.actuator_gainprm[a][0]
    frame = at.frame_of(model.site_bodyid[site], name, placement(model.site_pos[site], model.site_quat[site]))
    size = float(np.clip(k * u, *_limits(model, a)))
    for key, gear, unit in (("force", model.actuator_gear[a][:3], "N"), ("torque", model.actuator_gear[a][3:], "N m")):
        if np.any(gear):
            part = {"type": f"point-{key}", "frame": frame, key: clean(size * gear), "axes": "frame"}
            label = name if name not in at.draft.parts.get("load", {}) else at.take(f"{name}_torque", "load")
            at.draft.add("load", label, part, f"{name}: per unit of its control {(k * gear).tolist()} {unit}")


def _limits(model: Any, a: int) -> tuple[float, float]:
    """Return the least and largest force of an actuator before its gear."""
    low, high = model.actuator_forcerange[a] if model.actuator_forcelimited[a] else (-np.inf, np.inf)
    return float(low), float(high)


def _push_joint(at: Assembly, a: int, name: str, one: Coordinate, u: list[float]) -> None:
    """Add an actuator on a coordinate: force = gear (gain u + bias), gain and bias linear in coordinate and rate.

    u: control, or activation, at the start and its rate.
    """
    model, gear = at.model, float(at.model.actuator_gear[a][0])
    affine = model.actuator_gaintype[a] == GAIN.mjGAIN_AFFINE
    g, b = model.actuator_gainprm[a][:3] * [1.0, affine, affine], model.actuator_biasprm[a][:3]
    b = b * (model.actuator_biastype[a] == BIAS.mjBIAS_AFFINE)
    low, high = sorted(gear * limit for limit in _limits(model, a))
    j = model.actuator_trnid[a][0]
    if model.jnt_actfrclimited[j]:
        low, high = max(low, model.jnt_actfrcrange[j][0]), min(high, model.jnt_actfrcrange[j][1])
    if model.jnt_actfrclimited[j] and np.sum(at.model.actuator_trnid[:, 0] == j) > 1:
        at.draft.changed.append(f"limits of the sum of all actuators of joint {one.joint} hold for each alone")
    limits = {"limits": [max(low, -UNLIMITED), min(high, UNLIMITED)]} if np.isfinite([low, high]).any() else {}
    span = ", from {:.6g} to {:.6g}".format(*model.actuator_ctrlrange[a]) if model.actuator_ctrllimited[a] else ""
    comment = f"control of {name}: {u[0]:.6g}{span}"
    constant, along, over = gear * (g[0] * u[0] + b[0]), gear**2 * (g[1] * u[0] + b[1]), gear**2 * (g[2] * u[0] + b[2])
    growing, stiff, keys = gear * g[0] * u[1], along or over, {"joint": one.joint}
    if np.any(g[1:] * u[1]) or (growing and over):
        at.draft.lost.append(f"actuator {name}: its gain changes with its activation")
    elif stiff:
        reference = [-constant / along, -growing / along] if along else [0.0, -constant / over]
        gains = {"reference": _line(reference), "proportional": -along, "derivative": -over}
        says = f"{comment}; a change of 1 moves the reference{'' if along else ' speed'} by {-gear * g[0] / stiff:.6g}"
        at.draft.add("load", name, {"type": "pid", **keys, **gains, **limits}, says)
    else:
        force = _line([constant, growing] if growing else [np.clip(constant, low, high)])
        if limits and growing:
            at.draft.lost.append(f"limits of the force of actuator {name}, which grows with time")
        says = f"{comment}; a force, or torque, of {gear * g[0]:.6g} per unit"
        says += f", within {low:.6g} and {high:.6g}" if limits else ""
        at.draft.add("load", name, {"type": "joint-force", **keys, "force": force}, says)


def _line(coefficients: list[float]) -> Any:
    """Return a law of time: a constant, or a polynomial."""
    return {"type": "polynomial", "coefficients": coefficients} if any(coefficients[1:]) else coefficients[0]
