"""Films: their speed, slower around the strongest impacts, and their files."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import xarray as xr

from flexclear.post.plotting import style
from flexclear.post.single_run.series import impacts

#: length of a film [s], and its slowdown around impacts
SECONDS, SLOWER = 3.75, 8.0
#: number of the strongest impacts that are shown slowly, each within this fraction of the run
SHOWN, AROUND = 3, 0.008


@dataclass(frozen=True, slots=True)
class FrameTimes:
    """times: of the run at each frame [s].  slower: ratio of film time to run time at each frame."""

    times: np.ndarray
    slower: np.ndarray

    def steps(self, run: xr.Dataset, most: int | None = None) -> np.ndarray:
        """Return the outputs of the run at these times, or at `most` of them, evenly spread."""
        time, times = run["time"].values, self.times
        if most is not None:
            times = times[np.unique(np.linspace(0, times.size - 1, most).astype(int))]
        return np.clip(np.searchsorted(time, times - 1e-12 * (time[-1] - time[0])), 0, time.size - 1)


def frame_times(
    run: xr.Dataset, seconds: float | None = None, slower: float | None = None, rate: int = 24
) -> FrameTimes:
    """Return the times of a film's frames, `rate` a second, in which impacts take `slower` times longer."""
    time, seconds = run["time"].values, seconds or SECONDS
    start, span = float(time[0]), float(time[-1] - time[0])
    strong = strongest_impacts(run)
    run_fraction = np.linspace(0.0, 1.0, 4001)
    weight = np.ones_like(run_fraction)
    factor = SLOWER if slower is None else slower
    for when in strong:
        # a smooth bump: the film slows down and speeds up without jumps
        closeness = np.clip(1.0 - np.abs(run_fraction - (when - start) / span) / (2.0 * AROUND), 0.0, 1.0)
        weight = np.maximum(weight, 1.0 + (factor - 1.0) * np.minimum(2.0 * closeness, 1.0))
    passed = np.concatenate([[0.0], np.cumsum(0.5 * (weight[1:] + weight[:-1]) * np.diff(run_fraction))])
    total = max(round(seconds * rate * min(1.4, passed[-1])), 2)
    fraction = np.interp(np.linspace(0.0, passed[-1], total), passed, run_fraction)
    length = total / rate
    return FrameTimes(start + span * fraction, length / passed[-1] * np.interp(fraction, run_fraction, weight) / span)


def strongest_impacts(run: xr.Dataset) -> np.ndarray:
    """Return the begins of the strongest impacts [s], at most SHOWN, ascending; none without contacts."""
    all_impacts = impacts(run)
    if "impact_time" not in all_impacts:
        return np.empty(0)
    times, force = all_impacts["impact_time"], np.nan_to_num(all_impacts["impact_peak_force"])
    chosen: list[float] = []
    least = 4.0 * AROUND * float(run["time"].values[-1] - run["time"].values[0])
    for k in np.argsort(-force, kind="stable"):
        if len(chosen) < SHOWN and all(abs(times[k] - other) > least for other in chosen):
            chosen.append(float(times[k]))
    return np.sort(chosen)


def speed_text(slower: float) -> str:
    """Return the speed in words."""
    if 0.95 < slower < 1.05:
        return "real time"
    return f"{slower:.2g} times slower" if slower > 1.0 else f"{1.0 / slower:.2g} times faster"


class Caption:
    """A line of text at the lower left of pictures; each text is drawn once."""

    def __init__(self, size: tuple[int, int], color: str) -> None:
        self.size, self.color = size, color
        self.drawn = lru_cache(maxsize=64)(self._drawn)

    def onto(self, picture: np.ndarray, text: str) -> None:
        """Put a text into a picture of shape (height, width, 3), in place."""
        shade = self.drawn(text)
        height = len(shade)
        ink = np.array([int(self.color[k : k + 2], 16) for k in (1, 3, 5)])
        area = picture[-height:, : shade.shape[1]]
        area[:] = np.round(area * (1.0 - shade[..., None]) + ink * shade[..., None]).astype(picture.dtype)

    def _drawn(self, text: str) -> np.ndarray:
        """Return the darkness of each pixel, in [0, 1]."""
        width, height = self.size
        canvas = style.canvas((width, height))
        canvas.figure.text(14 / width, 0.45, text, fontsize=9.5, va="center", color="black", parse_math=False)
        canvas.draw()
        return 1.0 - style.pixels(canvas)[..., 0] / 255.0


#: pictures a second
RATE = 24
#: one thread and no metadata: equal frames give equal bytes
EQUAL_BYTES = ["-threads", "1", "-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact"]
#: quality; and a search for motion that takes half the time of the usual one and makes no larger files of these films
CODING = ["-crf", "21", "-preset", "veryfast"]


def pictures_per_second(kind: str) -> int:
    """Return the pictures a second of a film; half as many in a GIF."""
    return RATE if kind == "mp4" else RATE // 2


def write(frames: Iterator[np.ndarray], rate: int, kind: str = "mp4") -> tuple[str, bytes]:
    """Write frames of shape (height, width, 3) as MP4, or as GIF where requested or where ffmpeg is missing."""
    import imageio.v2 as imageio

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"film.{kind}"
        try:
            if kind == "mp4":
                writer = imageio.get_writer(
                    path,
                    fps=rate,
                    codec="libx264",
                    quality=None,
                    macro_block_size=2,
                    output_params=EQUAL_BYTES + CODING,
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
