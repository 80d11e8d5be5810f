"""Names of files that every system takes and distinguishes: results are sent from one to another."""

from __future__ import annotations

import unicodedata

#: names of devices on Windows, whatever their suffix
#: (https://learn.microsoft.com/windows/win32/fileio/naming-a-file)
DEVICES = frozenset(["con", "prn", "aux", "nul", *(f"{port}{k}" for port in ("com", "lpt") for k in "0123456789¹²³")])

#: characters that names on Windows cannot have; paths written with its own separator are refused in other words
FORBIDDEN = '<>:"|?*'


def folded(name: str) -> str:
    """What represents all names that some system takes for the same: capitals and small letters, composed or not."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def is_device(name: str) -> bool:
    """Whether a name, with any suffix, is that of a device on Windows, where no file can have it."""
    return folded(name.partition(".")[0].rstrip()) in DEVICES


def unfit(name: str) -> str:
    """Return why no file or folder of Windows can have a name; empty where it can."""
    if is_device(name):
        return f"'{name}' is a device on Windows"
    if wrong := sorted(set(name) & set(FORBIDDEN)):
        return f"'{name}' contains {' '.join(wrong)}, which names on Windows cannot have"
    return f"'{name}' ends with a dot or a space, as names on Windows cannot" if name.endswith((".", " ")) else ""
