"""Checks that `flexclear check` and every run make alike: of each part, and of the mechanism at its start."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from flexclear.dynamics.model import contacts
from flexclear.dynamics.model.driving import joint_drives, named_coordinate
from flexclear.dynamics.model.gears import coordinates_and_ratio, couplings
from flexclear.dynamics.model.laws import NO_LAWS, drive_laws
from flexclear.dynamics.model.loads import acting_frames, describe
from flexclear.dynamics.model.mechanism import Mechanism
from flexclear.dynamics.model.start_table import given_coordinates
from flexclear.dynamics.model.stops import End, ends
from flexclear.dynamics.model.wear import shapes_of
from flexclear.scene.drives import PathDrive
from flexclear.scene.schema import Scene, Sections
from flexclear.system.errors import InputError, errors_from

#: a check raises InputError
Check = Callable[[], object]


def part_errors(scene: Scene) -> list[InputError]:
    """Return the errors of drives, loads, stops, gears and start values that the scene's other numbers do not matter
    for: missing coordinates, wrong units, laws that jump or do not cover the run."""
    return errors_from(_checks_of_parts(scene))


def _checks_of_parts(scene: Scene) -> Iterator[Check]:
    for name, drive in scene.drive.items():
        yield partial(drive_laws, scene.model_copy(update={"drive": {name: drive}}), NO_LAWS)
        for actuator in (isinstance(drive, PathDrive) and drive.actuators) or ():
            yield partial(named_coordinate, scene, actuator, f"[drive.{name}.actuators]")
    yield partial(joint_drives, scene)
    yield from (partial(describe, scene, name) for name in scene.forces())
    yield partial(ends, scene, dict.fromkeys(scene.joint, 1.0))
    yield from (partial(coordinates_and_ratio, scene, name) for name in scene.rigid_gears())
    yield from (partial(shapes_of, scene, name) for name in scene.wearing_joints())
    if scene.start is not None and scene.start.at != "ideal":  # else joints with clearance have coordinates, too
        yield partial(given_coordinates, scene)


def mechanism_errors(scene: Scene, mechanism: Mechanism) -> list[InputError]:
    """Return the errors of contacts, gears and loads of a scene in a mechanism of its bodies.

    mechanism: may have ideal joints instead of the scene's joints with clearance.
    """
    stops = [contact for contact in mechanism.contacts if isinstance(contact.joint, End)]
    loads = (partial(_frames, scene, mechanism, name) for name in scene.forces())
    laws = (partial(contacts.resolve_one, mechanism, one) for one in (*mechanism.touching(scene.pairs()), *stops))
    return errors_from((*laws, partial(couplings, mechanism), *loads))


def _frames(scene: Scene, mechanism: Mechanism, load: str) -> tuple[str, ...]:
    return acting_frames(mechanism, load, describe(scene, load).row)


def section_period(scene: Scene) -> float:
    """Return the period of the sections [s], by default the run's length; raise InputError for one too long."""
    requested, span = scene.sections or Sections(), scene.time.end - scene.time.start
    period = requested.period or span
    if period > span * (1.0 + 1e-12):
        raise InputError(
            "[sections.period]",
            f"a period of {period:.6g} s is longer than the run, which defines the laws for {span:.6g} s",
            "let the run last at least one period",
        )
    if not requested.phase < period:
        raise InputError(
            "[sections.phase]",
            f"{requested.phase:.6g} s is not within the period of {period:.6g} s",
            "give a time from 0 to less than the period",
        )
    return period
