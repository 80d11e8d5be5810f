"""Kinds of the events of a run: numbers in kernels and datasets, and their names."""

from __future__ import annotations

#: names by number, for attributes of datasets
EVENT_KINDS = ("opening", "closing", "compression", "sticking", "slipping")
OPENING, CLOSING, COMPRESSION, STICKING, SLIPPING = range(len(EVENT_KINDS))
#: changes that events of a scene make
CHANGES = ("release", "lock", "switch")
