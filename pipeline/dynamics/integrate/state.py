"""State of an integration, all of it in arrays, so that it can pause and go on to the same bits.

Floats stand in the work space from w[CONTROL] on, integers in n after those of `tables`; the
record is a table of rows (time, then per contact its mode and impact rate, then the state), the
events another.
"""

from __future__ import annotations

from pipeline.dynamics.tables import STATE as LAST

# control floats: time, next step, end of the segment, relative tolerance, length of the run,
# size of the mechanism, largest violation of a closure before projection, error norm of the last
# accepted step, largest growth of the next (1 after a rejection), length of fixed steps, the method's parameter,
# largest rate of a closure before projection, largest rate of the equations that a step met;
# then what `straddle` keeps: independence of the closure rows at the end of the step and at its start, its start,
# time of the next singular pose, whether the present step is laid over it, steps in a row that ended blindly near one;
# then what `adaptive` keeps: length and error norm of the step rejected last (0: none since the last accepted one),
# length of the last first step with a contact closed, whether the next accepted step is the first of a segment
TIME, STEP, END, RTOL, SPAN, LENGTH, DRIFT, LAST_NORM, MOST_GROWTH, FIXED, PARAMETER, RATE_DRIFT, STEEPEST = range(13)
SIGMA, PAST_SIGMA, PAST_TIME, PASS_TIME, STRADDLING, BLIND_STEPS = range(13, 19)
REJECTED_STEP, REJECTED_NORM, TOUCHED_STEP, FIRST, N_CONTROLS = range(19, 24)
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
    STIFF_STEPS,
    INTEGERS,
) = range(LAST + 1, LAST + 18)
# values of n[STATUS]
SEGMENT_END, PAUSED, CAP_REACHED, FULL, STEP_TOO_SMALL, NO_START, STUCK_EVENT, LOST_CLOSURE = range(8)
NOT_A_NUMBER, NO_CONVERGENCE, WORN_ROWS, AT_SINGULAR, STEPPED_OVER = 8, 9, 10, 11, 12
# columns of the events
EVENT_CONTACT, EVENT_KIND, EVENT_TIME, SPEED, PEAK_FORCE, PEAK_DEPTH, DURATION, EVENT_SIZE = range(8)
CLOSING, OPENING, COMPRESSION, STICKING, SLIPPING = range(5)
# per contact, what the stepper watches: at the start and at the end of the step gap, rate, normal force, sliding
# speed and rate of the force; row of its last closing; mode and impact rate that hold within the step;
# rate of the sliding speed at start and end, 0 where it is not known
GAP0, RATE0, FORCE0, SLIP0, TREND0, GAP1, RATE1, FORCE1, SLIP1, TREND1, EVENT_ROW, MODE0, LATCHED0 = range(13)
SLIP_RATE0, SLIP_RATE1, WATCH_SIZE = range(13, 16)
#: rate of the force of a contact that begins: grows, who knows how fast
STEEPLY = 1e300
#: free rows that one step may need: of the record; of the events, per contact
ROOM, EVENTS_OF_A_CONTACT = 8, 4
