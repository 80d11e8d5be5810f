"""Places of what only the closures have: rows that are solved for, and how independent they are."""

from __future__ import annotations

from pipeline.dynamics.tables import place

#: sizes in the header: rows that are solved for, room for J on its supports, pairs of closures that share coordinates
N_KEPT_ROWS, JACOBIAN_SIZE, N_CLOSURE_PAIRS = (place(n) for n in ("N_KEPT_ROWS", "JACOBIAN_SIZE", "N_CLOSURE_PAIRS"))
#: per kept row the largest diagonal entry of J M^-1 J^T so far; then what follows
ROW_SCALE, PIVOT = place("ROW_SCALE"), place("PIVOT")
# smallest pivot of J M^-1 J^T as share of its row's largest diagonal entry so far (1: rows at right angles, 0:
# dependent or nothing): of the last evaluation; below which the stepper asks for other rows
LAST_PIVOT, WANTED_PIVOT, PIVOT_SIZE = range(3)
