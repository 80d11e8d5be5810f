"""What `check` computes of a scene in seconds, without modes and without compiling: meshes, the start, free motions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from flexclear.pipeline.core.system.errors import FlexclearError, InputError, InputErrors, ResourceError
from flexclear.stages import meshing, rigid_body

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.parts import FlexibleBody
    from flexclear.pipeline.core.scene.schema import Scene
    from flexclear.pipeline.dynamics.model.mechanism import Mechanism
    from flexclear.pipeline.structure.fe.model import Model

#: the message about a file: it is wrong, or asks for too much
MISTAKES = (InputError, ResourceError)
#: larger files of meshes, and meshes with more unknowns, are left to the run [bytes, unknowns]
LARGEST_FILE, LARGEST_MESH = 20 << 20, 150_000
#: extents of a mesh from a file beyond which its unit of length is doubted [m]
SMALLEST, LARGEST = 1e-3, 10.0
#: parts that a mechanism does not need in order to fit together
ACTING = ("[load.", "[gear.", "[stop.")
#: unused frames that are listed
LISTED = 3


@dataclass
class Findings:
    """errors: what is refused.  warnings: what is doubtful.  notes: facts that a summary adds."""

    errors: list[FlexclearError] = field(default_factory=list)
    warnings: list[InputError] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def attempt(self, check: Callable[[], None], place: Callable[[InputError], InputError]) -> bool:
        """Run a check; what it raises is collected, located by `place`.  Returns whether it passed."""
        try:
            check()
        except InputErrors as errors:
            self.errors += [place(error) for error in errors.errors]
        except InputError as error:
            self.errors.append(place(error))
        except ResourceError as error:
            self.errors.append(error)
        else:
            return True
        return False


@dataclass(frozen=True)
class Body:
    """A mesh without its modes.  rigid: mass, inertia and frames (schema RIGID).  interfaces: those of the recipe."""

    model: Model
    rigid: xr.Dataset
    interfaces: tuple[str, ...]


def scene(whole: Scene) -> Findings:
    """Meshes and requested modes of a scene whose recipes can be read, and the mechanism made of them."""
    seen = Findings()
    bodies = dict(_bodies(whole, seen))
    for name, body in whole.flexible().items():
        if name in bodies:
            seen.attempt(partial(_modes, bodies[name], body), partial(_of_modes, whole, name))
    if seen.errors or set(bodies) != set(whole.recipes()):
        return seen
    rigid = {name: body.rigid for name, body in bodies.items()}
    if seen.attempt(partial(_assembled, whole, rigid, seen), partial(_in_file, whole)):
        _free_motions(whole, rigid, seen)
    return seen


def recipe(path: Path) -> tuple[Body | None, Findings]:
    """A mesh recipe: its mesh, where that can be made in seconds, and what is to be said of it."""
    seen = Findings()
    made: list[Body] = []
    seen.attempt(lambda: made.extend(_meshed(path, seen)), lambda error: error)
    return (made[0] if made else None), seen


def _bodies(whole: Scene, seen: Findings) -> Iterator[tuple[str, Body]]:
    """Bodies with a mesh; a recipe that several of them name is meshed once."""
    once = cache(recipe)
    for name, path in whole.recipes().items():
        body, of_recipe = once(Path(path))
        seen.errors += [error for error in of_recipe.errors if error not in seen.errors]
        seen.warnings += [warning for warning in of_recipe.warnings if warning not in seen.warnings]
        if body is not None:
            yield name, body


def _meshed(path: Path, seen: Findings) -> Iterator[Body]:
    from flexclear.pipeline.structure.fe.recipe import parse
    from flexclear.pipeline.structure.kinds import kind
    from flexclear.pipeline.structure.modes import rigid

    table = meshing.params(path)["recipe"]
    parse(table, str(path))
    named = meshing.files(table, path.parent)
    if any(file.stat().st_size > LARGEST_FILE for file in named):
        return
    try:
        mesh = kind.build(table, path.parent)
    except InputError as error:
        raise meshing.in_recipe(error, path) from None
    seen.warnings += _unit(mesh, table, path)
    if 3 * mesh.sizes.get("node", 0) > LARGEST_MESH:
        return
    model = kind.of_mesh(mesh).assemble(mesh)
    yield Body(model, rigid.of_model(model, mesh.attrs["title"]), tuple(mesh.attrs["interfaces"].split()))


def _unit(mesh: xr.Dataset, table: dict[str, object], path: Path) -> Iterator[InputError]:
    """A mesh from a file whose size suggests another unit of length; files do not say theirs."""
    import numpy as np

    shape = table["shape"]
    if not isinstance(shape, dict) or shape.get("type") != "mesh-file":
        return
    size, unit = float(np.ptp(mesh["node_position"].values, axis=0).max()), shape.get("length_unit")
    if not SMALLEST <= size <= LARGEST:
        other = "mm" if size > LARGEST else "m"
        yield InputError(
            f"{path} [shape.length_unit]",
            f"with lengths in {unit} the mesh is {size:.4g} m long",
            f'write length_unit = "{other}" if its numbers are in {other}',
        )


def _modes(body: Body, part: FlexibleBody) -> None:
    from flexclear.pipeline.structure.modes.solution import require_possible

    require_possible(body.model, part.modes, body.interfaces)


def _of_modes(whole: Scene, body: str, error: InputError) -> InputError:
    """An error of modes, located in the scene."""
    return InputError(f"{whole.path or whole.name} [body.{body}.{error.place}]", error.problem, error.remedy)


def _in_file(whole: Scene, error: InputError) -> InputError:
    if whole.path is None or not error.place.startswith("["):
        return error
    return InputError(f"{whole.path} {error.place}", error.problem, error.remedy)


def _assembled(whole: Scene, rigid: dict[str, xr.Dataset], seen: Findings) -> None:
    """Build the mechanism where the run begins: poses, axes, loads and loose joints are checked against each other.

    Flexible bodies are undeformed; of rigid mechanisms rank and drives are checked, too.
    """
    from flexclear.pipeline.dynamics.model.mobility import analyse
    from flexclear.pipeline.dynamics.model.model import tabulate
    from flexclear.pipeline.dynamics.model.plausibility import (
        forgotten,
        refuse_missed,
        refuse_overlap,
        unused_frames,
    )

    mechanism = _mechanism(whole, rigid)
    if mechanism.all_rigid:
        model = tabulate(mechanism)
        mechanism = model.mechanism
        analyse(model)
        refuse_missed(mechanism)
        refuse_overlap(mechanism)
    else:
        from flexclear.pipeline.dynamics.model.assembly import assembled

        mechanism = assembled(mechanism)
        refuse_missed(mechanism)
    for body, text, remedy in forgotten(mechanism):
        seen.warnings.append(_in_file(whole, InputError(f"[body.{body}]", text, remedy)))
    unused = unused_frames(mechanism)
    if unused:
        more = f" and {len(unused) - LISTED} more" if len(unused) > LISTED else ""
        seen.notes.append(f"frames that nothing uses: {', '.join(unused[:LISTED])}{more}")


def _mechanism(whole: Scene, rigid: dict[str, xr.Dataset]) -> Mechanism:
    from flexclear.pipeline.dynamics.model.mechanism import build
    from flexclear.pipeline.dynamics.run.run import placed

    meshed = {f"{rigid_body.PREFIX}{name}": rigid[name] for name in whole.meshed()}
    if meshed:
        table = whole.model_dump(mode="python", exclude_none=True)
        table["body"] = rigid_body.filled(table["body"], meshed)
        whole = type(whole).model_validate(table)
    return build(placed(whole), {name: rigid[name] for name in whole.flexible()})


def _free_motions(whole: Scene, rigid: dict[str, xr.Dataset], seen: Findings) -> None:
    """Note the free motions besides the drives, with rigid bodies and loose joints closed, where these fit.

    Loads, gears and stops are read for it: what is wrong with them is an error of the scene itself.
    """
    from flexclear.pipeline.core.scene.variants import ideal, loose
    from flexclear.pipeline.dynamics.model.mobility import analyse
    from flexclear.pipeline.dynamics.model.model import tabulate

    idealised = bool(loose(whole) or whole.flexible())
    try:
        mechanism = _mechanism(ideal(whole) if idealised else whole, rigid)
        free = analyse(tabulate(mechanism)).mobility
    except InputError as error:  # others: only as flexible bodies or with clearance it moves
        if error.place.startswith(ACTING):
            seen.errors.append(_in_file(whole, error))
        return
    closed = " with loose joints closed" if loose(whole) else ""
    seen.notes.append(f"free motions besides the drives{closed}: {free}")
