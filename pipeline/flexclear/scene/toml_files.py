"""Reading of TOML files, and the frames that the file of a mesh recipe names."""

from __future__ import annotations

import copy
import re
import stat
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any

from flexclear.scene.lines import not_toml
from flexclear.scene.registry import suggestion
from flexclear.system.errors import InputError

#: largest size of a scene or recipe [bytes]: the TOML reader takes a second for the worst content of this size
LARGEST_FILE = 1 << 20
#: a key with more parts than a scene has levels; the TOML reader's time grows with their number squared
_PART = r"""(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
DEEP = re.compile(rf"(?<![\w\\-])(?:{_PART}[ \t]*+\.[ \t]*+){{50}}")


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file as a table; raise InputError when it cannot be read or parsed."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(str(path), "cannot be read: it is not an ordinary file", "name a TOML file")
        if status.st_size > LARGEST_FILE:
            raise InputError(
                str(path),
                f"is larger than {LARGEST_FILE >> 20} MB",
                "name a TOML file; put long tables of laws into a CSV file",
            )
        text = path.read_text(encoding="utf-8-sig")
        if DEEP.search(text):
            raise InputError(str(path), "nests tables too deeply to be read: a key has more than 50 parts")
        return copy.deepcopy(_parsed(text))
    except FileNotFoundError:
        raise InputError(str(path), "there is no such file", _neighbours(path)) from None
    except UnicodeDecodeError as error:
        raise InputError(str(path), f"is not text in UTF-8: {error.reason}", "name a TOML file") from None
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}", "name a TOML file") from None
    except tomllib.TOMLDecodeError as error:
        raise not_toml(path, path.read_text(encoding="utf-8-sig"), str(error)) from None
    except RecursionError:
        raise InputError(str(path), "nests tables or lists too deeply to be read") from None
    except ValueError as error:  # a NUL in the path, or a number with more digits than Python reads
        raise InputError(str(path), f"cannot be read: {error}", "name a TOML file") from None


#: `check` reads a scene at several of its steps
_parsed = lru_cache(maxsize=16)(tomllib.loads)


def _neighbours(path: Path) -> str | None:
    if any("\\" in part for part in path.parts) or not str(path).isprintable():  # \ separates folders on Windows only
        return "write / between folders, which works on every system"
    names = [p.name for p in path.parent.glob("*.toml")] if path.parent.is_dir() else []
    return suggestion(path.name, names) if names else None


def recipe_frames(mesh: str) -> list[str] | None:
    """Return the names of the frames in a mesh recipe; None when it cannot be read, which is reported elsewhere."""
    try:
        frames = read_toml(Path(mesh)).get("frames")
    except (OSError, ValueError, InputError):
        return None
    return list(frames) if isinstance(frames, dict) else None
