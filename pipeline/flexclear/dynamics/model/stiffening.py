"""Table of the stations of rods, at which twist turns the axes of bending."""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.model.filling import Filling


def fill(filling: Filling) -> dict[str, Any]:
    """Tabulate the stations of each rod with stiffening."""
    links, bodies = filling.numbering.mechanism.links, filling.numbering.mechanism.scene.flexible()
    rows, stiffness, data = list[Any](), list[Any](), list[Any]()
    for k, i in enumerate(filling.numbering.flexible):
        name, bundle = links[i].flexible, links[i].bundle
        if name is None or bundle is None or bodies[name].stiffening is None or "station_stiffness" not in bundle:
            continue
        parts = (bundle[f"station_{part}"].values for part in ("rotation", "curvature", "stiffness"))
        for rotation, curvature, matrix in zip(*parts, strict=True):
            rows.append((k, len(data)))
            stiffness.append(matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
            data += [*rotation.ravel(), *curvature.ravel()]
    return {"stations": rows, "station_stiffness": stiffness, "station_data": data}
