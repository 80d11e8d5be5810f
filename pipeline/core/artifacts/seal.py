"""Digests that only this user can make: of files that go into compiled code as they are.

What a work space holds decides where compiled code reads and writes, so unfinished work that somebody else put into a
folder of results must not be continued. The secret lies next to the compiled kernels, in the user's own folder.
"""

from __future__ import annotations

import hmac
import os
from functools import cache

from flexclear.pipeline.core.artifacts.disk import temporary
from flexclear.pipeline.core.artifacts.paths import kernel_root
from flexclear.pipeline.core.system.platforms import replace

NAME, BYTES = "seal", 32


def sealed(content: bytes) -> str:
    """Hexadecimal digest of as many characters as that of `disk.sha256`."""
    return hmac.new(_secret(), content, "sha256").hexdigest()


def same(one: str, other: str) -> bool:
    """Whether two digests are equal, in a time that does not depend on where they differ."""
    return hmac.compare_digest(one.encode(), other.encode())


@cache
def _secret() -> bytes:
    """The user's; where none can be stored, one of this process, whose work no other one continues with."""
    path = kernel_root() / NAME
    try:
        if not path.is_file() or path.stat().st_size != BYTES:
            path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            with temporary(path) as made:
                with open(os.open(made, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
                    file.write(os.urandom(BYTES))
                replace(made, path)
        return path.read_bytes()  # of processes that make one at once, the last one's
    except OSError:
        return os.urandom(BYTES)
