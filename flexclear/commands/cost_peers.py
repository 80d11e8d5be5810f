"""Points of other programs, measured elsewhere, that the figures of cost studies show next to ours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.core.system.external_files import require_file

Track = dict[str, Any]
#: bytes of such a file
LARGEST = 16 << 20


def read(path: Path) -> dict[str, list[Track]]:
    """By scene the tracks of a file: `name`, `note`, `seconds` [s], and `error` [SI], a list for each quantity.

    Raises InputError for a file that cannot be read or says something else.
    """
    require_file(path, f"--peer {path}")
    try:
        if path.stat().st_size > LARGEST:
            raise ValueError(f"it is larger than {LARGEST >> 20} MB")
        table = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"--peer {path}", f"cannot be read: {error}", "docs/accuracy/exudyn.json is one") from None
    if not isinstance(table, dict):
        raise InputError(f"--peer {path}", "expected a table of scenes")
    return {
        str(scene): [_checked(path, scene, track) for track in _listed(path, scene, table[scene])] for scene in table
    }


def _listed(path: Path, scene: str, tracks: object) -> list[object]:
    if not isinstance(tracks, list):
        raise InputError(f"--peer {path} [{scene}]", "expected a list of tracks")
    return tracks


def _checked(path: Path, scene: str, track: object) -> Track:
    where = f"--peer {path} [{scene}]"
    if not isinstance(track, dict) or not {"name", "seconds", "error"} <= track.keys():
        raise InputError(where, "a track needs name, seconds and error")
    seconds, errors = track["seconds"], track["error"]
    if not isinstance(track["name"], str) or not isinstance(track.get("note", ""), str):
        raise InputError(where, "name and note of a track are texts")
    if not isinstance(errors, dict) or any(not _numbers(v) for v in (seconds, *errors.values())):
        raise InputError(where, "seconds and each quantity's error are lists of finite numbers")
    if any(len(v) != len(seconds) for v in errors.values()):
        raise InputError(where, f"'{track['name']}' has {len(seconds)} times, but another number of errors")
    return {"note": "", **track}


def _numbers(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(x, (int, float)) and abs(x) < 1e300 for x in value)
