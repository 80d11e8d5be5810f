"""Exudyn's runs as points of the cost studies: `python -m benchmarks.peer_points FILE.json`, from the log.

`flexclear cost SCENE --peer FILE.json` draws them; neither the command nor its packages know of the peer.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.log import LOG, latest
from benchmarks.peer import BODY

#: scene of a cost study -> case of `benchmarks.peer`, and how that differs from the scene
CASES = {
    "sps4/ideal": ("ideal", ""),
    "sps4/far_cb": ("far_cb", ""),
    "sps4/csj": (
        "csj, each code with its own friction law",
        "its friction is linear up to one speed and constant above; errors against its own finest run",
    ),
    "sps4/far_csj_cb": ("far_csj_cb without friction, error up to 30 ms", "without friction; errors up to 30 ms"),
    "sps4/variants/far_csj_cb_damped": ("far_csj_cb without friction, 5 % modal damping", "without friction"),
}


def main() -> int:
    """Write the file; exit code 1 when the peer was never measured."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.peer_points", description=__doc__)
    parser.add_argument("file", type=Path, metavar="FILE.json")
    options = parser.parse_args()
    lines = latest(LOG)
    if "exudyn" not in lines:
        print("measure first: python -m benchmarks exudyn", file=sys.stderr)
        return 1
    options.file.write_text(json.dumps(points(lines["exudyn"]), indent=1) + "\n")
    return 0


def points(line: dict[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """By scene the peer's methods, each with seconds [s] and errors [SI] by quantity and step, of a line of the log."""
    cases = {result["case"]: result for result in line["results"]}
    version = line["versions"]["exudyn"]
    return {scene: list(_tracks(cases[case], version, note)) for scene, (case, note) in CASES.items() if case in cases}


def _tracks(result: dict[str, Any], version: str, note: str) -> Iterator[dict[str, Any]]:
    runs = [run for run in result["exudyn"] if "s" in run]
    for method in dict.fromkeys(run["method"] for run in runs):
        mine = [run for run in runs if run["method"] == method]
        yield {
            "name": f"Exudyn, {method}",
            "note": f"Exudyn {version}: times of its integration alone, ours hold all that a run records"
            + (f"; {note}" if note else ""),
            "seconds": [run["s"] for run in mine],
            "error": {
                f"{BODY}.position": [1e-6 * run["position_um"] for run in mine],
                f"{BODY}.velocity": [1e-3 * run["velocity_mm_s"] for run in mine],
            },
        }


if __name__ == "__main__":
    sys.exit(main())
