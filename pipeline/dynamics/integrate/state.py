"""State of an integration, all of it in arrays, so that it can pause and go on to the same bits.

Floats stand in the work space from w[CONTROL] on, integers in n after those of `tables`; the
record is a table of rows (time, then per contact its mode and impact rate, then the state), the
events another.
"""

from __future__ import annotations

from pipeline.dynamics.tables import MODE

# control floats: time, next step, end of the segment, relative tolerance, length of the run,
# size of the mechanism, largest violation of a closure before projection, error norm of the last
# accepted step, largest growth of the next (1 after a rejection), length of fixed steps, the method's parameter;
# then what `straddle` keeps: independence of the closure rows at the end of the step and at its start, its start,
# time of the next singular pose, whether the present step is laid over it, steps in a row that ended blindly near one
TIME, STEP, END, RTOL, SPAN, LENGTH, DRIFT, LAST_NORM, MOST_GROWTH, FIXED, PARAMETER = range(11)
SIGMA, PAST_SIGMA, PAST_TIME, PASS_TIME, STRADDLING, BLIND_STEPS, N_CONTROLS = range(11, 18)
# integers
(
    STATUS,
    EVALUATIONS,
    STEPS,
    REJECTED,
    NEXT_OUTPUT,
    N_RECORDED,
    N_EVENTS,
    BUDGET,
    CAP,
    FRESH,
    IMMEDIATE,
    PROJECTIONS,
    PROJECTION_EVALUATIONS,
    JACOBIANS,
    CULPRIT,
    INTEGERS,
) = range(MODE + 1, MODE + 17)
# values of n[STATUS]
SEGMENT_END, PAUSED, CAP_REACHED, FULL, STEP_TOO_SMALL, NO_START, STUCK_EVENT, LOST_CLOSURE = range(8)
NOT_A_NUMBER, NO_CONVERGENCE, WORN_ROWS, AT_SINGULAR = 8, 9, 10, 11
# columns of the events
EVENT_CONTACT, EVENT_KIND, EVENT_TIME, SPEED, PEAK_FORCE, PEAK_DEPTH, DURATION, EVENT_SIZE = range(8)
CLOSING, OPENING = 0, 1
# per contact, what the stepper watches: gap and rate at both ends of the step, row of its last closing
GAP0, RATE0, GAP1, RATE1, EVENT_ROW, WATCH_SIZE = range(6)
#: free rows of record and events that one step may need
ROOM = 8
