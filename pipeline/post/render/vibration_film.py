"""Natural vibrations of an assembled mechanism, moving: one after the other as a film, or all on one sheet."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pyvista as pv

from flexclear.pipeline.core.system.progress import Progress, silent
from flexclear.pipeline.post.render.film import SOFT, image, look, plotter, polydata, solid
from flexclear.pipeline.post.render.mechanism import Mechanism
from flexclear.pipeline.post.render.pace import Caption
from flexclear.pipeline.post.render.vibrations import Vibrations

#: size of a film's pictures and of those on a sheet, and how many are next to each other there
SIZE, TILE, COLUMNS = (960, 540), (480, 360), 3
#: how long one vibration is shown [s], and how many periods it goes through meanwhile
SECONDS, PERIODS = 1.5, 2
#: most vibrations that are shown, the slowest ones
SHOWN = 12


def frames(drawn: Mechanism, modes: Vibrations, rate: int, progress: Progress = silent) -> Iterator[np.ndarray]:
    """The slowest vibrations in turn, at most SHOWN, pictures of shape (540, 960, 3), so many a second."""
    count = round(SECONDS * rate / PERIODS)
    scene = _Scene(drawn, modes, SIZE)
    shown = min(len(modes.labels), SHOWN)
    for k in range(shown):
        period = [scene.picture(k, 2.0 * np.pi * n / count) for n in range(count)]
        for _ in range(PERIODS):
            yield from period
        progress((k + 1) / shown, "film")
    scene.close()


def sheet(drawn: Mechanism, modes: Vibrations) -> np.ndarray:
    """The vibrations at their largest, in rows of three, slowest first: at most SHOWN of them."""
    scene = _Scene(drawn, modes, TILE)
    tiles = [scene.picture(k, 0.0) for k in range(min(len(modes.labels), SHOWN))]
    scene.close()
    columns = min(COLUMNS, len(tiles))
    blank = np.full_like(tiles[0], 255)
    tiles += [blank] * (-len(tiles) % columns)
    return np.concatenate(
        [np.concatenate(tiles[k : k + columns], axis=1) for k in range(0, len(tiles), columns)], axis=0
    )


def _cloud(modes: Vibrations) -> np.ndarray:
    """Points that represent all that is drawn, at both ends of each vibration that is shown."""
    clouds = []
    for piece in modes.pieces:
        for k in range(min(len(modes.labels), SHOWN)):
            way = modes.scale[k] * piece.moved[k, 0, ::5]
            clouds += [piece.surface.points[::5] + way, piece.surface.points[::5] - way]
    return np.concatenate(clouds)


class _Scene:
    """The mechanism on the stage, its skins, and the words below it."""

    def __init__(self, drawn: Mechanism, modes: Vibrations, size: tuple[int, int]) -> None:
        self.modes = modes
        self.stage = plotter(size)
        self.caption = Caption((size[0], 26), SOFT)
        self.skins = [self._skin(k) for k in range(len(modes.pieces))]
        look(self.stage, replace(drawn, cloud=_cloud(modes)))

    def _skin(self, k: int) -> pv.PolyData:
        piece = self.modes.pieces[k]
        mesh = polydata(piece.surface)
        if piece.plain:
            solid(self.stage, piece.surface, piece.color, piece.opacity, mesh)
            return mesh
        mesh["displacement"] = np.zeros(mesh.n_points)
        self.stage.add_mesh(mesh, scalars="displacement", cmap="viridis", clim=(0.0, 1.0), show_scalar_bar=False)
        return mesh

    def picture(self, vibration: int, phase: float) -> np.ndarray:
        """One vibration at a phase [rad], shape (height, width, 3)."""
        scale, largest = self.modes.scale[vibration], self.modes.largest[vibration] or 1.0
        for piece, mesh in zip(self.modes.pieces, self.skins, strict=True):
            way = np.cos(phase) * piece.moved[vibration, 0] - np.sin(phase) * piece.moved[vibration, 1]
            mesh.points = piece.surface.points + scale * way
            if not piece.plain:
                mesh["displacement"] = np.linalg.norm(way, axis=1) / largest
        picture = image(self.stage)
        self.caption.onto(picture, f"{self.modes.labels[vibration]}; drawn larger than it is")
        return picture

    def close(self) -> None:
        """Give back what the graphics library holds."""
        self.stage.close()
