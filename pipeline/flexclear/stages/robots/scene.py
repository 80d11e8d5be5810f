"""The scene of a robot's file, with the surfaces that its pictures show."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from flexclear.scene.limits import Limits
from flexclear.stages.robots.acting import take_actuators, take_loads, take_stops
from flexclear.stages.robots.files import Robot
from flexclear.stages.robots.geometry import take_geometry
from flexclear.stages.robots.mechanism import OBJECT, Assembly, take_bodies, take_loops, take_start
from flexclear.stages.robots.text import Draft, scene_text
from flexclear.system.errors import InputError

#: length of the run and its output [s], for the user to change
TIME, OUTPUT = {"end": "1 s"}, {"interval": "2 ms"}
#: what a model counts that has no counterpart in a scene
UNLIKE = {"nflex": "flexible elements", "nskin": "skins", "nsensor": "sensors", "ncam": "cameras", "nlight": "lights"}
UNLIKE |= {"nplugin": "plugins", "nmocap": "bodies moved from outside (mocap), fixed to the ground here"}
UNLIKE |= {"ntuple": "tuples", "nnumeric": "numeric fields", "ntext": "texts", "nuserdata": "numbers for users"}


def scene_of(robot: Robot, source: Path, stem: str) -> tuple[str, dict[str, bytes], list[str]]:
    """Return the text of the scene `stem`.toml of a robot, the files next to it by name, and what is not taken over."""
    model, draft, most = robot.model, Draft(lost=[*robot.lost]), Limits().parts
    if max(model.nbody, model.njnt) > most:
        problem = f"has {model.nbody} bodies and {model.njnt} joints, more than the {most} that a scene may have"
        raise InputError(str(source), problem, "name a smaller model")
    off = mujoco.mjtDisableBit
    if model.opt.disableflags & off.mjDSBL_CONSTRAINT:
        model.opt.disableflags |= off.mjDSBL_EQUALITY | off.mjDSBL_FRICTIONLOSS | off.mjDSBL_LIMIT | off.mjDSBL_CONTACT
    key = model.nkey > 0
    q, v = (model.key_qpos[0], model.key_qvel[0]) if key else (model.qpos0, np.zeros(model.nv))
    at = Assembly(model, draft, np.array(q), np.array(v))
    take_bodies(at)
    take_loops(at)
    take_loads(at)
    take_stops(at)
    take_actuators(at, *((model.key_ctrl[0], model.key_act[0]) if key else (np.zeros(model.nu), np.zeros(model.na))))
    files = take_geometry(at, f"{stem}_surfaces")
    starts = take_start(at)
    draft.lost += _lines_without_counterpart(model)
    if len(draft.parts["body"]) == 1:
        raise InputError(str(source), "holds no body that moves", "name the robot's own file")
    top = {"title": _title(model, source), "time": TIME, "output": OUTPUT}
    end = {"start.joint": starts} if starts else {}
    draft.lost[:], draft.changed[:] = dict.fromkeys(draft.lost), dict.fromkeys(draft.changed)
    return scene_text([*_head(robot, source, stem, draft)], top, draft, end), files, draft.lost


def _title(model: Any, source: Path) -> str:
    name = model.names[: model.names.index(b"\0")].decode(errors="replace").strip()
    return "".join(c if c.isprintable() else " " for c in name or source.stem)


def _head(robot: Robot, source: Path, stem: str, draft: Draft) -> Iterator[str]:
    """Yield the paragraphs before the scene."""
    yield f"Written from {source.name} ({robot.kind}, compiled by MuJoCo {robot.version})."
    yield ""
    yield f"  flexclear show {stem}.toml      the start pose with all names, without a run"
    yield f"  flexclear render {stem}.toml    runs it; film, pictures"
    yield ""
    yield "Numbers are SI. Names are those of the file, with _ for what names cannot have."
    for says, items in (("Different here:", draft.changed), ("Not taken over:", draft.lost)):
        if items:
            yield from ("", says, *(f"- {item}" for item in items))
    yield ""


def _lines_without_counterpart(model: Any) -> Iterator[str]:
    """Yield what of a model has no counterpart in a scene."""
    touching = int(np.sum((model.geom_contype != 0) | (model.geom_conaffinity != 0)))
    if (touching or model.npair) and not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT:
        yield f"contacts between geoms, of which {touching} may touch; a `ball-on-plane` is a ball above a floor"
    if model.opt.density or model.opt.viscosity or np.any(model.opt.wind):
        yield "forces of air or water (density, viscosity, wind)"
    if np.any(model.jnt_margin):
        yield "margins of limits"
    if model.nkey > 1:
        others = [mujoco.mj_id2name(model, OBJECT.mjOBJ_KEY, k) or f"no. {k}" for k in range(1, model.nkey)]
        yield f"keyframes but the first: {', '.join(others)}"
    counts = [f"{count} {text}" for name, text in UNLIKE.items() if (count := getattr(model, name, 0))]
    if counts:
        yield ", ".join(counts)
    yield f"time step ({model.opt.timestep:g} s) and solver: a run chooses its steps by the tolerance in [solver]"
