"""The start of a run as another run has recorded it: a row of its dataset."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

#: parts of a row: bodies' position, quaternion, velocity, angular velocity; positions of joint coordinates; modal
#: coordinates and rates; approach speeds of closed contacts; gaps of the flanks of gears; internal states
PARTS = ("body", "joint", "modal", "contact", "gap", "state")
#: two times are the same that differ by less than this fraction of the run
SAME = 1e-9
Row = dict[str, tuple[float, ...]]


def read_row(path: Path, time: float | None) -> tuple[float, Row]:
    """Return the time and the contents of a row of a run's file: of its last one, or at a time [s].

    Names in the row are ``body.<body>``, ``modal.<mode>`` and so on, by `PARTS`.  Raises ValueError, in words, for a
    file that cannot be read, that is no run, or that has no row at this time.
    """
    import netCDF4  # here, since most scenes begin without a run
    import numpy as np

    if not path.is_file():
        raise ValueError(f"there is no file {path}" if not path.exists() else f"'{path}' is not an ordinary file")
    try:
        with netCDF4.Dataset(path) as file:
            file.set_auto_mask(False)
            if not {"position", "quaternion", "velocity", "angular_velocity", "time"} <= file.variables.keys():
                raise ValueError(f"{path.name} is not a run of flexclear: it has no motion of bodies over time")
            times = np.asarray(file["time"][:], dtype=float)
            row = _row(times, time, path.name)
            found = dict(_parts(file, row, float(times[row])))
    except (OSError, RuntimeError, IndexError, KeyError, TypeError) as error:
        raise ValueError(f"{path.name} cannot be read as a run: {str(error) or type(error).__name__}") from None
    wrong = next((name for name, values in found.items() if not np.isfinite(values).all()), None)
    units = [np.linalg.norm(values[3:7]) for name, values in found.items() if name.startswith("body.")]
    if wrong is None and not np.allclose(units, 1.0, atol=1e-9):
        wrong = "orientations of bodies"
    if wrong is not None:
        raise ValueError(f"{path.name} is damaged: {wrong} holds no possible numbers; compute the run again")
    return float(times[row]), {name: tuple(map(float, values)) for name, values in found.items()}


def _row(times: "np.ndarray", time: float | None, name: str) -> int:
    if not len(times):
        raise ValueError(f"{name} has no rows")
    if time is None:
        return len(times) - 1
    row = int(abs(times - time).argmin())
    if not abs(times[row] - time) <= SAME * (times[-1] - times[0]):
        near = times[max(row - 1, 0) : row + 2].tolist()
        raise ValueError(
            f"{name} has no row at {time:.9g} s; the nearest are at {', '.join(f'{t:.9g}' for t in near)} s"
        )
    return row


def _parts(file: Any, row: int, time: float) -> Iterator[tuple[str, Any]]:
    import numpy as np

    def here(name: str) -> Any:
        return file[name][row] if name in file.variables else []

    def texts_of(name: str) -> list[str]:
        return [str(text) for text in file[name][:]] if name in file.variables else []

    motion = [here(name) for name in ("position", "quaternion", "velocity", "angular_velocity")]
    for k, body in enumerate(texts_of("body")):
        yield f"body.{body}", np.concatenate([values[k] for values in motion])
    for name, value in zip(texts_of("coordinate"), here("joint_position"), strict=True):
        yield f"joint.{name}", [value]
    for name, value, rate in zip(texts_of("mode"), here("modal_coordinate"), here("modal_velocity"), strict=True):
        yield f"modal.{name}", [value, rate]
    for name, value in zip(texts_of("internal"), here("internal_state"), strict=True):
        yield f"state.{name}", [value]
    for name, kind, gap in zip(texts_of("contact"), texts_of("contact_type"), here("contact_gap"), strict=False):
        if kind == "flank":
            yield f"gap.{name}", [gap]
    columns = ("event_time", "event_kind", "event_contact", "event_approach_speed", "event_duration")
    events = [file[name][:].tolist() for name in columns] if "event_kind" in file.variables else []
    for begun, kind, contact, speed, duration in zip(*events, strict=True):
        if kind == "closing" and begun <= time and not begun + duration <= time:
            yield f"contact.{contact}", [speed if speed == speed else 0.0]
