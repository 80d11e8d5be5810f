"""Runs with events: a run is a sequence of phases, each the run of an ordinary scene.

A phase ends where an event happens. The next one begins in that state with the scene that the event has made: a part
is gone, a coordinate is held, or a part has become another one. What is recorded of all phases is one dataset.
Only scenes with events import anything of this.
"""

KIND = "runner"
NAMES = {"phases": "phases:simulated"}
