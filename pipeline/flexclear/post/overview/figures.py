"""General figures of one run: motion of its bodies, reactions, contacts, energies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from flexclear.artifacts import quantities
from flexclear.artifacts.schema import require_complete
from flexclear.post.overview.curves import (
    NOISE,
    by_unit,
    curves,
    impacts_text,
    in_unit,
    rotation_of_body,
    rounding_range,
    without_noise,
)
from flexclear.post.plotting import style
from flexclear.post.single_run.series import derive, parameters
from flexclear.scene.loose_joints import SURFACES
from flexclear.scene.quantity import OF_CONTACTS, Quantity

#: kinds of quantities that other figures show
ELSEWHERE = ("position", "orientation", "velocity", "force", "drive_force", *OF_CONTACTS)
#: most bodies, joints and contacts that are drawn: watched ones first, then those with the largest values
BODIES, JOINTS, CONTACTS = 6, 8, 4
AXES_COLORS = {"x": "#D55E00", "y": "#009E73", "z": "#0072B2"}
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#111111", "#7d6b91")
#: energies of a run, and their labels
ENERGIES = {
    "kinetic": "kinetic",
    "potential": "potential",
    "elastic": "elastic",
    "dissipated": "dissipated",
    "drive_work": "work of drives",
    "load_work": "work of loads",
}
#: an energy below this fraction of the largest one is not drawn
UNSEEN = 1e-6


def make(run: xr.Dataset, watched: Sequence[Quantity] = (), post: xr.Dataset | None = None) -> dict[str, bytes]:
    """Return PNG and SVG of the figures that this run has, by file name: motion, reactions, contacts, energy.

    run: schema RUN.  watched: quantities whose owners are drawn first.  post: schema POST, derived here when None.
    """
    require_complete(run)
    post = derive(run) if post is None else post
    first = [term.owner for quantity in watched for term in quantity.terms()]
    with style.set_style():
        panels = _motion(run, post, first) | _energy(run) | _watched_figures(run, watched)
        if post.sizes["joint"]:
            panels |= _reactions(run, post, first)
        if "contact" in run.sizes:
            panels |= contacts(run, post, first)
        if "wear_volume" in post:
            panels |= _wear(run, post)
        if "joint_bearing_load" in run:
            panels |= _friction(run, first)
    return panels


def _drawn_indices(names: Sequence[str], first: Sequence[str], size: np.ndarray, most: int) -> list[int]:
    """Return indices of the drawn items: the watched ones, then those with the largest `size`."""
    order = sorted(range(len(names)), key=lambda k: (names[k] not in first, -size[k]))
    return order[:most]


def _shown_count_text(count: int, most: int) -> str:
    return f"; {most} of {count} are shown" if count > most else ""


#: a panel over time: title, and by label its lines, each with values over time and line properties
Panel = tuple[str, Mapping[str, tuple[np.ndarray, dict[str, Any]]]]


def _sheet(
    name: str,
    time: np.ndarray,
    panels: Sequence[Panel],
    columns: int,
    heading: tuple[str, str],
    height: float = 1.8,
    width: float = 11.0,
    legend: int = 0,
    **options: Any,
) -> dict[str, bytes]:
    """Draw ``name.png`` and ``.svg`` of panels over time [s], row by row.

    heading: title and subtitle.  height: of a row (inches).  legend: columns of the one legend.
    """
    figure, axes = style.panels(len(panels), columns, width, 0.9, height, sharex=True, **options)
    for panel, (title, lines) in zip(axes, panels, strict=True):
        for label, (values, look) in lines.items():
            panel.plot(1e3 * time, values, label=label, **look)
        panel.set(title=title, xlim=(1e3 * time[0], 1e3 * time[-1]))
        style.mark_only_zero(panel)
    for panel in figure.axes[-columns:]:
        panel.set_xlabel("time (ms)")
    if legend:
        style.shared_legend(figure, axes[0], legend)
    style.heading(figure, *heading)
    return style.files(name, figure)


def _motion(run: xr.Dataset, post: xr.Dataset, first: Sequence[str]) -> dict[str, bytes]:
    names = [str(name) for name in run["body"].values]
    moved, speed = post["displacement"].values, run["velocity"].values
    chosen = _drawn_indices(names, first, np.abs(moved).max(axis=(0, 2)), BODIES)
    panels: list[Panel] = []
    for what, values, unit, width in (("displacement", moved, "m", 1.3), ("velocity", speed, "m/s", 0.9)):
        shown = _without_noise(run, values, unit)
        for k in chosen:
            factor, written = by_unit({"": shown[:, k]}, unit)
            lines = {
                axis: (factor * shown[:, k, i], {"color": color, "lw": width})
                for i, (axis, color) in enumerate(AXES_COLORS.items())
            }
            panels.append((f"{names[k]}: {what} ({written})", lines))
    for k in chosen:
        turned = rotation_of_body(run, names[k])
        angle = np.degrees(without_noise(turned.angle, NOISE))
        panels.append((f"{names[k]}: {turned.title} (°)", {"": (angle, {"color": style.INK})}))
    by_body = [panels[k + n * len(chosen)] for k in range(len(chosen)) for n in range(3)]
    heading = (f"Motion of the bodies{_shown_count_text(len(names), BODIES)}", "centre of mass, axes of the world")
    return _sheet("motion", run["time"].values, by_body, 3, heading, 1.75, legend=3)


def _watched_figures(run: xr.Dataset, watched: Sequence[Quantity]) -> dict[str, bytes]:
    """Draw watched quantities that no other figure shows."""
    panels = _curves(run, [one for one in watched if one.component or one.kind not in ELSEWHERE])
    heading = ("Watched quantities", "vectors: the magnitude, or the component in the name")
    return _sheet("watched", run["time"].values, panels, 1, heading, width=8.0) if panels else {}


def watched_curves(run: xr.Dataset, watched: Sequence[Quantity], width: float = 8.0) -> bytes | None:
    """Return PNG of quantities over time, one below the other; width [inches]; None where none has a curve."""
    panels = _curves(run, watched)
    with style.set_style():
        return _sheet("", run["time"].values, panels, 1, ("", ""), width=width)[".png"] if panels else None


def _curves(run: xr.Dataset, watched: Sequence[Quantity]) -> list[Panel]:
    panels: list[Panel] = []
    for line in (line for quantity in watched for line in curves([run], quantity) if line is not None):
        factor, unit = by_unit({"": line.values}, line.unit)
        panels.append((f"{line.title} ({unit})", {"": (factor * line.values, {"lw": 0.9})}))
    return panels


def _without_noise(run: xr.Dataset, values: np.ndarray, unit: str) -> np.ndarray:
    """Return values (time, ...) with those columns constant that are rounding."""
    most = rounding_range(run, values, unit)
    series = [without_noise(column, most) for column in values.reshape(len(values), -1).T]
    return np.array(series).T.reshape(values.shape)


def _reactions(run: xr.Dataset, post: xr.Dataset, first: Sequence[str]) -> dict[str, bytes]:
    names = [str(name) for name in post["joint"].values]
    force = _without_noise(run, post["reaction"].values, "N")
    drives = [str(name) for name in run["drive"].values] if "drive_force" in run else []
    chosen = _drawn_indices(names, first, force.max(axis=0), JOINTS)
    loaded = [k for k in chosen if force[:, k].any()]
    panels: list[Panel] = [
        (f"{names[k]}: force (N)", {"": (force[:, k], {"color": "#0072B2", "lw": 0.9})}) for k in loaded
    ]
    for k, name in enumerate(drives):
        title = f"{name}: drive ({quantities.unit(run, Quantity(name, 'drive_force'))})"
        panels.append((title, {"": (run["drive_force"].values[:, k], {"color": "#D55E00", "lw": 0.9})}))
    unloaded = [names[k] for k in chosen if k not in loaded]
    below = "; no force: ".join(["magnitude of the joint force", *filter(None, [", ".join(unloaded)])])
    heading = f"Reactions and drives{_shown_count_text(len(names), JOINTS)}", below
    return _sheet("reactions", run["time"].values, panels, 2, heading) if panels else {}


def contacts(run: xr.Dataset, post: xr.Dataset, first: Sequence[str]) -> dict[str, bytes]:
    """Draw orbit, gap and force of each joint with clearance, those in `first` first; call it in `style.set_style`."""
    names, joints = [str(name) for name in run["contact"].values], parameters(run).get("joint", {})
    chosen = _drawn_indices(names, first, post["peak_force"].values, CONTACTS)
    figure, axes = style.grid(len(chosen), 3, (11.0, 0.7 + 3.2 * len(chosen)), width_ratios=[1.0, 1.2, 1.2])
    for place, (row, k) in enumerate(zip(axes, chosen, strict=True)):
        unit = quantities.unit(run, Quantity(names[k], "peak_force"))
        gaps = run["contact_gap"].values[:, k]
        factor, small = by_unit({"": gaps}, "m" if unit == "N" else "rad")
        gap = f"gap ({small})"
        if names[k] in joints:
            orbit(row[0], run, float(post["clearance"].values[k]), k)
            row[0].set_title(f"{names[k]}\n{centre(run, k)}")  # a line of its own, since names may be long
        else:  # the end of a stop
            gap = f"{names[k]}\n{gap}"
            row[0].remove()
            row[1].set_subplotspec(row[1].get_gridspec()[place, :2])
        _over_time(row[1], run, factor * gaps, gap)
        row[1].axhline(0.0, color=style.SOFT, lw=0.8)
        fraction = float(post["contact_time_share"].values[k])
        count = impacts_text(int(post["impact_count"].values[k]), fraction)
        peak = float(post["peak_force"].values[k])
        pushes = "normal force" if unit == "N" else "torque"
        _over_time(row[2], run, run["contact_normal_force"].values[:, k])
        for curve in filter(None, curves([run], Quantity(names[k], "peak_force"))):  # shorter than the outputs show
            row[2].vlines(1e3 * curve.peaks[:, 0], 0.0, curve.peaks[:, 1], color="#D55E00", lw=0.6)
            row[2].plot(1e3 * curve.peaks[:, 0], curve.peaks[:, 1], ".", color="#D55E00", ms=3)
        row[2].set_title(f"{pushes} ({unit})", pad=16)
        # a separate line: next to the title it would be cut off
        closed = "" if "hardly" in count else f", {fraction:.0%} of the time in contact"
        text = f"{count}, peak {in_unit(peak, unit)}{closed}"
        row[2].text(0.0, 1.015, text, transform=row[2].transAxes, fontsize=7.6, color=style.SOFT, va="bottom")
    kinds = dict.fromkeys("joints with clearance" if names[k].partition(".")[0] in joints else "stops" for k in chosen)
    style.heading(figure, f"{' and '.join(kinds).capitalize()}{_shown_count_text(len(names), CONTACTS)}")
    return style.files("contacts", figure)


def _over_time(axes: Axes, run: xr.Dataset, values: np.ndarray, title: str = "") -> None:
    time = 1e3 * run["time"].values
    axes.plot(time, values, color="#D55E00", lw=0.8)
    axes.set(xlim=(time[0], time[-1]), xlabel="time (ms)", title=title)
    style.mark_only_zero(axes)


def orbit(axes: Axes, run: xr.Dataset, clearance: float, contact: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw the ball's (or pin's) centre in its socket, and return its two coordinates [mm].

    The plane is the joint's own: for a pin or a slot x and y of the journal, for a plane x and z; for a ball the two
    axes of the socket along which the centre moves most.
    """
    offset = 1e3 * _without_noise(run, run["contact_offset"].values[:, contact], "m")
    moving = sorted(int(k) for k in np.argsort(np.ptp(offset, axis=0))[-2:])
    kind = _kind(run, contact)
    i, j = kind.plane or moving
    radius = 1e3 * clearance
    if not kind.hollow:  # it has a floor and no socket
        joint = parameters(run)["joint"][str(run["contact"].values[contact])]
        axes.axhline(1e3 * float(joint["ball_radius"]), color="#a8a8a8", lw=1.0)
        axes.plot(offset[:, i], offset[:, j], color="#009E73", lw=0.8)
        axes.plot(offset[-1:, i], offset[-1:, j], "o", color="#009E73", ms=4)  # a ball that does not move
        axes.margins(y=0.15)
        axes.set(xlabel="xyz"[i], ylabel="xyz"[j], title=centre(run, contact))
        return offset[:, i], offset[:, j]
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    axes.fill(radius * np.cos(turn), radius * np.sin(turn), color="#f3f3f3", ec="#a8a8a8", lw=1.0)
    axes.plot(offset[:, i], offset[:, j], color="#009E73", lw=0.6, alpha=0.8)
    reach = max(1.15 * radius, 1.05 * float(np.abs(offset[:, [i, j]]).max()))
    axes.set(xlabel="xyz"[i], ylabel="xyz"[j], aspect="equal", xlim=(-reach, reach), ylim=(-reach, reach))
    axes.set_title(centre(run, contact))
    return offset[:, i], offset[:, j]


def centre(run: xr.Dataset, contact: int) -> str:
    """Return the title of the picture of a ball or pin in the part that holds it."""
    kind = _kind(run, contact)
    return f"centre {'in its' if kind.hollow else 'over'} {kind.surfaces[0]} (mm)"


def _kind(run: xr.Dataset, contact: int) -> Any:
    """Return the class of a contact's surfaces."""
    return SURFACES[parameters(run)["joint"][str(run["contact"].values[contact])]["type"]]


def _friction(run: xr.Dataset, first: Sequence[str]) -> dict[str, bytes]:
    names = [str(name) for name in run["rubbing"].values]
    lost, load = run["joint_friction_loss"].values, run["joint_bearing_load"].values
    chosen = _drawn_indices(names, first, lost[-1], JOINTS)
    factor, unit = by_unit({"": lost[:, chosen]}, "J")
    colors = list(zip(COLORS, chosen, strict=False))
    panels: list[Panel] = [
        ("normal force in the bearings (N)", {names[k]: (load[:, k], {"color": c, "lw": 0.9}) for c, k in colors}),
        (f"energy lost ({unit})", {names[k]: (factor * lost[:, k], {"color": c}) for c, k in colors}),
    ]
    heading = (f"Friction of ideal joints{_shown_count_text(len(names), JOINTS)}", "")
    return _sheet("joint_friction", run["time"].values, panels, 2, heading, 2.4, legend=8)


def _wear(run: xr.Dataset, post: xr.Dataset) -> dict[str, bytes]:
    """Draw load path over time, and depths over the angle about the axis; for spheres those of the deepest band."""
    names = [str(name) for name in post["worn"].values][:CONTACTS]
    figure, axes = style.grid(len(names), 3, (11.0, 0.9 + 2.4 * len(names)))
    time = 1e3 * run["time"].values
    for k, (row, name) in enumerate(zip(axes, names, strict=True)):
        row[0].plot(time, run["wear_load_path"].values[:, k], color=style.INK)
        row[0].set(xlim=(time[0], time[-1]), xlabel="time (ms)", title=f"{name}: force times sliding distance (N m)")
        for panel, side, what in zip(row[1:], ("outer", "inner"), ("socket or journal", "ball or pin"), strict=True):
            sectors = int(post["wear_sectors"].values[k])
            depth = post[f"wear_depth_{side}"].values[k].max(axis=0)[:sectors]
            factor, unit = by_unit({"": depth}, "m")
            edges = np.linspace(0.0, 360.0, sectors + 1)
            panel.stairs(factor * depth, edges, fill=True, color="#D55E00")
            panel.set(xlim=(0.0, 360.0), xlabel="angle about z of its frame (°)", xticks=range(0, 361, 90))
            panel.set_title(f"wear depth if only the {what} wears ({unit})")
    more = _shown_count_text(post.sizes["worn"], CONTACTS)
    style.heading(figure, f"Wear of contacts{more}", "Archard's law with the coefficient and hardness of the scene")
    return style.files("wear", figure)


def _energy(run: xr.Dataset) -> dict[str, bytes]:
    energies: dict[str, Any] = {label: run[name].values for name, label in ENERGIES.items() if name in run}
    largest = max(float(np.abs(values - values[0]).max()) for values in energies.values()) or 1.0
    energies = {label: v for label, v in energies.items() if float(np.abs(v).max(initial=0.0)) > UNSEEN * largest}
    factor, unit = by_unit(energies, "J")
    error = run["energy_error"].values
    small, small_unit = by_unit({"": error}, "J")
    colors = zip(COLORS, energies.items(), strict=False)
    panels: list[Panel] = [
        (f"energies ({unit})", {label: (factor * values, {"color": color}) for color, (label, values) in colors}),
        (f"error of the energy balance ({small_unit})", {"": (small * error, {"color": style.INK, "lw": 0.9})}),
    ]
    legend = 6 if energies else 0
    return _sheet("energy", run["time"].values, panels, 2, ("Energy", ""), 2.4, legend=legend, width_ratios=[1.8, 1.0])
