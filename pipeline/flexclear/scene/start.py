"""The start of a run, where it is given by more than the bodies' poses and velocities, such as a row of another run."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from flexclear.scene.fields import Number, OnCoordinate, Part, PartName, Time, given_keys
from flexclear.scene.units import quantity

if TYPE_CHECKING:
    import numpy as np

#: the keys of one joint coordinate
KEYS = ("position", "near", "velocity")
#: configurations in which a run may begin, other than the poses of the bodies
At = Literal["equilibrium", "ideal"]
Measure = float | str


class JointStart(Part):
    """Start of one joint coordinate; text has a unit of the coordinate or of its rate."""

    position: Measure | None = None
    """exact value at the start"""
    near: Measure | None = None
    """approximate value at the start, which selects among several assemblies"""
    velocity: Measure | None = None
    """rate at the start"""

    @model_validator(mode="after")
    def _check_keys(self) -> Self:
        if not given_keys(self, KEYS):
            raise ValueError(f"one of {', '.join(KEYS)} must give the start of the coordinate; none is given")
        if self.position is not None and self.near is not None:
            raise ValueError("position is the exact start of the coordinate, near an approximate one; give one of them")
        return self


def _coordinates(value: Any) -> Any:
    """Return the start of a joint's single coordinate, which need not be named, under the empty name."""
    if isinstance(value, Mapping) and (not value or set(value) & {*KEYS, "source"}):
        return {"": value}
    return value


class ModalStart(Part):
    """Deformation of a flexible body at the start, by its modes in the order of the bundle; omitted ones are zero."""

    coordinate: tuple[Number, ...] = ()
    """modal coordinates [m]"""
    velocity: tuple[Number, ...] | None = None
    """modal velocities [m/s]; default: zero, if joints, drives and given velocities allow it, else the least ones"""


_ONE_OR_SEVERAL = BeforeValidator(_coordinates, json_schema_input_type=JointStart | dict[str, JointStart])
JointStarts = Annotated[dict[str, JointStart], _ONE_OR_SEVERAL]


class Branch(OnCoordinate):
    """One way out of a change point: that on which this joint coordinate changes most in the direction of `sign`."""

    sign: Literal[1, -1]
    """1 for the branch on which the coordinate grows most; -1 for that on which it falls most"""


def _as_tuple(value: Any) -> Any:
    """Return a single choice, written without a list, as a tuple."""
    return (value,) if isinstance(value, (Mapping, Branch)) else value


class Start(Part):
    """The start of the run."""

    model_config = ConfigDict(populate_by_name=True)

    at: At | None = None
    """"equilibrium", the static one with drives where their laws start and given joint positions held; or "ideal",
    the start of the mechanism without clearance, each loose pin resting where the joint's force presses it, flexible
    bodies deformed by the loads"""
    run: str | None = Field(default=None, alias="from")
    """file of a run, ``run.nc``, that this one continues: bodies, modes, closed contacts, internal states of friction
    and controllers begin as they are there. Drives and loads follow their laws from `time.start` on"""
    time: Time | None = None
    """time in that run; default: its end"""
    recorded: dict[str, tuple[float, ...]] = Field(default_factory=dict)
    """the numbers read from that run; not written in a scene"""
    joint: dict[PartName, JointStarts] = Field(default_factory=dict)
    """starts of joints, by name; for joints with several coordinates by the coordinate's name below"""
    modal: dict[PartName, ModalStart] = Field(default_factory=dict)
    """starts of flexible bodies, by name"""
    branch: Annotated[
        tuple[Branch, ...], BeforeValidator(_as_tuple, json_schema_input_type=Branch | tuple[Branch, ...])
    ] = ()
    """in a change point, the branch that the motion takes; with several loops a list, each entry chooses among the
    branches that are left"""

    #: True where an equilibrium is searched for from here, so that free coordinates need no start of their own
    _sought: bool = PrivateAttr(default=False)

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any) -> Any:
        """Read the run unless its numbers are given; afterwards only its name is stored."""
        if not isinstance(data, dict) or data.get("recorded") or not isinstance(data.get("from"), str):
            return data
        time = data.get("time")
        found, recorded = read_row(Path(data["from"]), None if time is None else quantity(time, "time"))
        return {**data, "from": Path(data["from"]).name, "time": found, "recorded": recorded}

    @property
    def begins(self) -> str | None:
        """Name of the module that gives the poses of the start, where the scene does not."""
        return self.at if self.run is None else "recorded"

    @model_serializer(mode="wrap")
    def _write_keys(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Return the keys as a scene writes them."""
        return {"from" if key == "run" else key: value for key, value in handler(self).items()}

    @model_validator(mode="after")
    def _one_start(self) -> Self:
        if self.run is None:
            if self.time is not None:
                raise ValueError('time is that of a run in which to begin: give the run, from = "run.nc"')
            return self
        other = next((key for key in ("at", "joint", "modal", "branch") if getattr(self, key)), None)
        if other is not None:
            raise ValueError(f"from = '{self.run}' determines the whole start: remove start.{other}")
        return self

    @model_validator(mode="after")
    def _no_two_deformations(self) -> Self:
        given = [name for name, modal in self.modal.items() if modal.coordinate]
        if self.at is not None and given:
            raise ValueError(
                f"at = '{self.at}' and modal.{given[0]}.coordinate both determine the deformation: give one of them"
            )
        return self


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
