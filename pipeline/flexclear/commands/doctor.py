"""``flexclear doctor``: versions, graphics, caches, space, and a small run with a known answer."""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from flexclear.artifacts.paths import kernel_root, results_root
from flexclear.artifacts.store import Store
from flexclear.commands import new, reproduction
from flexclear.dynamics.compile.folder import writable
from flexclear.post.render import gl
from flexclear.stages import scenes, simulation
from flexclear.stages.kernels import warm
from flexclear.stages.workplace import Workplace, add_options, open_workplace
from flexclear.system import machine
from flexclear.system.errors import FlexclearError, InputError
from flexclear.workflow.fingerprint import TREE, library_version

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.scene.schema import Scene
    from flexclear.stages.graph import Graph
    from flexclear.system.progress import Progress

LIBRARIES = (
    "numpy",
    "scipy",
    "numba",
    "llvmlite",
    "xarray",
    "netCDF4",
    "skfem",
    "meshio",
    "matplotlib",
)
#: optional libraries: only pictures of shapes need them
OPTIONAL = ("pyvista", "vtk", "imageio")
#: labels of a line: all right, wrong, or lacking but optional
LABELS = {True: "ok   ", False: "WRONG", None: "lacks"}
#: smallest sufficient memory, disk space, and disk space for kernels [B]
LITTLE_MEMORY, LITTLE_DISK, LITTLE_FOR_KERNELS = 1e9, 2e9, 1e8
#: a body in free fall: after the time T [s] it has fallen by g T^2/2
GRAVITY, T = 9.81, 0.1
SCENE = f"""
title = "Free fall"
[time]
end = {T}
[output]
interval = {T}
[load.gravity]
type = "gravity"
acceleration = [0.0, 0.0, {-GRAVITY}]
[body.ball]
type = "rigid"
mass = 2.0
inertia = [0.1, 0.1, 0.1]
pose = {{}}
"""
#: run in a process of its own, without compilation, which would take longer than all else
RUN = """import sys
import flexclear as fc
from flexclear.system.errors import FlexclearError
try:
    result = fc.run(sys.argv[1])
except FlexclearError as error:
    sys.exit(str(error))
print(float(result.position.sel(body="ball", axis="z")[-1]))
"""
#: templates with the kinds of parts that most mechanisms have
USUAL = ("pendulum", "four-bar", "slider-crank", "leg")


class UnwellError(FlexclearError):
    """Error that reports something missing or wrong that this program needs."""

    exit_code = 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    either = parser.add_mutually_exclusive_group()
    either.add_argument("--bundle", metavar="SCENE", help="run a scene, and write all that repeats it into one file")
    either.add_argument("--repeat", type=Path, metavar="FILE.zip", help="repeat the run in such a file")
    either.add_argument(
        "--compile",
        nargs="*",
        metavar="SCENE",
        help="compile the functions of these scenes without a run; without names those of most scenes",
    )
    add_options(parser, "set")
    parser.add_argument("--out", type=Path, metavar="FILE.zip", help="file that --bundle writes")


def run_command(options: argparse.Namespace) -> None:
    """Print the findings line by line; raise UnwellError at the end when something is wrong."""
    if options.out is not None:
        if options.bundle is None:
            raise InputError(
                f"--out {options.out}", "is the file of --bundle, which is not given", "add --bundle SCENE"
            )
        scenes.check_out(options.out, (options.bundle,), endings=(".zip",))
    if options.bundle is not None:
        path, left_out = reproduction.make(options.bundle, options.set, (*LIBRARIES, *OPTIONAL), options.out)
        print(f"{path}: the scene's files, versions and messages; repeat with: flexclear doctor --repeat {path.name}")
        for file in left_out:
            print(f"left out: {file}, which is outside of the scene's folder; copy it there if it may be shared")
        return
    if options.repeat is not None:
        same, report = reproduction.repeat(options.repeat, (*LIBRARIES, *OPTIONAL))
        print(report)
        if not same:
            raise UnwellError("the run ends differently here")
        return
    if options.compile is not None:
        names = compile_named_scenes(options.compile, open_workplace())
        print(f"compiled: all functions for runs of {', '.join(names)}; {_describe_kernels()[0]}")
        return
    wrong = []
    for name, text, fine in findings():
        print(f"{LABELS[fine]}  {name:<10} {text}", flush=True)
        wrong += [name] if fine is False else []
    if wrong:
        raise UnwellError(f"problems: {', '.join(wrong)}")


def findings() -> Iterator[tuple[str, str, bool | None]]:
    """Yield name, finding, and True when it is right; None when something is lacking that only pictures need."""
    yield (
        "python",
        f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        sys.version_info >= (3, 11),
    )
    versions = {name: library_version(name) for name in (*LIBRARIES, *OPTIONAL)}
    missing = [name for name in LIBRARIES if versions[name] == "absent"]
    yield "libraries", ", ".join(f"{n} {v}" for n, v in versions.items()), not missing
    yield "memory", f"{machine.size_text(machine.available_memory())} free", machine.available_memory() > LITTLE_MEMORY
    yield "results", *_describe_results(results_root())
    yield "kernels", *_describe_kernels()
    yield "graphics", *_describe_graphics()
    yield "self-test", *_self_test()


def _describe_results(root: Path) -> tuple[str, bool]:
    """Return the folder of results with its free space and obstacles to writing, and True without obstacles."""
    free = machine.free_disk_space(root)
    wrong = [f"less than {machine.size_text(LITTLE_DISK)}"] if free <= LITTLE_DISK else []
    if not os.access(next(p for p in (root, *root.parents) if p.exists()), os.W_OK):
        wrong.append("the folder is not writable: set FLEXCLEAR_RESULTS to another")
    return "; ".join([f"{root}, {machine.size_text(free)} free", *wrong]), not wrong


def _describe_kernels() -> tuple[str, bool]:
    messages: list[str] = []
    try:
        folder = writable(kernel_root(), messages.append)
    except FlexclearError as error:
        return str(error), False
    if messages:
        return f"{messages[0]}: set FLEXCLEAR_KERNELS to another folder", False
    text = f"{folder}, {sum(1 for _ in folder.glob('*.sum'))} compiled"
    if machine.free_disk_space(folder) < LITTLE_FOR_KERNELS:
        return (
            f"{text}; only {machine.size_text(machine.free_disk_space(folder))} free: "
            "set FLEXCLEAR_KERNELS to another folder",
            False,
        )
    return text, True


def _describe_graphics() -> tuple[str, bool | None]:
    """Draw something, since libraries that load may still fail; without them only pictures of shapes are lacking."""
    if gl.can_draw():
        return f"{gl.library_state()}; a picture was drawn", True
    return f"{gl.library_state()}; nothing can be drawn: {gl.remedy()}", None


def _self_test() -> tuple[str, bool]:
    expected = -0.5 * GRAVITY * T**2
    paths = os.pathsep.join([str(TREE), os.environ.get("PYTHONPATH", "")])  # the libraries may be there, too
    try:
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "fall.toml").write_text(SCENE, encoding="utf-8", newline="\n")
            # results and kernels have lines of their own
            environment = {"FLEXCLEAR_RESULTS": folder, "FLEXCLEAR_KERNELS": str(Path(folder) / "kernels")}
            done = subprocess.run(
                [sys.executable, "-W", "ignore", "-c", RUN, str(Path(folder) / "fall.toml")],
                env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": paths, **environment},
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                check=False,
            )
    except OSError as error:
        return f"a free fall cannot be computed: {error.strerror} ({error.filename})", False
    lines = done.stdout.split()
    if done.returncode or not lines:
        errors = done.stderr.strip().splitlines()
        # users need only the last line of a traceback
        last_lines = errors[-1:] if any(line.startswith("Traceback") for line in errors) else errors[-4:]
        return f"a free fall cannot be computed: {' '.join(line.strip() for line in last_lines)}", False
    # 1e-9: largest error [m]; the integration is exact to its tolerance of 1e-10
    fine = abs(float(lines[-1]) - expected) < 1e-9
    return f"a free fall of {T:g} s ends at {float(lines[-1]):.12g} m instead of {expected:.12g} m", fine


def compile_named_scenes(names: list[str], workplace: Workplace) -> list[str]:
    """Compile, or fetch from the cache, all functions that runs of scenes call; return the scenes' names.

    Without names, scenes with the most common kinds of parts are compiled.  For an image, a cluster, or before a
    lesson: nothing is compiled in the background, since a process that outlives its command would use a laptop's
    battery, be billed or killed by a scheduler, and write into a folder that a container is about to discard.
    """
    if names:
        return _compile_scenes(scenes.graphs(names), workplace)
    with tempfile.TemporaryDirectory() as folder:
        temporary = replace(workplace, store=Store(Path(folder) / "results"))
        return _compile_scenes(
            scenes.graphs([str(new.write(kind, Path(folder) / kind)[0]) for kind in USUAL]), temporary
        )


def _compile_scenes(requested: Sequence[Graph], workplace: Workplace) -> list[str]:
    workplace.datasets(*(task for graph in requested for task in graph.bodies().values()))
    workplace.monitor.start(len(requested))
    for graph in requested:
        bodies = graph.bodies()
        known = dict(zip(bodies, workplace.datasets(*bodies.values()), strict=True))
        name = workplace.monitor.begin(graph.scene.name, "kernels")
        _compile(
            simulation.rebuild(graph.simulate.params, known),
            simulation.bundles(known),
            partial(workplace.monitor.update, name),
        )
        workplace.monitor.finish(name, failed=False)
    workplace.monitor.end()
    return [graph.scene.name for graph in requested]


def _compile(scene: Scene, reduced: Mapping[str, xr.Dataset], progress: Progress) -> None:
    """Compile the functions of a scene's integrators, and of those that may take over."""
    from flexclear.dynamics.compile import functions
    from flexclear.dynamics.effects import schemes

    model = warm(scene, reduced, progress).model
    for scheme in schemes(scene):
        functions.entry(model.parts, scheme, lambda text: progress(None, text))
