"""Models and results in the forms of other programs: FMUs, state space, load histories, cards of an FE program.

To add a format: its entry in `FORMATS`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from flexclear.artifacts.disk import disk_limits, publish
from flexclear.scene.load import edited
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.scene.toml_files import read_toml
from flexclear.stages import export, scenes
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Workplace
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

#: cards of CalculiX and Abaqus
CARDS = ".inp"
#: components of a load below this fraction of the largest [N, N m] have no card
NEGLIGIBLE = 1e-12
#: variables of a run that concern one flexible body, and the coordinate by which its entries are chosen
OF_BODY = {
    "frame_force": "loaded_frame",
    "frame_moment": "loaded_frame",
    "origin_acceleration": "loaded_body",
    "axes_velocity": "loaded_body",
    "axes_acceleration": "loaded_body",
    "modal_coordinate": "mode",
    "modal_velocity": "mode",
}


def frame_loads(scene: Scene, body: str | None = None, workplace: Workplace | None = None) -> xr.Dataset:
    """Return the loads on the frames of a flexible body over time, its acceleration field and modal coordinates.

    body: its name, where the scene has several.  Raises InputError for another one.
    """
    import xarray as xr

    flexible = list(scene.flexible())
    if body is None and len(flexible) == 1:
        body = flexible[0]
    if body not in flexible:
        what = f"'{body}' is no flexible body" if body else f"the scene has {len(flexible)} flexible bodies"
        raise InputError("--body", what, suggestion(body or "", flexible) if flexible else "loads are of such a body")
    asked = [*(scene.output.frame_loads or ()), *([] if body in (scene.output.frame_loads or ()) else [body])]
    run = scenes.run(edited(scene, {"output.frame_loads": asked}), workplace)
    chosen = {}
    for name, dim in OF_BODY.items():
        owners = run["mode_body" if dim == "mode" else dim].values.tolist()
        chosen[name] = run[name].isel({dim: [owner.partition(".")[0] == body for owner in owners]})
    return xr.Dataset(chosen).assign_attrs(title=f"Loads on {body}", scene=scene.name, body=body)


def cards(loads: xr.Dataset, units: str, nodal: Mapping[str, Sequence[tuple[str, int, np.ndarray]]]) -> tuple[str, str]:
    """Return amplitudes, and loads on nodes, as cards of CalculiX and Abaqus in a system of units.

    nodal: by frame, the nodes that carry its load: node or set, degree of freedom, and force [N] or moment [N m] there,
    per force and moment on the frame, (6,).  Loads at a single time have no amplitudes.
    """
    import numpy as np

    from flexclear.structure.fe.exchange.matrices import SYSTEMS

    length, mass, second = SYSTEMS[units]
    force, times = mass * length / second**2, loads["time"].values / second
    both = [loads[name].transpose("loaded_frame", "axis", "time").values for name in ("frame_force", "frame_moment")]
    wrenches = np.concatenate(both, axis=1)
    amplitudes, acting = list[str](), list[str]()
    for frame, wrench in zip(loads["loaded_frame"].values.tolist(), wrenches, strict=True):
        for node, freedom, weights in nodal[frame.partition(".")[2]]:
            values = weights @ wrench
            if np.abs(values).max() <= NEGLIGIBLE * np.abs(wrenches).max():
                continue
            values, name = values / (force if freedom <= 3 else force * length), f"{node}_{freedom}"
            if len(times) == 1:
                acting += ["*CLOAD", f"{node}, {freedom}, {float(values[0])!r}"]
                continue
            pairs = np.stack([times, values], axis=1).ravel().tolist()
            rows = [", ".join(map(repr, pairs[i : i + 8])) for i in range(0, len(pairs), 8)]
            amplitudes += [f"*AMPLITUDE, NAME=LOAD_{name}", *rows]
            acting += [f"*CLOAD, AMPLITUDE=LOAD_{name}", f"{node}, {freedom}, 1.0"]
    return "\n".join([*amplitudes, ""]), "\n".join([*acting, ""])


def _carriers(scene: Scene, body: str, workplace: Workplace) -> tuple[str, Callable[[str], Any]]:
    """Return the units of a body's files, and its nodes that carry the load on each frame, by the frame's name.

    Bodies that another program meshed have numbered nodes; of others each frame is a set with one node that turns.
    """
    import numpy as np

    recipe = scene.recipes().get(body)
    shape = read_toml(Path(recipe)).get("shape", {}) if recipe is not None else {}
    if not isinstance(shape, dict) or shape.get("type") != "matrices":
        return "m-kg-s", lambda frame: [(frame.upper(), k + 1, row) for k, row in enumerate(np.eye(6))]
    from flexclear.structure.fe.exchange.matrices import nodal_loads

    return shape["units"], nodal_loads(workplace.datasets(Graph(scene, shown=False).mesh[body])[0]).__getitem__


def _write_fmu(scene: Scene, target: Path, asked: Mapping[str, Any], workplace: Workplace) -> str:
    from flexclear.stages import fmu  # not for every program that imports the public functions: it computes

    return fmu.write(scene, target, asked, workplace)


def _write_state_space(scene: Scene, target: Path, asked: Mapping[str, Any], workplace: Workplace) -> str:
    made = scenes.linear(scene, asked.get("at"), workplace, "state_space", held=bool(asked.get("held")))
    export.write(made, target)
    counts = {what: made.sizes[what] for what in ("state", "input", "output")}
    sizes = ", ".join(f"{count} {what}{'' if count == 1 else 's'}" for what, count in counts.items())
    names = [f"{what}s: {', '.join(made[what].values.tolist()) or 'none'}" for what in counts]
    return "\n".join([f"wrote {target}: {sizes}, about the equilibrium at t = {made.attrs['time']:.6g} s", *names])


def _write_loads(scene: Scene, target: Path, asked: Mapping[str, Any], workplace: Workplace) -> str:
    loads, at = frame_loads(scene, asked.get("body"), workplace), asked.get("at")
    body, frames = loads.attrs["body"], [name.partition(".")[2] for name in loads["loaded_frame"].values.tolist()]
    if at is not None:
        loads = loads.sel(time=[at], method="nearest")
    written = f"loads on {', '.join(frames)} of {body}"
    if target.suffix != CARDS:
        export.write(loads, target)
        return f"wrote {target}: {written} at {loads.sizes['time']} times, SI units, its axes"
    units, nodes = _carriers(scene, body, workplace)
    loads = loads.drop_duplicates("time", keep="last")  # events have two rows
    amplitudes, acting = cards(loads, units, {name: nodes(name) for name in frames})
    publish(target, acting.encode())
    if at is not None:
        return f"wrote {target}: {written} at {float(loads['time'].values[0]):.6g} s, in {units}, for a static step"
    table = target.with_name(f"{target.stem}_amplitudes{CARDS}")
    publish(table, amplitudes.encode())
    return f"wrote {target}: {written}, in {units}, for the step\nwrote {table}: its amplitudes, for before the steps"


class Format(NamedTuple):
    """A format: function that writes it and says what, endings of its files, the first by default, and its options."""

    write: Callable[[Scene, Path, Mapping[str, Any], Workplace], str]
    endings: tuple[str, ...]
    options: tuple[str, ...]


FORMATS = {
    "fmu": Format(_write_fmu, (".fmu",), ("fmi",)),
    "state-space": Format(_write_state_space, (".npz", ".nc", ".mat"), ("at", "held")),
    "loads": Format(_write_loads, (".csv", CARDS, ".nc", ".npz", ".mat", ".parquet", ".xlsx"), ("at", "body")),
}


def write(scene: Scene, name: str, target: Path | None, asked: Mapping[str, Any], workplace: Workplace) -> str:
    """Write a scene in a format, by default to a file named like the scene in the current folder; return what it says.

    asked: the options given.  Raises InputError for an unknown format or ending, or an option of another format.
    """
    if name not in FORMATS:
        raise InputError(f"--format {name}", "unknown format", suggestion(name, FORMATS))
    made = FORMATS[name]
    for option in asked:
        if option not in made.options:
            theirs = ", ".join(key for key, one in FORMATS.items() if option in one.options)
            raise InputError(f"--{option}", f"has no meaning for the format {name}", f"it belongs to {theirs}")
    target = target or Path(f"{Path(scene.name).name}{made.endings[0]}")
    export.check_format(target, made.endings)
    scenes.check_target(target)
    with disk_limits(target.parent):
        return made.write(scene, target, asked, workplace)
