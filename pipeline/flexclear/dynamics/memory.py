"""The memory that connects scenes, routines and compiled steps: every index, row and field is declared once, here or by
its effect (`effects`).

The code of steps depends only on the kinds of parts present. All else is in four flat arrays:

- ``h`` (integers): a header with sizes and offsets, then the topology tables;
- ``f`` (floats): the numbers of the scene;
- ``w`` (floats): the work space, with the integrator's state and stages;
- ``n`` (integers): values that change during a run.

Kernels read and write these arrays by the names that are declared here (`fields`), routines as cells of tables
(`mechanics.tables`).  Python reads the same rows by the names of their fields (`named`), and rows of the record by
their contents (`integrate.recording`).  ``h[m.NV]`` is a size, ``h[m.Y]`` the index in w where an array begins,
``h[m.LINKS.at]`` that of a table in its array, and ``m.LINKS.parent`` the offset of a field in a row of the table.

Arrays are flat, since calls and compilation cost in proportion to their arguments.  No two overlap, and the compiler
knows: a value read from h stays valid after any write to w.  A kernel that writes never receives an array twice.

Terms: a *link* is a body after rigidly joined ones are merged (link 0 is the ground). A *site* is a frame on a link
that a joint, closure, contact or load uses. A *port* is a site on a flexible link. A *coordinate* is one generalised
speed; free ones come first, in the order of elimination (descendants before ancestors), prescribed ones after. A
*stretch* is an array within w or n.

Modes are in X, U and the state as eigenmodes, in DU and JACOBIAN in their body's interface basis
(`model.interface_basis`).
"""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass
from functools import partial
from itertools import count
from math import prod
from typing import Any

import numpy as np

from flexclear.dynamics.effects.declared import EFFECTS
from flexclear.dynamics.kernels import kernel
from flexclear.scene.event_kinds import CLOSING as CLOSING
from flexclear.scene.event_kinds import COMPRESSION as COMPRESSION
from flexclear.scene.event_kinds import OPENING as OPENING
from flexclear.scene.event_kinds import SLIPPING as SLIPPING
from flexclear.scene.event_kinds import STICKING as STICKING

_index = count()
#: tables in h, f and w, in the order of the arrays
TABLES: dict[str, list[Any]] = {"h": [], "f": [], "w": []}
#: indices in the header of h by the names that kernels use (`fields`): of sizes, and of stretches of w
SIZES: dict[str, int] = {}
STRETCHES: dict[str, int] = {}
#: single floats of w by the names that kernels use: the index of their stretch in the header, and their offset there
FLOATS: dict[str, tuple[int, int]] = {}
#: lengths of stretches and tables of w, by their indices in the header: numbers per row, and the number of rows as a
#: sum of products of sizes (`?size`: 1, or 0 for a size of 0) and of the method's requirements (`Room`)
LENGTHS: dict[int, tuple[int, str]] = {}
#: NumPy types of rows of tables and layouts, by the class that declares them
_ROWS: dict[type, np.dtype[Any]] = {}


def _indices(number: int) -> list[int]:
    """Return the next indices of the header of h."""
    return [next(_index) for _ in range(number)]


def _sizes(declared: str) -> list[int]:
    """Return the next indices of the header of h, for sizes."""
    names = declared.split()
    indices = _indices(len(names))
    SIZES.update(zip(names, indices, strict=True))
    return indices


def _stretches(declared: str) -> list[int]:
    """Return the next indices of h's header, for stretches of w: "name:length", or the name where `_floats` sets it."""
    indices = []
    for name, _, length in (one.partition(":") for one in declared.split()):
        STRETCHES[name] = index = next(_index)
        LENGTHS[index] = (1, length)
        indices.append(index)
    return indices


def _numbered(declared: str) -> dict[str, int]:
    """Return the index of each name."""
    return {name: index for index, name in enumerate(declared.split())}


def _floats(stretch: int, declared: str) -> range:
    """Declare named floats in a stretch of w and return their offsets."""
    names = _numbered(declared)
    FLOATS.update({name: (stretch, offset) for name, offset in names.items()})
    LENGTHS[stretch] = (1, str(len(names)))
    return range(len(names))


def layout(declared: str, number: type[np.number[Any]] = np.float64, kind: str = "Layout", **at: int) -> Any:
    """Declare a row: the offset of each field, and its `size`, preceded by its header index if it is of a table.

    declared: "name", "name:length" or "name:rowsxcolumns" of each field.  number: type of the entries.
    """
    parts = (field.partition(":") for field in declared.split())
    fields = {name: tuple(int(k) for k in shape.split("x")) if shape else () for name, _, shape in parts}
    begins = np.cumsum([0, *(prod(shape) for shape in fields.values())]).tolist()
    make: Any = namedtuple
    row = make(kind, [*at, *fields, "size"])
    _ROWS[row] = np.dtype([(name, number, shape) for name, shape in fields.items()])
    return row(*at.values(), *begins)


def _table(array: str, declared: str, count: str = "") -> Any:
    """Declare a table: its index `at` in the header, the `size` of its rows, and the offset of each field.

    count: number of rows of a table in w, written as in `LENGTHS`.
    """
    table = layout(declared, np.int64 if array == "h" else np.float64, "Table", at=next(_index))
    TABLES[array].append(table)
    if count:
        LENGTHS[table.at] = (table.size, count)
    return table


topology, numbers, work = partial(_table, "h"), partial(_table, "f"), partial(_table, "w")


def named(rows: Any, entries: np.ndarray) -> np.ndarray:
    """Return a view of entries with named fields; rows of a table or layout follow each other along the last axis."""
    return entries.view(row_type(rows))


def row_type(rows: Any) -> np.dtype[Any]:
    """Return the NumPy type of rows of a table or layout, with named fields."""
    return _ROWS[type(rows)]


@dataclass(frozen=True)
class Room:
    """Work space that an integration method needs: rows of the state's length, floats, vectors and square matrices of
    that length; pairs (z, z') and quadratures, each for all oscillators of the modes."""

    slopes: int
    dense: int
    floats: int = 0
    vectors: int = 0
    matrices: int = 0
    oscillations: int = 0
    quadratures: int = 0


# Header of h: sizes --------------------------------------------------------------------------------------------------
# fmt: off
(
    N_LINKS, N_SITES, N_FLEX, N_CLOSURES, N_CLOSURE_ROWS, N_KEPT_ROWS, N_CONTACTS, N_DRIVES, NQ, NV, NY, N_LEDGER,
    N_GROUPS, JACOBIAN_SIZE, N_LAWS, N_LOADS,
    N_INTERNAL, N_SURFACES, N_COMPONENTS, N_GUARDS, N_LOAD_BENDS, N_LOAD_NUMBERS, N_CHANGES,
    F_CHANGE, W_CHANGE,
) = _sizes("n_links n_sites n_flex n_closures n_closure_rows n_kept_rows n_contacts n_drives nq nv ny n_ledger "
    "n_groups jacobian_size n_laws n_loads n_internal "
    "n_surfaces n_components n_guards n_load_bends n_load_numbers n_changes f_change w_change",
)
# fmt: on
_sizes(" ".join(name for effect in EFFECTS for name in effect.sizes))
#: addresses of functions, zero until the engine writes them (`compile.calls`). EVALUATE: stores all that the record has
#: (`mechanics.record`), by the list RECORD_CALLS; RATES: what steps evaluate, that or one which stores only what they
#: read; CALLS: its list, if any; RUN: runs those of `mechanics.responses`
EVALUATE, PROJECT, PRESCRIBE, RESOLVE, RATES, CALLS, RECORD_CALLS, *_ = ADDRESSES = _indices(11)
RUN, CLOSE, MOVE, SPRINGS = ADDRESSES[7:]

# Topology in h -------------------------------------------------------------------------------------------------------
#: inboard_port: port of a flexible link's inboard frame or -1; component: independent mechanism that it belongs to, -1
#: for the ground
LINKS = topology("parent joint q0 c0 n_speeds flex inboard_port component")
SITES = topology("link port")  # port: or -1
#: data0: first of its numbers; inboard: 1 when modes move the inboard frame; coupled: 1 when modes have common entries
#: of the mass matrix; n_held: shapes of the interface basis that move no frame, its first ones; basis0, n_basis:
#: entries of the basis; interface0: first of its numbers in that basis; book: index in the ledger of its damping loss
FLEXES = topology("link n_modes q0 c0 data0 moment0 moment_row0 inboard coupled n_held basis0 n_basis interface0 book")
BASIS = topology("mode shape")  # entries of the interface basis, shape after shape (`model.interface_basis`)
MOMENTS = topology("mode")  # mode i of MOMENT_VALUES, row after row
MOMENT_ROWS = topology("end")  # per body and row (3k + l) n + j of these: index in MOMENTS after its last one
PORTS = topology("flex shapes")  # shapes: the first one's numbers, of moving shapes
#: jacobian0: of its entries in JACOBIAN, row after row; coupling: index of its coupling, or -1
CLOSURES = topology("site_a site_b row0 n_rows support0 n_support jacobian0 kept0 n_kept coupling")
CLOSURE_ROWS = topology("kind a b")  # (0, i, 0): along axis i of frame A; (1, k, l): axis k of A against axis l of B
SUPPORT = topology("coordinate")  # coordinates on which a closure depends
#: outer, inner: sites; friction: its law or -1; bristle: index of the bristles' deflection in the state or -1
#: surfaces: their kind; the gauge of a stop.  subtracted: the gauge of the coordinate that a stop subtracts, or -1
CONTACTS = topology("outer inner normal friction surfaces bristle subtracted")
LAWS = topology("piece0 n_pieces")  # the drives' laws first
PIECE_HARMONICS = topology("harmonic0 n_harmonics last")  # last: see `drives.pieces.Pieces.last`
#: kind: of `effects.Parts`; a: site, -1 where the reaction acts on the world; gauge, measured: of the joint coordinate
#: that it acts along, and of one that it measures, or -1; internal0: first of its states; follows: 1 when it turns with
#: its frame; look0, bend0: its first of LOOKS and LOAD_BENDS; book: index in the ledger of its work, which its loss
#: follows
LOADS = topology("kind a b law0 number0 gauge measured internal0 follows look0 bend0 book")
LOOKS = topology("index")  # arguments of expressions: index of a site, or of a gauge
#: measurement of a joint coordinate between sites a and b: turning or sliding, frame (side) and axis, entries of R_FG;
#: turns: index of the angle with its full turns among the internal states or -1
GAUGES = topology("a b turns turning side axis sine_f sine_g cosine_f cosine_g")
#: quantities on which steps end: the vector of `components` numbers from `offset` on in the table of w with this header
#: index.  contact: one that must be closed, or -1; bearing: one whose load is the scale, or -1
GUARDS = topology("table offset components contact bearing")
GROUPS = topology("group")  # error group of each state variable
BOOKS = topology("work loss load")  # of each independent mechanism: indices in the ledger (`DRIVE_WORK`, ...)
DRIVES = topology("book")  # index in the ledger of each drive's work

# Numbers in f --------------------------------------------------------------------------------------------------------
#: inertia about the centre of mass (xx yy zz xy xz yz), link axes; borne, reaching: mass of the link and all beyond,
#: and a bound of their polar moment about its origin
LINK_NUMBERS = numbers("mass com:3 inertia:6 borne reaching")
SITE_NUMBERS = numbers("origin:3 axes:3x3")  # in the link
FLEX_NUMBERS = numbers("mass first_moment:3 second_moment:3x3 untilted:6")  # untilted: of sections that only twist
FLEX_DATA = numbers("value")  # per body: C1 (3n), E (9n), modal mass (n n), stiffness, damping (n); stiffening 3 (n n)
MOMENT_VALUES = numbers("position rate")  # F + L and F of `mechanics.flexible`
BASIS_VALUES = numbers("value")
INTERFACE_DATA = numbers("value")  # per body, in the interface basis: C1 (3n), modal mass (n n), stiffness (n n)
PORT_NUMBERS = numbers("origin:3 axes:3x3")  # undeformed
PORT_DATA = numbers("value")  # per port, r moving shapes: translation (3r), rotation (3r); with stiffening 6 (r r)
#: radius: of the inner surface; stiffness, exponent, damping, values: of the normal law (`contact.law.Numbers`); shape:
#: further numbers of its kind of surfaces; length: size of the mechanism that it belongs to
CONTACT_NUMBERS = numbers(
    "clearance radius floor stick_speed stiffness exponent damping values:12 friction_law:6 shape:3 length"
)
#: per contact: pieces of an elastic force by an expression (`contact.normal.expression`), its tables, those of friction
CONTACT_TABLES = numbers("value")
PIECES = numbers("start coefficients:8")
HARMONICS = numbers("amplitude frequency phase")  # angular frequency
LOAD_NUMBERS = numbers("value")  # see `loads`
#: of each guard. level: magnitude to detect, 0: a reversal; scale: unit of closeness
GUARD_NUMBERS = numbers("level scale")
GRAVITY = numbers("acceleration:3")
#: per error group. magnitude: values below it are resolved absolutely, natural: likewise, from the size of the whole
#: mechanism; share: factor of its tolerance, so that each independent mechanism is resolved at least as well as alone
FLOORS = numbers("magnitude natural share")
CLOSURE_NUMBERS = numbers("extent")  # of the independent mechanism [m], so that the loops of small ones close as well

# Work space in w -----------------------------------------------------------------------------------------------------
#: a frame in world axes; the velocity is that of its origin
_FRAME = "origin:3 axes:3x3 omega:3 velocity:3 alpha:3 acceleration:3"
FRAME = layout(_FRAME)
X, U, DU = _stretches("x:nq+n_drives u:nv+n_drives du:nv+n_drives")
LINK_FRAMES, SITE_FRAMES = work(_FRAME, "n_links"), work(_FRAME, "n_sites")
WRENCH = work("moment:3 force:3", "n_links")
RESIDUAL, RESIDUAL_RATE = _stretches("residual:n_closure_rows residual_rate:n_closure_rows")
#: ROOTS: per selected row the reciprocal of the diagonal entry of the factor of J M^-1 J^T
#: ROW_SCALE: per selected row the largest diagonal entry of J M^-1 J^T over the accepted steps, then, after room for
#: all rows, that of the last evaluation, which may be a trial far away
JACOBIAN, ROOTS, ROW_SCALE, PIVOT = _stretches(
    "jacobian:jacobian_size roots:n_closure_rows row_scale:2*n_closure_rows pivot"
)
#: per selected row its independence of those before it, at the end of the step, at its start, and the largest value so
#: far; rows of the state's length: the Chebyshev series that passes a singular pose
INDEPENDENCE = work("now past most", "n_closure_rows")
COLLOCATION_ROWS = 13
(COLLOCATION,) = _stretches(f"collocation:{COLLOCATION_ROWS}*ny*?n_closure_rows")
#: smallest pivot of J M^-1 J^T as fraction of its row's largest diagonal entry (1: orthogonal rows, 0: dependent or
#: zero rows): of the last evaluation; limit below which the stepper requests other rows
LAST_PIVOT, LEAST_PIVOT = _floats(PIVOT, "last_pivot least_pivot")
#: present result of a contact; bent: energy stored in the bristles
TOUCH = work(
    "gap rate normal_force friction_power damping_power stored bent slip force:3 offset:3 point:3", "n_contacts"
)
#: on the closures' second bodies; of an independent mechanism its kinetic energy, potential energy of gravity, and the
#: energy stored in bodies, springs and contacts [J]
CLOSURE_WRENCH, ENERGY = work("moment:3 force:3", "n_closures"), work("kinetic potential elastic", "n_components")
LAW = work("value rate second_rate", "n_laws")
#: present result of a load: force on b, its moment about the mechanism's origin, length or coordinate, its rate, stored
#: energy, supplied power, lost power
LOAD = work("force:3 moment:3 value rate stored power loss", "n_loads")
#: of loads with kinks: speeds along their coordinates, arguments of max, min and abs
LOAD_BENDS = work("now", "n_load_bends")
DRIVE_FORCE, Y, Y_NEW, Y_STAGE, SLOPES, DENSE = _stretches(
    "drive_force:n_drives y:ny y_new:ny y_stage:ny slopes:slopes*ny dense:dense*ny"
)
#: memory of a method between steps (`Room`), up to QUADRATURES
MEMORY, VECTORS, MATRICES = _stretches("memory:floats vectors:vectors*ny matrices:matrices*ny*ny")
#: of `integrate.modal_basis`, one oscillator per speed at most: omega^2 [1/s^2], damping [1/s], root of the stiffness
#: of a mode's spring; the rows of Q^T, K^1/2 P K^1/2 and C, the columns of B, accelerations by the springs
OSCILLATORS = work("square damping root", "?oscillations*nv")
AXES, COUPLING, READING, LIFTING, RESPONSE = _stretches(
    "axes:?oscillations*nv*nv coupling:?oscillations*nv*nv reading:?oscillations*nv*nv "
    "lifting:?oscillations*nv*ny response:?oscillations*nv*ny"
)
#: (z, z') of each oscillator; its phi functions in each quadrature, and the contributions of four sources to (z, z') by
#: them, weights of 1 and Lambda each (`integrate.exponential`)
OSCILLATIONS, QUADRATURES = work("z rate", "oscillations*nv"), work("phi:10 share:8", "quadratures*nv")
MAGNITUDE, LATCHED = _stretches("magnitude:n_groups latched:n_contacts")
#: watched values of a contact, at the start (0) and at the end (1) of the step; trend: rate of the force; slip_rate:
#: rate of the sliding speed, 0 where unknown; event_row: of its last closing; mode0, latched0: mode and impact rate
#: that hold within the step
WATCH = work(
    "gap0 rate0 force0 slip0 trend0 gap1 rate1 force1 slip1 trend1 event_row mode0 latched0 slip_rate0 slip_rate1",
    "n_contacts",
)
GUARDED, EXCURSION = work("start:3 end:3", "n_guards"), work("now largest", "n_groups")  # see `guards`, `recording`
(CONTROL,) = _stretches("control")

# Tables of effects ---------------------------------------------------------------------------------------------------
#: by the names that effects declare (`effects.effect`); those of effects that a mechanism lacks are empty
OF_EFFECTS: dict[str, Any] = {}
for _effect in EFFECTS:
    for _array, _tables in (("h", _effect.topology), ("f", _effect.numbers)):
        OF_EFFECTS |= {name: _table(_array, rows) for name, rows in _tables.items()}
    OF_EFFECTS |= {name: work(rows, number) for name, (number, rows) in _effect.work.items()}
    _stretches(" ".join(_effect.stretches))
HEADER = next(_index)

# the ledger before the contacts' variables (three deflections of each contact with bristles follow those): work of
# drives, loss of modal damping, both of the first independent mechanism; BOOKS has the indices for the others
DRIVE_WORK, MODAL_LOSS, CONTACT_SLOTS = range(3)
#: variables of a contact there: losses of its damping and of friction, impulse of its normal force
CONTACT_LEDGER = layout("damping friction impulse")
# report of an evaluation in n[EVALUATION]
OK, NOT_POSITIVE, SINGULAR, NOT_CLOSED, NOT_FINITE, JAMMED = range(6)

# Control floats, from w[h[CONTROL]] on -------------------------------------------------------------------------------
# time, next step, end of the segment, relative tolerance, length of the run, size of the mechanism, largest violation
# of a closure before projection, error norm of the last accepted step, largest growth of the next (1 after a
# rejection), length of fixed steps, the method's parameter, largest rate of a closure before projection, largest rate
# of the equations that a step met;
# then variables of `singular_step`: independence of the closure rows at the end of the step, time of its start, time of
# the next singular pose, distance before it at which the stepper stops, largest such distance (0: no stop), length of
# the polynomial that is ready (0: none), the fraction of it that the present step covers, the least ratio of a row's
# independence to its largest, steps in a row that ended in the blind range of a pose (`singular_step.BLIND`);
# then variables of `adaptive`: length and error norm of the step rejected last (0: none since the last accepted one),
# possible length of the last first step with a contact closed, flag for a segment's first accepted step;
# then of an attempt that waits for rates (`method.await_rates`): its length, its error norm, the state's time; end and
# length of a step whose events have been resolved (`stepper.make_resolution`)
# fmt: off
(
    TIME, STEP, END, RTOL, SPAN, LENGTH, DRIFT, LAST_NORM, MOST_GROWTH, FIXED, PARAMETER, RATE_DRIFT, STEEPEST,
    KNOT, SIGMA, PAST_TIME, PASS_TIME, REACH, MOST_REACH, COLLOCATED, FRACTION, LEFT, BLIND_STEPS,
    REJECTED_STEP, REJECTED_NORM, TOUCHED_STEP, FIRST, TRIED, NORM, AWAITED_TIME, RESOLVED_END, RESOLVED_STEP,
) = _floats(
    CONTROL,
    "time step end rtol span length drift last_norm most_growth fixed parameter rate_drift steepest "
    "knot sigma past_time pass_time reach most_reach collocated fraction left blind_steps "
    "rejected_step rejected_norm touched_step first tried norm awaited_time resolved_end resolved_step",
)
# fmt: on

# Integers in n -------------------------------------------------------------------------------------------------------
# report of the last evaluation; where active pieces and modes start in n, and its state in w; flag for an evaluation
# that stored only values that steps read; flag for awaited rates that other code computes; the stepper's own, last a
# step's stage, where its state and rates are, and a flag for dense output of a step whose events have been resolved
_INTEGERS = _numbered(
    "evaluation active mode state abridged together status evaluations steps rejected next_output n_recorded n_events "
    "n_between budget cap fresh immediate projections projection_evaluations jacobians culprit stiff_steps stage "
    "awaited rates_in extended"
)
# fmt: off
(
    EVALUATION, ACTIVE, MODE, STATE, ABRIDGED, TOGETHER,
    STATUS, EVALUATIONS, STEPS, REJECTED, NEXT_OUTPUT, N_RECORDED, N_EVENTS, N_BETWEEN, BUDGET, CAP, FRESH, IMMEDIATE,
    PROJECTIONS, PROJECTION_EVALUATIONS, JACOBIANS, CULPRIT, STIFF_STEPS, STAGE, AWAITED, RATES_IN, EXTENDED,
) = _INTEGERS.values()
# fmt: on
INTEGERS = len(_INTEGERS)

# Table of lanes (`compile.lanes`) -------------------------------------------------------------------------------------
# state of a lane: unused, its stepper may proceed, waits for rates, has ended
LANE_IDLE, LANE_READY, LANE_WAITING, LANE_DONE = range(4)
# words of the table: whether to return at once, then of each lane its state, the address of its stepping function, and
# the arguments of that: h, f, w, n, and eight of the record
LANES_CALLED_BACK, LANES_HEAD, LANE_FUNCTION, LANE_ARGUMENTS, LANE_WORDS = 0, 1, 1, 2, 14
#: stretches of n by the names that kernels use (`fields`), and the other integers there
LISTS = {"active": ACTIVE, "mode": MODE}
REPORTS = {name: index for name, index in _INTEGERS.items() if name not in LISTS}
# values of n[STATUS]
SEGMENT_END, PAUSED, CAP_REACHED, FULL, STEP_TOO_SMALL, NO_START, STUCK_EVENT, LOST_CLOSURE = range(8)
NOT_A_NUMBER, NO_CONVERGENCE, WORN_ROWS, AT_SINGULAR, STEPPED_OVER, SINGULAR_AHEAD = range(8, 14)

# Names of tables for kernels (`fields`) -------------------------------------------------------------------------------
NAMED: dict[str, Any] = {
    name.lower(): value for name, value in list(globals().items()) if type(value).__name__ == "Table"
} | OF_EFFECTS
#: header indices of the offsets of stretches of w, and of tables
INDICES = {f"at_{name}": index for name, index in STRETCHES.items()}
INDICES |= {f"at_{name}": table.at for name, table in NAMED.items()}
ARRAYS = {name: array for name, table in NAMED.items() for array in TABLES if table in TABLES[array]}
#: shapes of fields that are tuples, and their numbers of entries
TUPLES: dict[tuple[int, ...], int] = {(3,): 3, (3, 3): 9}


def row_fields(name: str) -> dict[str, tuple[int, tuple[int, ...]]]:
    """Return offset and shape of each field in a row of the table `name`."""
    rows: Any = row_type(NAMED[name])
    return {field: (rows.fields[field][1] // rows[field].base.itemsize, rows[field].shape) for field in rows.names}


# The record ----------------------------------------------------------------------------------------------------------
#: a row of the event table; speed: rate of penetration at a closing, its negative at an opening [m/s]
EVENT = layout("contact kind time speed peak_force peak_depth duration")
#: free rows that one step may need: of the record; of the events, per contact
ROOM, EVENTS_OF_A_CONTACT = 8, 4
#: rate of the force of a beginning contact: increases at an unknown rate
STEEPLY = 1e300


def columns_of_record(contacts: int) -> tuple[int, int, int]:
    """Return the first columns of modes, impact rates and state in a row of the record, whose first is the time."""
    return 1, 1 + contacts, 1 + 2 * contacts


record_columns = kernel(columns_of_record)
