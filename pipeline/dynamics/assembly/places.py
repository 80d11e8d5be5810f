"""Places of what only the closures have: which rows are solved for, and how independent they are."""

from __future__ import annotations

from pipeline.dynamics.tables import place

#: sizes: rows that are solved for, room for J on its supports, entries of J M^-1 J^T, pairs of closures that share
#: coordinates, entries of prescribed coordinates
N_KEPT_ROWS, JACOBIAN_SIZE, SCHUR_SIZE = place("N_KEPT_ROWS"), place("JACOBIAN_SIZE"), place("SCHUR_SIZE")
N_CLOSURE_PAIRS, N_KNOWN_ENTRIES = place("N_CLOSURE_PAIRS"), place("N_KNOWN_ENTRIES")
#: wiring
CLOSURE_ROWS, SUPPORT, ENTRIES = place("CLOSURE_ROWS"), place("SUPPORT"), place("ENTRIES")
KNOWN_ENTRIES = place("KNOWN_ENTRIES")
CLOSURE_PAIRS, COMMON, CLOSURE_ENVELOPE = place("CLOSURE_PAIRS"), place("COMMON"), place("CLOSURE_ENVELOPE")
#: work space; ROW_SCALE: per kept row the largest diagonal entry of J M^-1 J^T over the accepted steps, then, after
#: room for all rows, that of the last evaluation, which may be a trial far away; PIVOT: what follows
GAMMA, JACOBIAN, SPREAD, SCHUR = (place(name) for name in ("GAMMA", "JACOBIAN", "SPREAD", "SCHUR"))
ROW_SCALE, PIVOT = place("ROW_SCALE"), place("PIVOT")
# smallest pivot of J M^-1 J^T as share of its row's largest diagonal entry (1: rows at right angles, 0:
# dependent or nothing): of the last evaluation; below which the stepper asks for other rows
LAST_PIVOT, WANTED_PIVOT, PIVOT_SIZE = range(3)
