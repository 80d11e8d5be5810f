"""``flexclear sections``: verdict whether a repeated motion is periodic, quasi-periodic or chaotic, with evidence."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from flexclear.stages import scenes
from flexclear.stages.export import as_json
from flexclear.stages.workplace import open_workplace

if TYPE_CHECKING:
    import xarray as xr


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scenes.scene_arguments(parser, "json")


def command(options: argparse.Namespace) -> None:
    """Print the verdict on each scene."""
    workplace = open_workplace(options)
    graphs = scenes.graphs(options.scenes, options.set)
    verdicts = dict(zip((g.scene.name for g in graphs), workplace.datasets(*(g.verdict for g in graphs)), strict=True))
    print(as_json(verdicts) if options.json else "\n\n".join(text(*one) for one in verdicts.items()))


def text(scene: str, verdict: xr.Dataset) -> str:
    """Return the verdict in words, and its numbers (schema VERDICT)."""
    lines = [f"{scene}: {verdict.attrs['verdict']}"]
    lines += [f"  {reason}" for reason in str(verdict.attrs["reasons"]).split("; ")]
    if "contraction" in verdict:
        lines.append(f"  the distance of successive returns shrinks by {float(verdict.contraction):.3g} per period")
    return "\n".join(lines)
