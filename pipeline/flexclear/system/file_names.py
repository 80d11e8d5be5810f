"""File names that every operating system accepts and distinguishes, since results are sent between systems."""

from __future__ import annotations

import unicodedata

#: names of devices on Windows, whatever their suffix
#: (https://learn.microsoft.com/windows/win32/fileio/naming-a-file)
DEVICES = frozenset(["con", "prn", "aux", "nul", *(f"{port}{k}" for port in ("com", "lpt") for k in "0123456789¹²³")])

#: characters that names on Windows cannot have; paths with the Windows separator are refused by another check
FORBIDDEN = '<>:"|?*'


def folded(name: str) -> str:
    """Return one form for all names that some system treats as equal: in any case, composed or decomposed."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def is_device(name: str) -> bool:
    """Return True for the name, with any suffix, of a Windows device, which no file can have."""
    return folded(name.partition(".")[0].rstrip()) in DEVICES


def unfit(name: str) -> str:
    """Return why a file or folder on Windows cannot have a name; empty where it can."""
    if is_device(name):
        return f"'{name}' is a device on Windows"
    if wrong := sorted(set(name) & set(FORBIDDEN)):
        return f"'{name}' contains {' '.join(wrong)}, which file names on Windows cannot contain"
    return f"'{name}' ends with a dot or a space, which Windows does not allow" if name.endswith((".", " ")) else ""
