"""Tables of the flexible bodies, from their bundles."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from pipeline.core.errors import InputError
from pipeline.core.scene.parts import FlexibleBody, RatioPerMode, Rayleigh
from pipeline.dynamics import memory as m
from pipeline.dynamics.model.mechanism import Mechanism
from pipeline.dynamics.model.numbering import Numbering

#: a shape or moment below this share of the largest of its kind is rounding, not coupling
NEGLIGIBLE = 1e-13


def fill(numbering: Numbering) -> dict[Any, Any]:
    """The tables FLEXES, MOMENTS, PORTS and FLEX_NUMBERS .. PORT_DATA of the flexible bodies."""
    flex, flex_real, data, index, value = [], [], [], [], []
    data0 = moment0 = 0
    any_shortened = any(b.stiffening is not None for b in numbering.mechanism.scene.flexible().values())
    order = sorted(numbering.modes)
    for i in order:
        link = numbering.mechanism.links[i]
        body = numbering.mechanism.scene.body[str(link.flexible)]
        assert isinstance(body, FlexibleBody)
        bundle = numbering.mechanism.bundles[str(link.flexible)]
        n = numbering.modes[i]
        moments, where = _moments(bundle)
        chunk = _data(bundle, _damping(str(link.flexible), body, bundle))
        if any_shortened:
            chunk = np.concatenate([chunk, *_forms(numbering.mechanism, str(link.flexible), n)])
        moves = int(_inboard_moves(numbering, i, bundle))
        flex.append((i, n, numbering.flex_q0[i], numbering.flex_c0[i], data0, moment0, len(moments), moves))
        flex_real.append(
            [float(bundle["mass"]), *bundle["first_moment"].values, *bundle["second_moment"].values.ravel()]
        )
        data.append(chunk)
        value.append(moments)
        index.append(where)
        data0 += len(chunk)
        moment0 += len(moments)
    port, port_real, port_data = _ports(numbering, order, any_shortened)
    return {
        m.FLEXES: flex,
        m.MOMENTS: np.concatenate([*index, np.zeros((0, 2), dtype=np.int64)]),
        m.PORTS: port,
        m.FLEX_NUMBERS: flex_real,
        m.FLEX_DATA: np.concatenate([*data, np.zeros(0)]),
        m.MOMENT_VALUES: np.concatenate([*value, np.zeros(0)]),
        m.PORT_NUMBERS: port_real,
        m.PORT_DATA: port_data,
    }


def bow(mechanism: Mechanism, body: str, frame: str | None = None) -> np.ndarray | None:
    """Shortening of a bent body per pair of modes at a frame [1/(kg m)], or its first moment [1/m]; shape (mode, mode).

    None where the scene does not ask for it.
    """
    part = mechanism.scene.body[body]
    if not isinstance(part, FlexibleBody) or part.stiffening is None:
        return None
    bundle = mechanism.bundles[body]
    if "frame_shortening" not in bundle:
        raise InputError(
            f"[body.{body}.stiffening]",
            "the bundle of its mesh says nothing about the shortening of a bent body",
            "stiffening is for beams; remove it",
        )
    if frame is None:
        return bundle["shortening_first_moment"].values
    return bundle["frame_shortening"].sel(frame=frame).values


def _damping(name: str, body: FlexibleBody, bundle: xr.Dataset) -> np.ndarray:
    """Damping 2 zeta omega of every mode [1/s]; InputError when ratios and modes differ in number."""
    square = np.diag(bundle["modal_stiffness"].values)
    given = body.damping
    if isinstance(given, Rayleigh):
        return given.alpha + given.beta * square
    if isinstance(given, RatioPerMode) and len(given.ratios) != len(square):
        raise InputError(
            f"[body.{name}.damping.ratios]",
            f"{len(given.ratios)} damping ratios are given for {len(square)} modes",
            "give one ratio per mode",
        )
    ratios = given.ratios if isinstance(given, RatioPerMode) else given or 0.0
    return 2.0 * np.asarray(ratios) * np.sqrt(square)


def _forms(mechanism: Mechanism, body: str, n: int) -> list[np.ndarray]:
    """Int rho B and int rho x B (n n each) of a body, zeros where it does not ask for stiffening."""
    first = bow(mechanism, body)
    second = None if first is None else mechanism.bundles[body]["shortening_second_moment"].values
    return [np.zeros(n * n) if form is None else form.ravel() for form in (first, second)]


def _data(bundle: xr.Dataset, damping: np.ndarray) -> np.ndarray:
    """C1 (3n), E (9n), modal mass (n n), stiffness omega^2 (n), damping 2 zeta omega (n).

    The coordinates of a bundle are mass-normalised eigenmodes of its reduced matrices.
    """
    stiffness = np.diag(bundle["modal_stiffness"].values)
    chunks = [
        bundle["modal_first_moment"].values,
        bundle["position_mode_moment"].values,
        bundle["modal_mass"].values,
        stiffness,
        damping,
    ]
    return np.concatenate([c.ravel() for c in chunks])


def _moments(bundle: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Nonzero int rho S_ki S_lj as values and (row (3k + l) n + j, i)."""
    F = bundle["mode_mode_moment"].values
    n = F.shape[-1]
    k, l, i, j = np.nonzero(np.abs(F) > NEGLIGIBLE * max(np.abs(F).max(), 1e-300))
    row = (3 * k + l) * n + j
    order = np.lexsort((i, row))
    where = np.stack([row[order], i[order]], axis=1).astype(np.int64)
    return F[k, l, i, j][order], where


def _frame_shapes(bundle: xr.Dataset, frame: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Undeformed pose row (12), translation and rotation shapes (3, n) of a named frame."""
    k = list(bundle["frame"].values).index(frame)
    pose = np.concatenate([bundle["frame_position"].values[k], bundle["frame_rotation"].values[k].ravel()])
    shapes = [bundle[name].values[k].copy() for name in ("frame_translation_shape", "frame_rotation_shape")]
    for name, shape in zip(("frame_translation_shape", "frame_rotation_shape"), shapes, strict=True):
        # what the reference condition holds still is exactly still
        scale = np.abs(bundle[name].values).max()
        shape[np.abs(shape) <= NEGLIGIBLE * 1e3 * scale] = 0.0
    return pose, shapes[0], shapes[1]


def _inboard_frame(numbering: Numbering, i: int) -> str | None:
    """Name of the frame by which a flexible link hangs in the tree; None for a free body."""
    branch = numbering.mechanism.links[i].branch
    if branch.edge is None:
        return None
    name = branch.edge.frame_a if branch.reverse else branch.edge.frame_b
    return name.partition(".")[2]


def _inboard_moves(numbering: Numbering, i: int, bundle: xr.Dataset) -> bool:
    frame = _inboard_frame(numbering, i)
    if frame is None:
        return False
    _, translation, rotation = _frame_shapes(bundle, frame)
    drawn = bow(numbering.mechanism, str(numbering.mechanism.links[i].flexible), frame)
    return bool(np.any(translation) or np.any(rotation) or (drawn is not None and np.any(drawn)))


def _ports(numbering: Numbering, order: list[int], shortened: bool) -> tuple[list[Any], list[Any], np.ndarray]:
    """Ports of sites first, then one inboard port per flexible link (Layout.port_of_inboard)."""
    rows, reals, data, start = [], [], [], 0

    def add(link: int, frame: str | None, column: int) -> None:
        nonlocal start
        bundle = numbering.mechanism.bundles[str(numbering.mechanism.links[link].flexible)]
        n = numbering.modes[link]
        if frame is None:
            pose, shapes = np.concatenate([np.zeros(3), np.eye(3).ravel()]), [np.zeros(3 * n)] * 2
        else:
            pose, *found = _frame_shapes(bundle, frame)
            shapes = [s.ravel() for s in found]
        if shortened:
            drawn = (
                None
                if frame is None
                else bow(numbering.mechanism, str(numbering.mechanism.links[link].flexible), frame)
            )
            shapes.append(np.zeros(n * n) if drawn is None else drawn.ravel())
        rows.append((order.index(link), column, start))
        reals.append(pose)
        data.extend(shapes)
        start += sum(len(s) for s in shapes)

    for site, frame, column in numbering.ports:
        add(numbering.sites[site].link, frame.partition(".")[2], column)
    for i in order:
        add(i, _inboard_frame(numbering, i), -1)
    return rows, reals, np.concatenate([*data, np.zeros(0)])
