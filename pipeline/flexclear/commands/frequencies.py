"""``flexclear frequencies``: equilibrium of a scene in a pose, and its natural frequencies."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flexclear.artifacts.disk import disk_limits, publish
from flexclear.scene.units import quantity
from flexclear.stages import export, scenes
from flexclear.stages.export import as_json
from flexclear.stages.workplace import add_options, open_workplace
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.scene.schema import Scene

#: characters of a bare number
NUMBER = "+-.0123456789eE"
#: largest number of speeds of one diagram
MOST_SPEEDS = 10_000
#: endings of pictures of Campbell diagrams
PICTURES = (".png", ".svg")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or a name below scenes/")
    parser.add_argument(
        "--at", metavar="TIME", help="hold the drives at their positions at this time, such as 0.09 or '90 ms'"
    )
    parser.add_argument(
        "--moving",
        action="store_true",
        help="vibrations about steady motion: drives have their speed instead of being held",
    )
    parser.add_argument(
        "--speeds",
        metavar="FIRST:LAST:STEP",
        help="Campbell diagram: vibrations about steady motion at these speeds of the drive, e.g. 0:500rpm:50",
    )
    parser.add_argument("--drive", metavar="NAME", help="with --speeds: the drive, if there are several")
    parser.add_argument(
        "--out",
        type=Path,
        action="append",
        metavar="FILE",
        help=f"write the result here: {export.KNOWN}; with --speeds also .png, .svg; repeatable",
    )
    add_options(parser, "usual", "json")


def run_command(options: argparse.Namespace) -> None:
    """Print the table of frequencies, or of a Campbell diagram with `--speeds`."""
    (graph,) = scenes.graphs([options.scene], options.set)
    time = scenes.moment(options.at)
    if options.speeds is not None:
        print_diagram(graph.scene, time, options)
        return
    if options.drive is not None:
        raise InputError("--drive", "belongs to a Campbell diagram", "add --speeds, e.g. 0:500rpm:50")
    if any(target.suffix in PICTURES for target in options.out or ()):
        raise InputError("--out", "pictures are of Campbell diagrams", "add --speeds, e.g. 0:500rpm:50")
    targets = _output_files(options, ())
    modes = scenes.linear(graph.scene, time, moving=options.moving, workplace=open_workplace(options))
    print(as_json(modes) if options.json else text(modes).rstrip("\n"))
    for target in targets:
        with disk_limits(target.parent):
            export.write(modes, target, ("vibration",))


def _output_files(options: argparse.Namespace, pictures: Sequence[str]) -> list[Path]:
    """Return the files of `--out`, checked before the work; pictures: endings besides those of datasets."""
    targets: list[Path] = options.out or []
    for target in targets:
        scenes.check_out(target, (options.scene,), endings=(*export.NEEDS, *pictures))
    return targets


def print_diagram(scene: Scene, time: float | None, options: argparse.Namespace) -> None:
    """Print the table of a Campbell diagram, and write its dataset and its picture."""
    given = parse_speeds(options.speeds)
    targets = _output_files(options, PICTURES)
    made = scenes.linear(scene, time, speeds=given, drive=options.drive, workplace=open_workplace(options))
    from flexclear.post.plotting import campbell

    print(as_json(made) if options.json else campbell.text(made))
    pictures = campbell.files("campbell", made) if any(target.suffix in PICTURES for target in targets) else {}
    for target in targets:
        with disk_limits(target.parent):
            if target.suffix in PICTURES:
                publish(target, pictures[f"campbell{target.suffix}"])
            else:
                export.write(made, target, ("speed",))


def parse_speeds(text: str) -> list[float]:
    """Parse FIRST:LAST:STEP into speeds [rad/s], the last included; one unit serves all three. Raises InputError."""
    parts = [part.strip() for part in text.split(":")]
    rule = "takes FIRST:LAST:STEP, the step positive and the last speed above the first"
    units = {part.lstrip(NUMBER).strip() for part in parts} - {""}
    shared = units.pop() if len(units) == 1 else ""
    try:
        first, last, step = (
            quantity(f"{part} {shared or 'rad/s'}" if part.lstrip(NUMBER) == "" else part, "angular velocity")
            for part in parts
        )
    except ValueError as error:
        raise InputError(f"--speeds {text}", f"{rule}: {error}", "for example 0:500rpm:50") from None
    if not (step > 0.0 and last > first):
        raise InputError(f"--speeds {text}", rule, "for example 0:500rpm:50")
    count = int(np.floor((last - first) / step * (1.0 + 1e-12))) + 1
    if count > MOST_SPEEDS:
        raise InputError(
            f"--speeds {text}", f"asks for {count} speeds; at most {MOST_SPEEDS} are computed", "a larger step"
        )
    return [first + k * step for k in range(count)]


def text(linear: xr.Dataset) -> str:
    """Format pose, residual, mobility, and frequency, damping and dominant part of every vibration (schema LINEAR)."""
    a = linear.attrs
    lines = [
        f"{a['scene']} at t = {a['time']:.6g} s, drives {a['drives']}",
        *_pose(linear),
        f"equilibrium: largest unbalanced force {a['residual']:.3g} N after {a['iterations']} iterations",
        *_mobility_lines(linear),
    ]
    if linear.sizes["vibration"]:
        grows = a["growth"]
        lines.append(
            f"unstable: a small motion grows at {grows:.3g} 1/s" if grows > 0.0 else "stable: no small motion grows"
        )
    if not linear.sizes["vibration"]:
        return "\n".join([*lines, "nothing vibrates: joints and drives hold all bodies"]) + "\n"
    if a["drives"] == "moving" and a["frequency_axes"] == "fixed":
        lines.append("frequencies in fixed axes: the equations vary with the angle of the drives")
    lines += [
        f"{'':>4} {'frequency':>14} {'damping':>10}  most kinetic energy in",
        f"{'':>4} {'Hz':>14} {'ratio':>10}",
    ]
    fraction = linear["energy_share"].max("moving_body").values
    columns = [linear[name].values for name in ("vibration", "frequency", "damping_ratio", "decay_rate", "dominant")]
    for number, hertz, damping, rate, name, part in zip(*columns, fraction, strict=True):
        # an overdamped motion has two rates and no frequency: two rows of one motion
        note = f", decays at {rate:.3g} 1/s without vibrating" if hertz == 0.0 and rate > 0.0 else ""
        lines.append(f"{number:>4} {hertz:>14.7g} {damping:>10.3g}  {name} ({100.0 * part:.0f} %){note}")
    return "\n".join(lines) + "\n"


def _mobility_lines(linear: xr.Dataset) -> list[str]:
    """Return lines on mobility: free motions, those without stiffness, and closure rows that follow from others."""
    limp, repeated = linear.attrs["motions_without_stiffness"], linear.attrs["redundant_closure_rows"]
    lines = [
        f"free motions in addition to the drives: {linear.attrs['mobility']}"
        + (f", {limp} without stiffness" if limp else "")
    ]
    if joints := linear.attrs["undetermined_reactions"]:
        says = "loop closure condition is" if repeated == 1 else "loop closure conditions are"
        lines.append(
            f"{repeated} {says} redundant, as are three in a planar loop: motion and frequencies are unaffected, "
            f"but rigid bodies do not determine the reactions of {joints}"
        )
    return lines


def _pose(linear: xr.Dataset) -> list[str]:
    if "drive_position" not in linear:
        return []
    names = [str(name) for name in linear["drive"].values]
    position, each = linear["drive_position"], linear.coords.get("drive_position_units")
    units = [str(position.attrs.get("units", ""))] * len(names) if each is None else [str(unit) for unit in each.values]
    columns = zip(names, position.values, units, strict=True)
    return ["drives at " + ", ".join(f"{name} = {value:.6g} {unit}" for name, value, unit in columns)]
