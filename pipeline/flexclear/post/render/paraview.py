"""A run as a series for ParaView: skins of all bodies, and the forces of joints, contacts and loads as arrows.

Two files for each output, as VTK XML written here: pyvista's writer takes a second and a half longer, and GL libraries;
meshio's, which compresses, takes seventeen times as long. Surfaces carry the number of their body and the computed
displacement; arrows are surfaces, too, with the force as `force` [N].
"""

from __future__ import annotations

import base64
from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

import numpy as np
import xarray as xr

from flexclear.post.body_shape import surface
from flexclear.post.render import surfaces
from flexclear.post.render.layout import part_pose
from flexclear.post.render.mechanism import Mechanism, drawn_points, skin
from flexclear.post.render.surfaces import Surface
from flexclear.post.single_run.series import parameters

#: longest arrow, and thickness of arrows, as fractions of the mechanism's size
LONGEST, THICK = 0.3, 0.006


def series(drawn: Mechanism, steps: np.ndarray, name: str = "motion") -> dict[str, bytes]:
    """Return ``motion.pvd`` and the files that it names, by name."""
    files: dict[str, bytes] = {}
    entries = []
    largest = max((float(np.linalg.norm(f, axis=-1).max(initial=0.0)) for _, _, f in _forces(drawn.run)), default=0.0)
    for k, step in enumerate(steps):
        time = float(drawn.run["time"].values[step])
        bodies, arrows = f"{name}_{k:04d}.vtp", f"{name}_forces_{k:04d}.vtp"
        files[bodies] = _bodies(drawn, int(step))
        entries.append((time, 0, "bodies", bodies))
        if largest > 0.0:
            files[arrows] = _arrows(drawn, int(step), largest)
            entries.append((time, 1, "forces", arrows))
    files[f"{name}.pvd"] = collection(
        [
            f'<DataSet timestep="{time!r}" part="{part}" name="{group}" file={quoteattr(file)}/>'
            for time, part, group, file in entries
        ]
    )
    return files


def modes(name: str, bundle: xr.Dataset, scale: np.ndarray) -> dict[str, bytes]:
    """Return ``<name>.pvd``, a series with the number of the mode for time, and the files that it names."""
    files, lines = {}, []
    rest, _ = surface(bundle, np.zeros(bundle.sizes["mode"]))
    for k, frequency in enumerate(bundle["frequency"].values):
        q = scale[k] * np.eye(bundle.sizes["mode"])[k]
        points, _ = surface(bundle, q)
        file = f"{name}_{k + 1:03d}.vtp"
        data = {"displacement": points - rest, "frequency_Hz": np.full(len(points), float(frequency))}
        files[file] = vtp(skin(bundle, points), data)
        lines.append(f'<DataSet timestep="{k + 1}" part="0" name="mode" file={quoteattr(file)}/>')
    return files | {f"{name}.pvd": collection(lines)}


def collection(lines: list[str]) -> bytes:
    """Return a ParaView collection of data sets."""
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">\n<Collection>\n'
    return (head + "\n".join(lines) + "\n</Collection>\n</VTKFile>\n").encode()


def _bodies(drawn: Mechanism, step: int) -> bytes:
    shapes, numbers, moved = [], [], []
    for part in drawn.parts:
        matrix = part_pose(drawn.run, part, step)
        shapes.append(surfaces.place(part.surface, matrix[:3, 3], matrix[:3, :3]))
        numbers.append(np.full(len(part.surface.points), -1 if part.owner is None else part.owner))
        moved.append(np.zeros(len(part.surface.points)))
    for body in drawn.flexible:
        points, size = drawn_points(drawn.run, body, step)
        shapes.append(skin(body.bundle, points))
        numbers.append(np.full(len(points), body.index))
        moved.append(size)
    return vtp(surfaces.join(shapes), {"body": np.concatenate(numbers), "displacement": np.concatenate(moved)})


def _arrows(drawn: Mechanism, step: int, largest: float) -> bytes:
    shapes, forces = [], []
    for _, points, force in _forces(drawn.run):
        for point, value in zip(points[step], force[step], strict=True):
            length = LONGEST * drawn.size * float(np.linalg.norm(value)) / largest
            if length > 0.01 * LONGEST * drawn.size:
                shapes.append(arrow(point, value / np.linalg.norm(value) * length, THICK * drawn.size))
                forces.append(np.tile(value, (len(shapes[-1].points), 1)))
    return vtp(surfaces.join(shapes), {"force": np.concatenate(forces) if forces else np.empty((0, 3))})


def arrow(point: np.ndarray, vector: np.ndarray, thick: float) -> Surface:
    """Return an arrow that begins at a point, as long and directed as `vector`."""
    length = float(np.linalg.norm(vector))
    head = min(6.0 * thick, 0.4 * length)
    neck = point + (1.0 - head / length) * vector
    return surfaces.join([surfaces.bar(point, neck, thick), surfaces.cone(neck, point + vector, 2.4 * thick)])


def _forces(run: xr.Dataset) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield forces on bodies with their points of action: kind, (time, n, 3) [m], (time, n, 3) [N], world axes."""
    given, frames = (
        parameters(run),
        {str(name): k for k, name in enumerate(run["frame"].values)} if "frame" in run.coords else {},
    )
    for family, variable, dim in (("joint", "joint_force", "joint"), ("load", "load_force", "load")):
        if variable not in run:
            continue
        points, forces = [], []
        for k, name in enumerate(str(n) for n in run[dim].values):
            part = given.get(family, {}).get(name, {})
            frame = part["between"][1] if "between" in part else part.get("frame")
            if frame in frames:
                points.append(run["frame_position"].values[:, frames[frame]])
                forces.append(k)
        if forces:
            yield family, np.stack(points, axis=1), run[variable].values[:, forces]


def vtp(shape: Surface, data: dict[str, np.ndarray]) -> bytes:
    """Return a surface with data of its points as VTK polygonal data, in XML with base64."""
    polygons = shape.triangles
    arrays = "".join(_array(name, values) for name, values in data.items())
    return (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
        f'<PolyData><Piece NumberOfPoints="{len(shape.points)}" NumberOfPolys="{len(polygons)}" NumberOfVerts="0" '
        'NumberOfLines="0" NumberOfStrips="0">\n'
        f"<PointData>{_array('Normals', shape.normals)}{arrays}</PointData>\n"
        f"<Points>{_array('Points', shape.points)}</Points>\n"
        f"<Polys>{_array('connectivity', polygons.ravel())}"
        f"{_array('offsets', 3 * np.arange(1, len(polygons) + 1))}</Polys>\n"
        "</Piece></PolyData>\n</VTKFile>\n"
    ).encode()


def _array(name: str, values: np.ndarray) -> str:
    whole = values.dtype.kind in "iu"
    data = np.ascontiguousarray(values, dtype="<i4" if whole else "<f4")
    components = f' NumberOfComponents="{data.shape[1]}"' if data.ndim == 2 else ""
    content = base64.b64encode(np.uint64(data.nbytes).tobytes() + data.tobytes()).decode()
    kind = "Int32" if whole else "Float32"
    return f'<DataArray type="{kind}" Name="{name}"{components} format="binary">{content}</DataArray>\n'
