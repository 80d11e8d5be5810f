"""Values between two processes: text, numbers and arrays of numbers. Nothing that arrives is run.

A message is the length of its head in 8 bytes, the head as JSON, and the bytes of the arrays that the head names.
"""

from __future__ import annotations

import json
import re
import struct
from math import prod
from typing import IO, Any

import numpy as np

_LENGTH = struct.Struct("<Q")
#: what an array may hold: truth values, integers, floats, complex numbers
KINDS = "biufc"
_TYPE = re.compile(r"[<>|=]?[biufc](?:1|2|4|8|16)")
#: bytes of the head of a message
LARGEST_HEAD = 100_000_000


def send(file: IO[bytes], value: Any) -> None:
    """Write a value: None, truth value, number, text, array of numbers or texts; lists and tables by name of such.

    Raises TypeError for others.
    """
    arrays: list[np.ndarray] = []
    head = json.dumps(_encoded(value, arrays)).encode()
    file.write(_LENGTH.pack(len(head)) + head)
    for array in arrays:
        file.write(array.reshape(-1).view(np.uint8).data)
    file.flush()


def receive(file: IO[bytes], most: float) -> Any:
    """The next value, whose arrays have so many bytes at most.

    Raises EOFError where the other side is gone, ValueError for what is no message.
    """
    head = _exactly(file, _length(file, min(LARGEST_HEAD, most)))
    try:
        header = json.loads(bytes(head))
        types = _arrays(header)
    except RecursionError:
        raise ValueError("a message is nested too deeply") from None
    sizes = [dtype.itemsize * prod(shape) for dtype, shape in types]
    if sum(sizes) > most:
        raise ValueError(f"{sum(sizes)} bytes are more than the {most:.0f} that are allowed")
    arrays = iter([_exactly(file, size).view(dtype).reshape(shape) for size, (dtype, shape) in zip(sizes, types)])  # noqa: B905
    return _value(header, arrays)


def _length(file: IO[bytes], most: float) -> int:
    (length,) = _LENGTH.unpack(_exactly(file, _LENGTH.size).tobytes())
    if length > most:
        raise ValueError(f"a head of {length} bytes")
    return int(length)


def _exactly(file: IO[bytes], count: int) -> np.ndarray:
    """So many bytes; EOFError where there are fewer."""
    buffer = np.empty(count, dtype=np.uint8)
    view, done = buffer.data, 0
    while done < count:
        more = file.readinto(view[done:])  # type: ignore[attr-defined]
        if not more:
            raise EOFError("the other process is gone")
        done += more
    return buffer


def _encoded(value: Any, arrays: list[np.ndarray]) -> Any:
    """A value as JSON; its arrays of numbers are put into the list."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, dict):
        return {"table": {str(name): _encoded(part, arrays) for name, part in value.items()}}
    if isinstance(value, (list, tuple)):
        return {"list": [_encoded(part, arrays) for part in value]}
    if isinstance(value, np.ndarray) and value.dtype.kind in KINDS:
        native = np.ascontiguousarray(value, dtype=value.dtype.newbyteorder("="))
        arrays.append(native)
        return {"array": [native.dtype.str, list(value.shape)]}
    if isinstance(value, np.ndarray) and all(isinstance(text, str) for text in value.ravel().tolist()):
        return {"texts": [value.ravel().tolist(), list(value.shape)]}
    raise TypeError(f"it holds {f'an array of {value.dtype}' if isinstance(value, np.ndarray) else type(value)}")


def _arrays(node: Any) -> list[tuple[np.dtype, tuple[int, ...]]]:
    """Types and shapes of the arrays that a head names, in its order."""
    if not isinstance(node, dict):
        return []
    ((kind, content),) = node.items()
    if kind == "array":
        name, shape = content
        if not _TYPE.fullmatch(name) or any(type(n) is not int or n < 0 for n in shape):
            raise ValueError(f"an array of {name!r}, {shape!r}")
        return [(np.dtype(name), tuple(shape))]
    parts = content if kind == "list" else content.values() if kind == "table" else ()
    return [array for part in parts for array in _arrays(part)]


def _value(node: Any, arrays: Any) -> Any:
    if not isinstance(node, dict):
        return node
    ((kind, content),) = node.items()
    if kind == "array":
        return next(arrays)
    if kind == "texts":
        return np.array(content[0], dtype=object).reshape(content[1])
    if kind == "list":
        return [_value(part, arrays) for part in content]
    return {str(name): _value(part, arrays) for name, part in content.items()}
