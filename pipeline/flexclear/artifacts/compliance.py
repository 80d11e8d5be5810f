r"""What a bundle alone says of its body: static compliance at its frames, and deficits in words.

The simulate stage calls `warnings` with the frames at which joints and drives act on the body.

With frame j held and a force at frame i, rigid motion follows j. With the motion :math:`S_i` of the frames per modal
coordinate and the rigid transport :math:`R_i R_j^{-1}`,

.. math:: \Delta_{ij} = S_i - R_i R_j^{-1} S_j, \qquad C_{ij} = \Delta_{ij} K^{-1} \Delta_{ij}^T .

With nothing held (i = j) the inertia forces of the free body balance the load: :math:`\Delta_{ii} = S_i - R_i
(R^T M R)^{-1} R^T M \Phi`. By the principle of minimum energy no reduced compliance exceeds the full model's.
Source: Craig & Kurdila, *Fundamentals of Structural Dynamics* (2006), ch. 17 (inertia relief).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from flexclear.numerics.rotations import skew

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.labelled import Labelled

#: directions of a frame's motion, in its own axes
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def frame_compliance(motion: np.ndarray, rigid: np.ndarray, relief: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Return the compliance [m/N, rad/(N m)] of each frame with each held: diagonals, shape (p, p, 6).

    motion: of p frames per modal coordinate, axes of the frame, shape (p, 6, n). rigid: of the frames per rigid motion
    of the body, shape (p, 6, 6). relief: rigid motion in each shape, (R^T M R)^-1 R^T M Phi, shape (6, n). stiffness:
    modal, shape (n, n).
    """
    p = len(motion)
    result = np.empty((p, p, 6))
    for i in range(p):
        for j in range(p):
            rigid_motion = relief if i == j else np.linalg.solve(rigid[j], motion[j])
            deformation = motion[i] - rigid[i] @ rigid_motion
            result[i, j] = np.einsum("dn,nd->d", deformation, np.linalg.solve(stiffness, deformation.T))
    return result


def fractions(of_modes: np.ndarray, full: np.ndarray) -> np.ndarray:
    """Return the modes' compliance over that of the full model; 1 where the latter is negligible."""
    negligible = full <= 1e-9 * full.max(axis=(0, 1), keepdims=True)
    return np.where(negligible, 1.0, of_modes / np.where(negligible, 1.0, full))


def of_bundle(bundle: xr.Dataset) -> np.ndarray:
    """Return the compliances of a bundle's frames as `frame_compliance` does, shape (frame, frame, 6)."""
    R_BF = bundle["frame_rotation"].values
    shapes = [np.swapaxes(R_BF, 1, 2) @ bundle[f"frame_{name}_shape"].values for name in ("translation", "rotation")]
    motion = np.concatenate(shapes, axis=1)
    arms = -skew(bundle["frame_position"].values)
    eye = np.broadcast_to(np.eye(3), arms.shape)
    rigid = np.block([[eye, arms], [np.zeros_like(arms), eye]])
    axes = np.zeros_like(rigid)
    axes[:, :3, :3] = axes[:, 3:, 3:] = np.swapaxes(R_BF, 1, 2)
    return frame_compliance(motion, axes @ rigid, _rigid_motions(bundle), bundle["modal_stiffness"].values)


def _rigid_motions(bundle: xr.Dataset) -> np.ndarray:
    """Return the rigid motion in each shape, about the origin of the body frame, shape (6, n)."""
    mass, first, second = (bundle[name].values for name in ("mass", "first_moment", "second_moment"))
    inertia = np.trace(second) * np.eye(3) - second
    arm = skew(first)
    moment = bundle["position_mode_moment"].values
    spin = np.stack([moment[1, 2] - moment[2, 1], moment[2, 0] - moment[0, 2], moment[0, 1] - moment[1, 0]])
    momentum = np.vstack([bundle["modal_first_moment"].values, spin])
    return np.linalg.solve(np.block([[mass * np.eye(3), -arm], [arm, inertia]]), momentum)


#: reference conditions whose shapes represent static loads at the interfaces exactly
STATIC = ("craig-bampton", "craig-chang", "residual-flexibility")
#: motions of frames in the shapes below this fraction of the largest are rounding
VANISHING = 1e-9
WIDTH = 9


def table(bundle: xr.Dataset) -> str:
    """Return the deficits of a bundle (schema BUNDLE) as lines of text."""
    a = bundle.attrs
    resolved = float(a["resolved_frequency"])
    first = float(a["first_free_frequency"])
    lines = [
        f"{a['title'] or 'flexible body'}: {a['reference']}, {a['count']} coordinates",
        f"  rigid motion: {a['rigid_motion']}",
        f"  frequencies of the free body within 1 %: up to {resolved:.6g} Hz"
        if resolved
        else f"  frequencies of the free body within 1 %: none; the first is at {first:.6g} Hz",
        *_lines_on_matrices(bundle),
        "  static compliance, per cent of the full model, axes of the frame",
        _compliance_row("frame", "held", bundle["direction"].values.tolist()),
    ]
    names = [str(name) for name in bundle["frame"].values]
    for name in names:
        for held in [other for other in names if other != name] + [name]:
            fraction = bundle["compliance_share"].sel(frame=name, frame_held=held).values
            shown = [_percent(value) for value in fraction]
            lines.append(_compliance_row(name, "nothing" if held == name else held, shown))
    lines += ["  largest error of a frame's motion under a unit load on it, m/N and rad/(N m)"]
    lines.append(_compliance_row("frame", "load, Hz", bundle["direction"].values.tolist()))
    for name in names:
        for hertz in bundle["bound_frequency"].values:
            bound = bundle["error_bound"].sel(frame=name, bound_frequency=hertz).values
            lines.append(_compliance_row(name, f"{hertz:.5g}", [f"{value:.2e}" for value in bound]))
    total = bundle["effective_mass"].sum("mode").values
    lines += ["  effective mass of all modes, kg and kg m2"]
    lines.append(_compliance_row("", "", [f"{value:.3g}" for value in total]))
    return "\n".join(line.rstrip() for line in lines)


def _lines_on_matrices(bundle: xr.Dataset) -> list[str]:
    """Return lines on the matrices of a body from another program, with its frequencies next to the program's."""
    if "imported" not in bundle.attrs:
        return []
    lines = [f"  {line}" for line in bundle.attrs["imported"].split("\n")]
    for name, words in (("free_frequency", "of the free body"), ("listed_frequency", "in the listing")):
        if name in bundle:
            lines.append(f"  frequencies {words}, Hz: " + " ".join(f"{value:.7g}" for value in bundle[name].values))
    return lines


def _compliance_row(frame: str, held: str, values: Sequence[object]) -> str:
    return f"  {frame:<14} {held:<10}" + "".join(f"{value!s:>{WIDTH + 1}}" for value in values)


def warnings(bundle: Labelled, frames_used: Sequence[str], body: str = "the body") -> list[str]:
    """Return sentences about static compliance that the modes lack between the frames at which forces act.

    frames_used: named frames of the bundle. A single frame is judged with nothing held, except the only one at which
    the body is clamped: there all shapes vanish, and its support bends nothing.
    """
    used, names = list(dict.fromkeys(frames_used)), [str(name) for name in bundle["frame"].values]
    pairs = [(i, j) for k, i in enumerate(used) for j in used[k + 1 :]]
    if len(used) == 1 and used != _unmoved_frames(bundle):
        pairs = [(used[0], used[0])]
    messages = []
    directions = bundle["direction"].values
    for name, held in pairs:
        i, j = names.index(name), names.index(held)
        fraction = np.minimum(bundle["compliance_share"].values[i, j], bundle["compliance_share"].values[j, i])
        # 0.9: fraction of the static compliance below which a warning is given
        low = fraction < 0.9
        if not low.any():
            continue
        where = f"of '{name}'" if name == held else f"between '{held}' and '{name}'"
        amounts = ", ".join(f"{d} {_percent(v)} %" for d, v in zip(directions[low], fraction[low], strict=True))
        messages.append(
            f"{body}: its {bundle.attrs['reference']} modes have too little of the static compliance {where} "
            f"({amounts} of the full model's): the body is too stiff at joints of these frames. {_remedy(bundle, used)}"
        )
    return messages


def _unmoved_frames(bundle: Labelled) -> list[str]:
    """Return the frames at which all shapes vanish."""
    moved = [np.abs(bundle[f"frame_{name}_shape"].values).max(axis=(1, 2)) for name in ("translation", "rotation")]
    still = np.all([size <= VANISHING * size.max() for size in moved], axis=0)
    return [str(name) for name in bundle["frame"].values[still]]


def _remedy(bundle: Labelled, used: Sequence[str]) -> str:
    """Return the remedy for missing compliance: static shapes, static shapes of all frames used, or more modes."""
    if bundle.attrs["reference"] not in STATIC:
        return f'Add static shapes: modes = {{ reference = "craig-bampton", interfaces = {_toml_list(used)}, ... }}'
    had = str(bundle.attrs.get("interfaces", "")).split()
    without = [name for name in used if name not in had]
    if without:
        return (
            f"The body has no static shapes for {_toml_list(without)}; name all the frames used: "
            f"modes = {{ interfaces = {_toml_list(used)}, ... }}"
        )
    return f"The body has static shapes; retain more normal modes than now (count = {bundle.attrs['count']})"


def _percent(fraction: float) -> str:
    """Return a fraction in per cent with three digits; fractions of the size of rounding errors are 0."""
    return f"{100.0 * fraction:.3g}" if fraction > 1e-9 else "0"


def _toml_list(names: Sequence[str]) -> str:
    return "[" + ", ".join(f'"{name}"' for name in names) + "]"
