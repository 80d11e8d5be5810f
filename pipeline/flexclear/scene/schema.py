"""A whole scene as one frozen model; all towers receive a `Scene`."""

from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, PrivateAttr, model_validator

from flexclear.scene import provenance
from flexclear.scene.drives import Drive
from flexclear.scene.events import Event, require_possible
from flexclear.scene.fields import Direction, Length, Number, Part, PartName, Positive, Time
from flexclear.scene.formulas import check_formulas
from flexclear.scene.limits import Limits, check_members, check_rows
from flexclear.scene.loads import Gravity, Load, SampledPid
from flexclear.scene.loose_joints import CONTACTS, Clearance
from flexclear.scene.notebook import as_html
from flexclear.scene.output import OF_FLEXIBLE, ON_REQUEST, Output
from flexclear.scene.owners import owners
from flexclear.scene.pairs import Pair
from flexclear.scene.parts import (
    Body,
    FlexibleBody,
    Gear,
    Ground,
    IdealJoint,
    Joint,
    MeshedRigidBody,
    RigidBody,
    Stop,
)
from flexclear.scene.quantity import KINDS, Quantity, default_quantities, parse
from flexclear.scene.solver import NAMING, Solver
from flexclear.scene.start import Start
from flexclear.scene.units import any_quantity, quantity, unit_exponents

#: types of joints with one freedom: driving it determines the whole relative motion
SINGLE = ("revolute", "prismatic")
#: largest number of samples of a controller; at each of them a step ends
MOST_SAMPLES = 1e6


class TimeSpan(Part):
    """Start and end of the run."""

    start: Time = 0.0
    """times at which the run begins and ends"""
    end: Time
    """times at which the run begins and ends"""

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if not self.end > self.start:
            raise ValueError(f"time.end = {self.end} s must lie after time.start = {self.start} s")
        return self


class Ensemble(Part):
    """Members that start with the ball of every clearance joint offset in a random direction."""

    members: Annotated[int, Field(ge=2)] = 16
    """number of runs"""
    perturbation: Annotated[Length, Field(gt=0.0)] = 1e-8
    """length by which the balls are offset"""
    seed: Annotated[int, Field(ge=0)] = 20190310
    """seed of the random directions"""
    bodies: tuple[str, ...] | None = None
    """bodies whose motion is recorded; default: the bodies that carry the clearance joints"""


class Sections(Part):
    """A motion that its laws repeat, sampled once in each period: see ``flexclear sections``."""

    period: Annotated[Time, Field(gt=0.0)] | None = None
    """period of the laws of drives and loads, from the run's start; default: the length of the run"""
    phase: Annotated[Time, Field(ge=0.0)] = 0.0
    """time in the period at which the motion is sampled [s]"""
    transient: Annotated[int, Field(ge=0, le=1_000_000)] = 100
    """number of periods before the recorded ones"""
    periods: Annotated[int, Field(ge=20, le=1_000_000)] = 500
    """number of recorded periods"""
    exponent_periods: Annotated[int, Field(ge=20, le=1_000_000)] = 200
    """number of recorded periods that a neighbouring motion also follows, which gives the rate of separation"""
    bodies: tuple[str, ...] | None = None
    """bodies whose motion is recorded; default: as for an ensemble, or all without clearance"""


class Request(Part):
    """A requested accuracy: absolute in SI, or relative to the quantity's own size."""

    absolute: Annotated[Number, Field(gt=0.0)] | None = None
    """requested accuracy in SI"""
    unit: str | None = None
    """SI unit that the number was written with, if any"""
    relative: Annotated[Number, Field(gt=0.0, lt=1.0)] | None = None
    """fraction of the quantity's largest change"""


class Accuracy(Part):
    """Requested accuracy of the time integration per quantity, e.g. ``platform.position = "1 um"``.

    The value is an absolute one with a unit (or bare, in SI), or a fraction like ``"0.1 %"`` or
    ``{ relative = 1e-6 }`` of the quantity's largest change; expressions are quoted, as
    ``"force(A1) - force(A2)" = "1 N"``.
    """

    quantities: dict[str, Request] = Field(default_factory=dict)
    """requests by quantity; a file writes them without this key"""
    allow_missed: bool = False
    """whether a command succeeds although a requested accuracy is missed; the miss is reported and the run is stored in
    either case"""
    by_need: bool | None = None
    """whether the integrator is chosen, too; default: if `[solver]` names none and gives no step"""

    @model_validator(mode="before")
    @classmethod
    def _with_quantities(cls, table: Any) -> Any:
        plain = {"allow_missed", "by_need", "source"}
        if not isinstance(table, dict) or set(table) <= {"quantities"} | plain:
            return table
        requested = {name: value for name, value in table.items() if name not in plain}
        accuracies = {name: _accuracy_request(name, value) for name, value in _leaves(requested, "")}
        return {"quantities": accuracies} | {name: table[name] for name in plain & set(table)}


class View(Part):
    """Settings of what is examined and drawn; no effect on the motion."""

    watch: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """quantities that comparisons, tables and films show, as ``platform.position`` or ``A1.force - A2.force``; default:
    those of `[accuracy]`, else the motion of the body with most joints, a reaction and the contacts"""
    direction: Direction | None = None
    """viewing direction of pictures and films, a vector from the mechanism to the eye; default: normal to a planar
    mechanism, else from above and in front"""
    up: Direction | None = None
    """upward direction in pictures, world axes; default: against gravity, else z"""
    zoom: Annotated[Number, Positive] | None = None
    """magnification of the mechanism against the usual size"""
    exaggeration: Annotated[Number, Positive] | None = None
    """magnification of drawn deformations against the computed ones; default: large enough to be visible"""
    duration: Annotated[Time, Positive] | None = None
    """duration of films; default: some 4 s"""
    impact_slowdown: Annotated[Number, Field(ge=1.0)] | None = None
    """factor by which films run slower around impacts; default: 8; 1 runs evenly"""

    @model_validator(mode="after")
    def _check_directions(self) -> Self:
        for direction in (self.direction, self.up):
            if direction is not None and not any(direction):
                raise ValueError("a direction must not have length zero")
        return self


def _leaves(table: dict[str, Any], where: str) -> list[tuple[str, Any]]:
    """Return dotted names and values from nested tables or quoted names alike."""
    leaves = []
    for key, value in table.items():
        name = f"{where}.{key}".lstrip(".")
        if isinstance(value, dict) and not set(value) <= {"absolute", "relative", "unit"}:
            leaves += _leaves(value, name)
        elif name != "source":
            leaves.append((name, value))
    return leaves


def _accuracy_request(name: str, value: Any) -> Any:
    if isinstance(value, dict):
        return value
    if isinstance(value, str) and value.rstrip().endswith("%"):
        return {"relative": quantity(value, "number")}
    try:
        read = any_quantity(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    if not isinstance(read, str):
        return {"absolute": read}
    number, _, unit = read.partition(" ")  # the scene, which has the quantity, checks the unit
    return {"absolute": float(number), "unit": unit}


class Scene(Part):
    """The content of a scene file after composition. Names of parts are keys."""

    _owner: ClassVar[str] = ""

    title: str
    """description in one line"""
    description: str = ""
    """longer description"""
    body: dict[PartName, Body]
    """bodies by name"""
    joint: dict[PartName, Joint] = Field(default_factory=dict)
    """joints by name, ideal ones and ones with clearance"""
    drive: dict[PartName, Drive] = Field(default_factory=dict)
    """prescribed motions by name"""
    load: dict[PartName, Load] = Field(default_factory=dict)
    """forces, springs, controllers and gravity by name"""
    stop: dict[PartName, Stop] = Field(default_factory=dict)
    """ends of joint coordinates by name"""
    gear: dict[PartName, Gear] = Field(default_factory=dict)
    """coupled joint coordinates by name"""
    event: dict[PartName, Event] = Field(default_factory=dict)
    """releases, locks and switches during the run, by name"""
    time: TimeSpan
    """begin and end of the run"""
    start: Start | None = None
    """start of the run, beyond poses and velocities of bodies"""
    solver: Solver = Solver()
    """integrator and tolerance"""
    output: Output = Output()
    """what is recorded"""
    ensemble: Ensemble | None = None
    """runs from nearby starts"""
    sections: Sections | None = None
    """repeated motion, sampled once in each period"""
    accuracy: Accuracy | None = None
    """requested accuracy by quantity"""
    limits: Limits = Limits()
    """largest resources that the work may take"""
    view: View | None = None
    """settings of pictures and comparisons"""

    def _samples_can_be_made(self) -> None:
        for name, load in self.load.items():
            if not isinstance(load, SampledPid):
                continue
            samples = (self.time.end - self.time.start) / load.period
            if samples > MOST_SAMPLES:
                raise ValueError(
                    f"load.{name}.period = {load.period:g} s requires {samples:.3g} samples, more than "
                    f"{MOST_SAMPLES:g}: choose a longer one, or a continuous 'pid'"
                )

    def _quantities_are_there(self) -> None:
        named = [("accuracy.", name) for name in (self.accuracy.quantities if self.accuracy else ())]
        named += [("view.watch: ", name) for name in (self.view and self.view.watch) or ()]
        known = self.owners() if named else {}
        for where, name in named:
            try:
                one = parse(name, known)
                written = self.accuracy.quantities[name].unit if self.accuracy and where == "accuracy." else None
                if written is not None and unit_exponents(written) != unit_exponents(one.unit):
                    raise ValueError(f"the accuracy is in {written}, but the quantity is in {one.unit}")
            except ValueError as error:
                raise ValueError(f"{where}{name}: {error}") from None

    def _recorded_bodies_are_flexible(self) -> None:
        for key in OF_FLEXIBLE:
            for name in getattr(self.output, key) or ():
                if name not in self.flexible():
                    known = ", ".join(self.flexible()) or "none"
                    raise ValueError(f"output.{key}: '{name}' is not a flexible body of this scene; known: {known}")

    @model_validator(mode="before")
    @classmethod
    def _method_by_need(cls, table: Any) -> Any:
        """Note whether the integrator is left open, before it gets its default."""
        accuracy, solver = (table.get(key) for key in ("accuracy", "solver")) if isinstance(table, dict) else (0, 0)
        if not isinstance(solver, dict | None):
            return table
        given = set(solver or ())
        if "by_need" not in given:
            left_open = not {"integrator", "step"} & given and ("integrator" if "rtol" in given else True)
            table = {**table, "solver": {**(solver or {}), "by_need": left_open}}
        elif (solver or {})["by_need"]:
            given -= set(NAMING)  # a scene that is edited is written out with its defaults
        if not isinstance(accuracy, dict) or "by_need" in accuracy:
            return table
        return {**table, "accuracy": {**accuracy, "by_need": not {"integrator", "step"} & given}}

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        self.check()
        return self

    def check(self) -> None:
        """Raise ValueError where valid parts and settings conflict with each other, and ResourceError where they
        request more than `[limits]` allows."""
        check_rows((self.time.end - self.time.start) / self.output.interval, self.output.interval, self.limits)
        if self.ensemble is not None:
            check_members(self.ensemble.members, self.limits)
        self._samples_can_be_made()
        self._quantities_are_there()
        check_formulas(self)
        self._recorded_bodies_are_flexible()
        require_possible(self)

    def by_need(self) -> bool:
        """Return True when the program chooses the integrator: for a requested accuracy, or as the scene names none."""
        if self.accuracy is None or not self.accuracy.quantities:
            return bool(self.solver.by_need)
        return bool(self.accuracy.by_need)

    def owners(self) -> dict[str, dict[str, bool]]:
        """Return the names of the components that may own a quantity, by kind, and whether each acts about an axis."""
        return owners(self)

    def requested_quantities(self) -> list[Quantity]:
        """Return the quantities that `[accuracy]` names; without it the usual ones."""
        if self.accuracy is not None and self.accuracy.quantities:
            return [parse(name, self.owners()) for name in self.accuracy.quantities]
        moving = {name for name, body in self.body.items() if not isinstance(body, Ground)}
        joints = {
            name: [frame.partition(".")[0] for frame in joint.between if frame.partition(".")[0] in moving]
            for name, joint in self.joint.items()
            if joint.type != "fixed"
        }
        hosts = self._hosts()
        known = self._driven_bodies()
        pairs = {n: [hosts[b] for b in pair] for n, pair in joints.items()}
        free = {n: [b for b in pair if b not in known] for n, pair in pairs.items()}
        chosen = default_quantities(free if any(free.values()) else pairs, tuple([*self.pairs(), *self.stop_ends()]))
        return [parse(one.name, self.owners()) for one in chosen]

    def _driven_bodies(self) -> set[str]:
        """Return rigid bodies whose motion drives determine: fixed to ground, or by driven joints of one freedom."""
        driven = {getattr(drive, "joint", None) for drive in self.drive.values()}
        prescribed = [j for n, j in self.joint.items() if j.type == "fixed" or (j.type in SINGLE and n in driven)]
        known = {name for name, body in self.body.items() if isinstance(body, Ground)}
        known_bodies = set(known)
        for _ in prescribed:
            for joint in prescribed:
                pair = {frame.partition(".")[0] for frame in joint.between}
                if pair & known_bodies:
                    known_bodies |= {name for name in pair if not isinstance(self.body.get(name), FlexibleBody)}
        return known_bodies - known

    def watched_quantities(self) -> list[Quantity]:
        """Return the quantities that are examined: those that `[view]` names, else those of `requested_quantities`."""
        if self.view is not None and self.view.watch is not None:
            return [parse(name, self.owners()) for name in self.view.watch]
        return self.requested_quantities()

    def with_requested_output(self) -> Self:
        """Return the scene without stresses and loads of flexible bodies of which no quantity is examined."""
        terms = (term for q in (*self.requested_quantities(), *self.watched_quantities()) for term in q.terms())
        asked = {term.owner.partition(".")[0] for term in terms if KINDS[term.kind].variable in ON_REQUEST}
        output = Output.model_validate(self.output.without(self.flexible().keys() - asked))
        return self.model_copy(update={"output": output})

    def _hosts(self) -> dict[str, str]:
        """Return for every moving body the body that it is fixed to, or itself."""
        moving = [name for name, body in self.body.items() if not isinstance(body, Ground)]
        host = {name: name for name in moving}
        for joint in self.joint.values():
            a, b = (frame.partition(".")[0] for frame in joint.between)
            if joint.type == "fixed" and a in host and b in host:
                old, new = host[b], host[a]
                host = {name: new if at == old else at for name, at in host.items()}
        return host

    _name: str = PrivateAttr(default="scene")
    _path: Path | None = PrivateAttr(default=None)
    #: the table that the scene was read from, with rods that are cut into segments as one body
    _whole: dict[str, Any] | None = PrivateAttr(default=None)

    @property
    def name(self) -> str:
        """Path below the scenes folder without suffix, e.g. ``sps4/csj``."""
        return self._name

    @property
    def path(self) -> Path | None:
        """File that the scene was read from."""
        return self._path

    def __repr__(self) -> str:
        """Return one line, since a whole scene fills pages."""
        return f"<Scene {self.name}: {self.summary()}; {self.time.start:g} to {self.time.end:g} s>"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        """Return the title, the times, a picture and a table of the parts by kind, for a notebook."""
        return as_html(self)

    def summary(self) -> str:
        """Return the numbers of parts by kind, in words."""
        planes = sum(not joint.hollow for joint in self.contacts().values())
        counts = {
            ("rigid body", "rigid bodies"): len(self.rigid()) + len(self.meshed_bodies()),
            ("flexible body", "flexible bodies"): len(self.flexible()),
            ("joint", "joints"): len(self.joint) - len(self.contacts()),
            ("joint with clearance", "joints with clearance"): len(self.contacts()) - planes,
            ("ball on a plane", "balls on planes"): planes,
            ("drive", "drives"): len(self.drive),
            ("load", "loads"): len(self.load),
            ("stop", "stops"): len(self.stop),
            ("gear", "gears"): len(self.gear),
            ("event", "events"): len(self.event),
        }
        return ", ".join(f"{n} {one if n == 1 else many}" for (one, many), n in counts.items() if n)

    def rigid(self) -> dict[str, RigidBody]:
        """Return the rigid bodies by name."""
        return {n: b for n, b in self.body.items() if isinstance(b, RigidBody)}

    def flexible(self) -> dict[str, FlexibleBody]:
        """Return the flexible bodies by name."""
        return {n: b for n, b in self.body.items() if isinstance(b, FlexibleBody)}

    def rods(self) -> dict[str, list[str]]:
        """Return the flexible bodies by name, of a rod in segments by the rod's: itself, or the segments."""
        result: dict[str, list[str]] = {}
        for name, body in self.flexible().items():
            whole = name if body.segment is None else name.removesuffix(f"_{body.segment[0]}")
            result.setdefault(whole, []).append(name)
        return result

    def meshed_bodies(self) -> dict[str, MeshedRigidBody]:
        """Return the rigid bodies with mass, inertia and frames of a mesh recipe, by name."""
        return {n: b for n, b in self.body.items() if isinstance(b, MeshedRigidBody)}

    def recipes(self) -> dict[str, str]:
        """Return the mesh recipe of each body that has one, by name: flexible bodies first."""
        flexible = {name: body.mesh for name, body in self.flexible().items()}
        return flexible | {name: body.mesh for name, body in self.meshed_bodies().items()}

    def contacts(self) -> dict[str, Clearance]:
        """Return the joints of surfaces in contact by name: with clearance, in a slot, on a plane."""
        return {n: j for n, j in self.joint.items() if isinstance(j, CONTACTS)}

    def pairs(self) -> dict[str, Pair]:
        """Return the pairs of features that may touch, by name in records: of the joint, if that has one pair only."""
        pairs = ((name, pair) for name, joint in self.contacts().items() for pair in joint.pairs.items())
        return {f"{name}.{own}" if own else name: pair for name, (own, pair) in pairs}

    def wearing_joints(self) -> dict[str, Clearance]:
        """Return the joints with clearance whose wear is computed, by name."""
        return {n: j for n, j in self.contacts().items() if getattr(j, "wear", None) is not None}

    def stop_ends(self) -> list[str]:
        """Return the names of all ends of stops, as in records."""
        return [f"{name}.{end}" for name, stop in self.stop.items() for end in stop.ends]

    def joints_with_friction(self) -> dict[str, IdealJoint]:
        """Return the ideal joints with friction, by name."""
        return {n: j for n, j in self.joint.items() if isinstance(j, IdealJoint) and j.friction is not None}

    def forces(self) -> dict[str, Any]:
        """Return the loads other than gravity, which is a field, by name."""
        return {n: load for n, load in self.load.items() if not isinstance(load, Gravity)}

    def sources(self) -> dict[str, str]:
        """Return the provenance of each value: ``part.key`` (or ``part``) -> text."""
        given = provenance.sources(self.model_dump())
        return {where or "scene": text for where, text in given.items()}

    def assumptions(self) -> dict[str, str]:
        """Return the sources of the form ``assumed: why``."""
        return provenance.assumed_values(self.sources())
