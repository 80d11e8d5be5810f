"""Natural vibrations of an assembled mechanism as moving skins, for pages, and as a film and a sheet of pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from flexclear.post.body_shape import format_frequency, linear_fields
from flexclear.post.render import film_speed, surfaces
from flexclear.post.render.layout import Part, part_pose, pose
from flexclear.post.render.mechanism import COLORS, Flexible, Mechanism, points_at_rest, skin
from flexclear.system.progress import Progress, silent

#: drawn size of the largest displacement of a vibration, as a fraction of the mechanism's size
FRACTION = 0.12
#: largest drawn rotation of any frame [rad]: points move linearly, and would leave a body that turns further
TURN = 0.5
#: size of a film's pictures and of those on a sheet, and number of pictures in a row of a sheet
SIZE, TILE, COLUMNS = (960, 540), (480, 360), 3
#: duration of one vibration in a film [s], and number of its periods
SECONDS, PERIODS = 1.5, 2
#: largest number of shown vibrations, the slowest ones
SHOWN = 12
#: displacement of the centre of mass and rotation in each vibration, (vibration, part, 3), by index of the body
Motions = Mapping[int, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, slots=True)
class Piece:
    """One skin at rest, world axes, and its complex displacement in each vibration.

    moved: real and imaginary part [m per unit of the vibration's coordinate], shape (vibration, 2, point, 3). plain:
    True for the skin's own colour, else colours show the displacement of each point.
    """

    surface: surfaces.Surface
    moved: np.ndarray
    color: str
    opacity: float
    plain: bool


@dataclass(frozen=True, slots=True)
class Vibrations:
    """scale: factor by which each is drawn.  largest: displacement of any point at unit coordinate [m]."""

    pieces: tuple[Piece, ...]
    labels: tuple[str, ...]
    scale: np.ndarray
    largest: np.ndarray


def as_run(linear: xr.Dataset) -> xr.Dataset:
    """Return an equilibrium as a run of one output, in which nothing moves."""
    still = linear[
        [n for n in ("position", "quaternion", "frame_position", "modal_coordinate", "joint_position") if n in linear]
    ]
    zero = xr.zeros_like(linear["position"])
    return still.assign(velocity=zero, angular_velocity=zero).expand_dims(time=[0.0]).assign_attrs(linear.attrs)


def vibrations(drawn: Mechanism, linear: xr.Dataset) -> Vibrations:
    """Return the vibrations of a mechanism: motions that only decay or drift are left out.

    drawn: of the equilibrium as a run of one output.  linear: schema LINEAR.
    """
    linear = linear.isel(vibration=np.flatnonzero(linear["frequency"].values > 0.0))
    run, count = drawn.run, linear.sizes["vibration"]
    motions = body_motions(run, linear, drawn.flexible)
    pieces = []
    for part in drawn.parts:
        matrix = part_pose(run, part, 0)
        drawn_part = surfaces.place(part.surface, matrix[:3, 3], matrix[:3, :3])
        moved = np.zeros((count, 2, *drawn_part.points.shape))
        if part.ends is not None:
            moved = _stretch_ends(run, linear, motions, part, drawn_part.points)
        elif part.owner is not None:
            moved = _rigid_displacements(motions, part.owner, drawn_part.points, run["position"].values[0, part.owner])
        pieces.append(Piece(drawn_part, moved, part.color, part.opacity, True))
    pieces += [_bending_piece(run, body, linear, motions) for body in drawn.flexible]
    sizes = [
        np.linalg.norm(piece.moved, axis=-1).reshape(count, -1).max(axis=1) for piece in pieces if piece.moved.size
    ]
    largest = np.max(sizes, axis=0)
    labels = tuple(
        f"vibration {k + 1}: {format_frequency(frequency)}, damping {damping:.2g}"
        for k, (frequency, damping) in enumerate(
            zip(linear["frequency"].values, linear["damping_ratio"].values, strict=True)
        )
    )
    return Vibrations(tuple(pieces), labels, _scale(linear, drawn.size, largest), largest)


def _scale(linear: xr.Dataset, size: float, largest: np.ndarray) -> np.ndarray:
    """Return the factor of each vibration, which limits both displacements and rotations."""
    turned = np.linalg.norm(linear["frame_rotation"].values, axis=-1).reshape(len(largest), -1).max(axis=1, initial=0.0)
    factor: np.ndarray = np.minimum(
        FRACTION * size / np.where(largest > 0.0, largest, 1.0), TURN / np.where(turned > 0.0, turned, 1e-300)
    )
    return factor


def body_motions(run: xr.Dataset, linear: xr.Dataset, flexible: Sequence[Flexible]) -> Motions:
    """Return the motion of each body in the vibrations, from one of its named frames; bodies without one rest.

    The deformation of a flexible body at the frame is subtracted.
    """
    bent = {body.index: body for body in flexible}
    frames = [str(name) for name in linear["frame"].values]
    motions = {}
    for k, name in enumerate(str(body) for body in run["body"].values):
        at = next((i for i, frame in enumerate(frames) if frame.partition(".")[0] == name), None)
        zero = np.zeros((linear.sizes["vibration"], 2, 3))
        if at is None:
            motions[k] = (zero, zero)
            continue
        move, turn = linear["frame_translation"].values[:, :, at], linear["frame_rotation"].values[:, :, at]
        if k in bent:
            body, R = bent[k], pose(run, k, 0)[:3, :3]
            own = body.bundle.sel(frame=frames[at].partition(".")[2])
            centre = body.bundle["modal_first_moment"].values / float(body.bundle["mass"])
            q = linear["modal_shape"].values[:, :, body.columns]
            turn = turn - q @ own["frame_rotation_shape"].values.T @ R.T
            move = move - q @ (own["frame_translation_shape"].values - centre).T @ R.T
        arm = run["position"].values[0, k] - run["frame_position"].values[0, at]
        motions[k] = (move + np.cross(turn, arm), turn)
    return motions


def _rigid_displacements(motions: Motions, owner: int, points: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return displacements of points of a rigid body in each vibration, (vibration, part, point, 3)."""
    move, turn = motions[owner]
    return move[:, :, None, :] + np.cross(turn[:, :, None, :], points - centre)


def _stretch_ends(run: xr.Dataset, linear: xr.Dataset, motions: Motions, part: Part, points: np.ndarray) -> np.ndarray:
    """Return displacements of points between two ends, even from one to the other; as of `_rigid_displacements`."""
    assert part.ends is not None
    places = [site.position(run, 0) for site in part.ends]
    line = places[1] - places[0]
    along = np.clip((points - places[0]) @ line / (line @ line or 1.0), 0.0, 1.0)[:, None]
    moved = np.zeros((linear.sizes["vibration"], 2, *points.shape))
    for site, place, weight in zip(part.ends, places, (1.0 - along, along), strict=True):
        if site.frame is not None and not np.any(site.origin):  # its bending included
            moved += linear["frame_translation"].values[:, :, site.frame, None] * weight
        elif site.owner is not None:
            moved += (
                _rigid_displacements(motions, site.owner, place[None], run["position"].values[0, site.owner]) * weight
            )
    return moved


def _bending_piece(run: xr.Dataset, body: Flexible, linear: xr.Dataset, motions: Motions) -> Piece:
    matrix = pose(run, body.index, 0)
    fields = linear_fields(body.bundle) @ matrix[:3, :3].T
    points = points_at_rest(body.bundle) @ matrix[:3, :3].T + matrix[:3, 3]
    shape = linear["modal_shape"].values[:, :, body.columns]
    moved = _rigid_displacements(motions, body.index, points, matrix[:3, 3]) + np.tensordot(shape, fields, axes=1)
    return Piece(skin(body.bundle, points), moved, COLORS[0], 1.0, False)


def frames(drawn: Mechanism, modes: Vibrations, rate: int, progress: Progress = silent) -> Iterator[np.ndarray]:
    """Yield the slowest vibrations in turn, at most SHOWN, pictures of shape (540, 960, 3), so many a second."""
    count = round(SECONDS * rate / PERIODS)
    picture, close = _stage(drawn, modes, SIZE)
    shown = min(len(modes.labels), SHOWN)
    for k in range(shown):
        period = [picture(k, 2.0 * np.pi * n / count) for n in range(count)]
        for _ in range(PERIODS):
            yield from period
        progress((k + 1) / shown, "film")
    close()


def sheet(drawn: Mechanism, modes: Vibrations) -> np.ndarray:
    """Return the vibrations at their largest, in rows of three, slowest first: at most SHOWN of them."""
    picture, close = _stage(drawn, modes, TILE)
    tiles = [picture(k, 0.0) for k in range(min(len(modes.labels), SHOWN))]
    close()
    columns = min(COLUMNS, len(tiles))
    tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % columns)
    return np.concatenate(
        [np.concatenate(tiles[k : k + columns], axis=1) for k in range(0, len(tiles), columns)], axis=0
    )


def _cloud(modes: Vibrations) -> np.ndarray:
    """Return points that represent the drawn extent, at both ends of each shown vibration."""
    clouds = []
    for piece in modes.pieces:
        for k in range(min(len(modes.labels), SHOWN)):
            displacement = modes.scale[k] * piece.moved[k, 0, ::5]
            clouds += [piece.surface.points[::5] + displacement, piece.surface.points[::5] - displacement]
    return np.concatenate(clouds)


def _stage(
    drawn: Mechanism, modes: Vibrations, size: tuple[int, int]
) -> tuple[Callable[[int, float], np.ndarray], Callable[[], None]]:
    """Return a function that draws a vibration at a phase [rad], (height, width, 3), and one that closes the stage.

    Imports pyvista, which ends the process without GL libraries.
    """
    from flexclear.post.render import film

    stage, caption, skins = film.plotter(size), film_speed.Caption((size[0], 26), film.SOFT), []
    for piece in modes.pieces:
        mesh = film.polydata(piece.surface)
        if piece.plain:
            film.solid(stage, piece.surface, piece.color, piece.opacity, mesh)
        else:
            mesh["displacement"] = np.zeros(mesh.n_points)
            stage.add_mesh(mesh, scalars="displacement", cmap="viridis", clim=(0.0, 1.0), show_scalar_bar=False)
        skins.append(mesh)
    film.place_camera(stage, replace(drawn, cloud=_cloud(modes)))

    def picture(vibration: int, phase: float) -> np.ndarray:
        scale, largest = modes.scale[vibration], modes.largest[vibration] or 1.0
        for piece, mesh in zip(modes.pieces, skins, strict=True):
            displacement = np.cos(phase) * piece.moved[vibration, 0] - np.sin(phase) * piece.moved[vibration, 1]
            mesh.points = piece.surface.points + scale * displacement
            if not piece.plain:
                mesh["displacement"] = np.linalg.norm(displacement, axis=1) / largest
        pixels = film.image(stage)
        caption.onto(pixels, f"{modes.labels[vibration]}; amplitude enlarged")
        return pixels

    return picture, stage.close
