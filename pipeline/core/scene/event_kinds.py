"""Kinds of the events of a run: kernels write these numbers, datasets hold them, and readers ask for them."""

from __future__ import annotations

#: names by number, in attributes of datasets
EVENT_KINDS = ("opening", "closing", "compression", "sticking", "slipping")
OPENING, CLOSING, COMPRESSION, STICKING, SLIPPING = range(len(EVENT_KINDS))
#: what events of a scene do
CHANGES = ("release", "lock", "switch")
