"""Pictures one after the other as a film."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

#: pictures a second
RATE = 24
#: one thread and no metadata: equal frames give equal bytes
EQUAL_BYTES = ["-threads", "1", "-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact", "-crf", "21"]


def rate(kind: str) -> int:
    """Pictures a second of a film; half as many in a GIF."""
    return RATE if kind == "mp4" else RATE // 2


def write(frames: Iterator[np.ndarray], rate: int, kind: str = "mp4") -> tuple[str, bytes]:
    """Frames of shape (height, width, 3) as MP4, or as GIF where that is asked for or no ffmpeg is found."""
    import imageio.v2 as imageio

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"film.{kind}"
        try:
            if kind == "mp4":
                writer = imageio.get_writer(
                    path, fps=rate, codec="libx264", quality=None, macro_block_size=2, output_params=EQUAL_BYTES
                )
        except (ImportError, RuntimeError, ValueError):
            kind = "gif"
        if kind != "mp4":
            path = path.with_suffix(".gif")
            writer = imageio.get_writer(path, duration=1000.0 / rate, loop=0)
        with writer:
            for frame in frames:
                writer.append_data(frame)
        return path.suffix.lstrip("."), path.read_bytes()
