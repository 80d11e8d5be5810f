"""``flexclear schema``: JSON schema of scene files."""

from __future__ import annotations

import argparse
import json

from pipeline.core.scene.schema import Scene


def arguments(parser: argparse.ArgumentParser) -> None:
    """It takes nothing."""


def command(options: argparse.Namespace) -> None:
    """Print it."""
    print(json.dumps(Scene.model_json_schema(), indent=2))
