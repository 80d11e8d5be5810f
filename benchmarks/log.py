"""The log: one JSON line per measured group, kept with the project so that changes of speed can be seen."""

from __future__ import annotations

import datetime
import json
from pathlib import Path
from typing import Any

from benchmarks.measure import machine

LOG = Path(__file__).parent / "log.jsonl"


def append(group: str, results: list[dict[str, Any]], path: Path = LOG) -> None:
    """Add a line: date, processor, versions, group, results with floats of four digits."""
    line = {"date": datetime.date.today().isoformat(), **machine(), "group": group, "results": rounded(results)}
    with path.open("a") as file:
        file.write(json.dumps(line) + "\n")


def latest(path: Path = LOG) -> dict[str, dict[str, Any]]:
    """The last line of each group."""
    lines = path.read_text().splitlines() if path.exists() else []
    return {line["group"]: line for line in map(json.loads, lines)}


def rounded(value: Any) -> Any:
    """Floats at any depth to four digits: what is behind them is noise."""
    if isinstance(value, dict):
        return {key: rounded(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [rounded(inner) for inner in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value
