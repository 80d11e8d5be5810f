"""The forces that hold a mechanism in its known motion, in which the rates of free speeds are zero."""

from __future__ import annotations

from flexclear.dynamics.mechanics import trees as t
from flexclear.dynamics.mechanics.evaluation import apply_actions, place_links
from flexclear.dynamics.mechanics.mechanism import Mechanism
from flexclear.dynamics.routines.calls import CallList


def store_holding_forces(mechanism: Mechanism, multipliers: t.Numbers, calls: CallList) -> None:
    """Append the calls that store these forces in place of the rates of speeds: on coordinates and on shapes.

    multipliers: sizes of the wrenches of all closure rows, which act as well; friction of joints does not.
    """
    with calls.building():
        place_links(mechanism)
        apply_actions(mechanism, calls)
        for one in mechanism.closures:
            count, ends = len(one.scales), (frame.placed for frame in one.frames)
            sizes, multipliers = multipliers[:count], multipliers[count:]
            _, *wrenches = calls.store(one.results, one.routine, *one.given, count, *ends)
            for frame, on_body in zip(one.frames, wrenches, strict=True):
                frame.resist(t.pull(on_body, sizes))
        for link in reversed(mechanism.links):
            if modes := link.modes:
                on_shapes, link.rest = modes.hold(modes.need(link.motion, masses=False), link.beyond)
                calls.write(modes.rates[len(modes.q) :], on_shapes)
            else:
                link.rest = t.resist(link.motion, link.body, link.beyond)
            forces, rest = t.holding_forces(link.step, link.rest)
            calls.write(link.rates[len(link.coordinates.x) :], forces if link.rates else [])
            link.frame.resist(rest)
