"""Runs with events: a run is a sequence of phases, each the run of an ordinary scene.

A phase ends where an event happens. The next one begins in that state with the scene that the event leaves: without a
part, with a coordinate held, or with a part exchanged. One dataset records all phases.
Only scenes with events import this package.
"""
