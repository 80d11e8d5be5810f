"""The memory through which scene and compiled kernels speak: every index, row and field is declared once,
here or by its effect (`effects`).

A kernel's code depends only on the kinds of parts present. Everything else is in four flat arrays that kernels take:

- ``h`` (integers): a header with sizes and offsets, then the wiring tables;
- ``f`` (floats): the numbers of the scene;
- ``w`` (floats): the work space, the integrator's state and stages included;
- ``n`` (integers): what changes while a run continues.

Kernels read and write all of it by the names that are declared here (`fields`).  Python reads the same rows by the
names of their fields (`named`), and rows of the record by what they hold (`integrate.recording`).  ``h[m.NV]`` is a
size, ``h[m.FORCE]`` the index in w where a stretch begins, ``h[m.LINKS.place]`` that of a table in its array, and
``m.LINKS.parent`` where a field begins in a row of it.

Arrays are flat, since calls and compilation cost what the arguments cost.  No two overlap, and the compiler knows:
what a kernel has read from h stays read, whatever it writes into w.  A kernel that writes never gets one of them twice.

Words: a *link* is a body after rigidly joined ones are merged (link 0 is the ground). A *site* is a frame on a link
that a joint, closure, contact or load uses. A *port* is a site on a flexible link. A *coordinate* is one generalised
speed; free ones come first, in the order of elimination (descendants before ancestors), prescribed ones after. A
*column* is the twist (angular velocity; velocity of the point at the kernels' origin) per unit of a coordinate; every
coordinate has one, and every port one more per moving shape of its body.

Modes are in X, U and the state as eigenmodes, in all else that has coordinates (DU, BIAS, COLUMNS, MASS, JACOBIAN,
...) in their body's interface basis (`bodies.interface`).
"""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass
from functools import partial
from itertools import count
from math import prod
from typing import Any

import numpy as np

from flexclear.pipeline.core.scene.event_kinds import CLOSING as CLOSING
from flexclear.pipeline.core.scene.event_kinds import COMPRESSION as COMPRESSION
from flexclear.pipeline.core.scene.event_kinds import OPENING as OPENING
from flexclear.pipeline.core.scene.event_kinds import SLIPPING as SLIPPING
from flexclear.pipeline.core.scene.event_kinds import STICKING as STICKING
from flexclear.pipeline.dynamics.effects.declared import EFFECTS
from flexclear.pipeline.dynamics.kernels import kernel

_place = count()
#: tables in h, f and w, in their order there
TABLES: dict[str, list[Any]] = {"h": [], "f": [], "w": []}
#: indices in the header of h by the names that kernels use (`fields`): of sizes, and of stretches of w
SIZES: dict[str, int] = {}
STRETCHES: dict[str, int] = {}
#: single floats of w by the names that kernels use: the index of their stretch in the header, and their offset there
FLOATS: dict[str, tuple[int, int]] = {}
#: how much of w there is of stretches and tables, by their indices in the header: numbers in a row, and how many rows
#: there are, as a sum of products of sizes (`?size`: 1, or 0 where it is 0), of what the method asks for (`Room`) and
#: of the number of columns
LENGTHS: dict[int, tuple[int, str]] = {}
#: rows of tables and layouts as NumPy has them, by the class of what declares them
_ROWS: dict[type, np.dtype[Any]] = {}


def _places(number: int) -> list[int]:
    """The next indices of the header of h."""
    return [next(_place) for _ in range(number)]


def _sizes(declared: str) -> list[int]:
    """The next indices of the header of h, of sizes."""
    names = declared.split()
    places = _places(len(names))
    SIZES.update(zip(names, places, strict=True))
    return places


def _stretches(declared: str) -> list[int]:
    """The next indices of the header of h, of stretches of w: "name:length", or the name where floats fill it."""
    made = []
    for name, _, length in (one.partition(":") for one in declared.split()):
        STRETCHES[name] = place = next(_place)
        LENGTHS[place] = (1, length)
        made.append(place)
    return made


def _numbered(declared: str) -> dict[str, int]:
    """Index of each name."""
    return {name: index for index, name in enumerate(declared.split())}


def _floats(stretch: int, declared: str) -> range:
    """Offsets of named floats in a stretch of w."""
    names = _numbered(declared)
    FLOATS.update({name: (stretch, offset) for name, offset in names.items()})
    LENGTHS[stretch] = (1, str(len(names)))
    return range(len(names))


def layout(declared: str, number: type[np.number[Any]] = np.float64, kind: str = "Layout", **place: int) -> Any:
    """Where the fields of a row begin, and its `size`, after its place in the header if it is of a table.

    declared: "name", "name:length" or "name:rowsxcolumns" of each field.  number: what its entries are.
    """
    parts = (field.partition(":") for field in declared.split())
    fields = {name: tuple(int(k) for k in shape.split("x")) if shape else () for name, _, shape in parts}
    begins = np.cumsum([0, *(prod(shape) for shape in fields.values())]).tolist()
    make: Any = namedtuple
    made = make(kind, [*place, *fields, "size"])
    _ROWS[made] = np.dtype([(name, number, shape) for name, shape in fields.items()])
    return made(*place.values(), *begins)


def _table(array: str, declared: str, count: str = "") -> Any:
    """A table: its `place` (index) in the header, `size` of its rows, and where each field begins.

    count: of rows of a table in w, as `LENGTHS` has it.
    """
    table = layout(declared, np.int64 if array == "h" else np.float64, "Table", place=next(_place))
    TABLES[array].append(table)
    if count:
        LENGTHS[table.place] = (table.size, count)
    return table


wiring, numbers, work = partial(_table, "h"), partial(_table, "f"), partial(_table, "w")


def named(rows: Any, entries: np.ndarray) -> np.ndarray:
    """Entries with named fields, a view; rows of a table or layout follow each other along the last axis."""
    return entries.view(row_type(rows))


def row_type(rows: Any) -> np.dtype[Any]:
    """Rows of a table or layout as NumPy has them, with named fields."""
    return _ROWS[type(rows)]


@dataclass(frozen=True)
class Room:
    """What an integration method needs of the work space: rows of the state's length, floats, vectors and square
    matrices of that length; pairs (z, z') and quadratures, each for all oscillators of the modes."""

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
    N_PAIRS, N_KNOWN_PAIRS, N_KNOWN_ENTRIES, N_CLOSURE_PAIRS, N_GROUPS, MASS_SIZE, SCHUR_SIZE, JACOBIAN_SIZE,
    MOST_MODES, N_LAWS, N_LOADS, N_INTERNAL, N_SURFACES, N_BODIES, N_FRAMES, N_COMPONENTS, N_GUARDS, N_LOAD_BENDS,
    N_CHANGES, F_CHANGE, W_CHANGE,
) = _sizes(
    "n_links n_sites n_flex n_closures n_closure_rows n_kept_rows n_contacts n_drives nq nv ny n_ledger n_pairs "
    "n_known_pairs n_known_entries n_closure_pairs n_groups mass_size schur_size jacobian_size most_modes n_laws "
    "n_loads n_internal n_surfaces n_bodies n_frames n_components n_guards n_load_bends n_changes f_change w_change",
)
# fmt: on
_sizes(" ".join(name for effect in EFFECTS for name in effect.sizes))
#: addresses of compiled functions, zero until the engine writes them (`compile.calls`)
#: RATES: of what the steps evaluate with, EVALUATE's or what leaves only what they read (`specialise`)
EVALUATE, PROJECT, RETRACT, PRESCRIBE, DESCRIBE, RESOLVE, RATES = ADDRESSES = _places(7)

# Wiring in h ---------------------------------------------------------------------------------------------------------
#: inboard_port: port of a flexible link's inboard frame or -1; carried_by: port of the parent that carries it or -1;
#: component: independent mechanism that it belongs to, -1 of the ground; leaf: whether it carries no other; first:
#: whether none of its parent's has a larger number
LINKS = wiring("parent joint q0 c0 n_speeds flex inboard_port carried_by component leaf first")
SITES = wiring("link port")  # port: or -1
#: data0: first of its numbers; inboard: whether modes move the inboard frame; coupled: whether modes have common
#: entries of the mass matrix; n_held: shapes of the interface basis that move no frame, its first ones; basis0,
#: n_basis: entries of the basis, of which those of moving shapes begin at moving0; interface0: first of its numbers in
#: that basis; book: place in the ledger of what its damping loses
FLEXES = wiring(
    "link n_modes q0 c0 data0 moment0 moment_row0 inboard coupled n_held basis0 n_basis moving0 interface0 book"
)
BASIS = wiring("mode shape")  # entries of the interface basis, shape after shape (`bodies.interface`)
MOMENTS = wiring("mode")  # mode i of int rho S_ki S_lj, row after row
MOMENT_ROWS = wiring("end")  # per body and row (3k + l) n + j of these: index in MOMENTS after its last one
PORTS = wiring("flex column shapes")  # column, shapes: first of them, those of moving shapes
PAIRS = wiring("momentum column entry")  # place in the mass matrix's envelope
KNOWN_PAIRS = wiring("momentum column drive coordinate")
#: rows of the mass matrix, or of the modal blocks that articulated inertias factor; those have 1/sqrt(D) of a joint's
#: coordinate as its row. first: column; origin: index of column 0, which may lie before that of the first
ENVELOPE = wiring("first origin")
#: threes: of rows that are solved for, which are adjacent in JACOBIAN and SPREAD and are worked on together; the
#: last of them may end with zeros.  coupling: that this closure is, or -1; path0, n_path: of its links in PATHS
CLOSURES = wiring(
    "site_a site_b row0 n_rows support0 n_support jacobian0 entry0 n_entries kept0 n_kept threes coupling path0 n_path"
)
CLOSURE_ROWS = wiring("kind a b")  # (0, i, 0): along axis i of frame A; (1, k, l): axis k of A against axis l of B
SUPPORT = wiring("coordinate")  # coordinates on which a closure depends
ENTRIES = wiring("slot column sign part")  # slot: in the support; part: of a coupling, 1 of its first joint
KNOWN_ENTRIES = wiring("closure drive column sign part")
#: links between the ground and a closure's ends, leaves first; slot, shapes, carrier: slots of the first coordinate of
#: the link's joint, of its first moving shape, and of its parent's, or -1
PATHS = wiring("link slot shapes carrier")
CLOSURE_PAIRS = wiring("a b common0 n_common")  # b >= a
COMMON = wiring("a b")  # slots of a common coordinate
CLOSURE_ENVELOPE = wiring("first origin")  # of the rows that are solved for
#: outer, inner: sites; friction: its law or -1; bristle: index of the bristles' deflection in the state or -1
CONTACTS = wiring("outer inner normal friction surfaces bristle")  # surfaces: their kind; of a stop its gauge
LAWS = wiring("piece0 n_pieces")  # the drives' laws first
PIECE_HARMONICS = wiring("harmonic0 n_harmonics")
#: a: site, -1 where the world holds against it; gauge, measured: of the joint coordinate that it acts along, and of one
#: that it measures, or -1; internal0: first of its states; follows: whether it turns with its frame; look0, bend0: its
#: first of LOOKS and LOAD_BENDS; book: where in the ledger its work is, and then its loss
LOADS = wiring("a b law0 number0 gauge measured internal0 follows look0 bend0 book")
LOOKS = wiring("index")  # what expressions read: number of a site, or of a gauge
LOAD_KINDS = wiring("load0 n_loads")
#: how a joint coordinate is measured between sites a and b: turning or sliding, frame (side) and axis, entries of R_FG;
#: turns: index of the angle with its full turns among the internal states or -1
GAUGES = wiring("a b turns turning side axis sine_f sine_g cosine_f cosine_g")
#: on what steps end: the vector of `components` numbers from `offset` on in the table of w that has this index in
#: the header.  contact: that must be closed, or -1; bearing: by whose load it is measured, or -1
GUARDS = wiring("table offset components contact bearing")
BODIES, FRAMES = wiring("link"), wiring("link")  # moving bodies and named frames: what is recorded, which no step reads
GROUPS = wiring("group")  # error group of each state variable
BOOKS = wiring("work loss load")  # of each independent mechanism: places in the ledger (`DRIVE_WORK`, ...)
DRIVES = wiring("book")  # place in the ledger of each drive's work

# Numbers in f --------------------------------------------------------------------------------------------------------
#: inertia about the centre of mass (xx yy zz xy xz yz), link axes; borne, reaching: mass of the link and all beyond,
#: and a bound of their polar moment about its origin
LINK_NUMBERS = numbers("mass com:3 inertia:6 borne reaching")
SITE_NUMBERS = numbers("origin:3 axes:3x3")  # in the link
FLEX_NUMBERS = numbers("mass first_moment:3 second_moment:3x3")
FLEX_DATA = numbers("value")  # per body: C1 (3n), E (9n), modal mass (n n), stiffness (n), damping (n)
MOMENT_VALUES = numbers("value")
BASIS_VALUES = numbers("value")
INTERFACE_DATA = numbers("value")  # per body, in the interface basis: C1 (3n), modal mass (n n), stiffness (n n)
PORT_NUMBERS = numbers("origin:3 axes:3x3")  # undeformed
PORT_DATA = numbers("value")  # per port and moving shape r: translation shape (3r), rotation shape (3r)
#: radius: of the inner surface; stiffness, exponent, damping: of the normal law (`contact.law.Numbers`); shape: what
#: else its kind of surfaces has; length: size of the mechanism that it belongs to
CONTACT_NUMBERS = numbers("clearance radius floor stick_speed stiffness exponent damping friction_law:6 shape:2 length")
PIECES = numbers("start coefficients:8")
HARMONICS = numbers("amplitude frequency phase")  # angular frequency
LOAD_NUMBERS = numbers("value")  # see `loads`
#: of each guard. level: length of what it watches, 0: that it reverses; scale: what counts as close is measured by
GUARD_NUMBERS = numbers("level scale")
GRAVITY = numbers("acceleration:3")
#: per error group. magnitude: below it is resolved absolutely, natural: the same by the size of all that there is;
#: share: factor of its tolerance by which no independent mechanism is resolved less well than alone
FLOORS = numbers("magnitude natural share")
CLOSURE_NUMBERS = numbers("weight")  # of each closure's lengths, so that the loops of small mechanisms close as well
#: of bodies and named frames in their link, undeformed. mass, com, inertia: as of LINK_NUMBERS; mass and inertia are 0
#: where nothing but the body itself is in its link
BODY_NUMBERS, NAMED_FRAME_NUMBERS = numbers("mass com:3 inertia:6 axes:3x3"), numbers("origin:3")

# Work space in w -----------------------------------------------------------------------------------------------------
#: a frame in world axes; the velocity is that of its origin
_FRAME = "origin:3 axes:3x3 omega:3 velocity:3 alpha:3 acceleration:3"
FRAME = layout(_FRAME)
X, U, DU = _stretches("x:nq+n_drives u:nv+n_drives du:nv+n_drives")
#: as X and U, but of coordinates: those of moving shapes
INTERFACE_X, INTERFACE_U = _stretches("interface_x:nv interface_u:nv")
LINK_FRAMES, SITE_FRAMES = work(_FRAME, "n_links"), work(_FRAME, "n_sites")
#: the motion subspace S of one joint: a twist per freedom, axes of its first frame
SUBSPACE = work("angular:3 linear:3", "6")
#: spatial inertia: mass, mass * centre, inertia about the kernels' origin (xx yy zz xy xz yz); of the link, of its tree
OWN, INERTIA = (work("mass moment:3 inertia:6", "n_links") for _ in range(2))
WRENCH = work("moment:3 force:3", "n_links")
COLUMNS, MOMENTA, DEFORMATION = (work("angular:3 linear:3", count) for count in ("columns", "columns", "nv"))
#: of each link, about its origin, which arm leads to from its parent's: what it offers to its parent, inertia as
#: (turning mixed; mixed^T moving) of twists to wrenches; a wrench; an acceleration; the wrench that its own
#: accelerations need (`equations.articulated`)
ARTICULATED = work(
    "turning:6 mixed:3x3 moving:6 moment:3 force:3 angular:3 linear:3 arm:3 own_moment:3 own_force:3", "n_links"
)
#: of three closure rows at once: what a link transmits to its parent, a column each
TRANSMITTED = work("moments:3x3 forces:3x3", "n_links")
#: each column about its link's origin, and of each coordinate the factor's K
LOCAL, GAIN = work("angular:3 linear:3", "columns"), work("moment:3 force:3", "nv")
#: MODAL: P (9n), V (9n), forces on the modes (n), and their spin (3n) as eigenmodes and in the interface basis
BIAS, MODAL_BIAS, MODAL, SCRATCH, MASS, FORCE, RESIDUAL, RESIDUAL_RATE, GAMMA = _stretches(
    "bias:nv+n_drives modal_bias:nv modal:25*most_modes scratch:18 mass:mass_size force:nv residual:n_closure_rows "
    "residual_rate:n_closure_rows gamma:n_closure_rows"
)
#: wrenches of the closure rows; then, of the couplings, those on their first joints
ROWS = work("moment:3 force:3", "n_closure_rows+n_couplings")
#: ROW_SCALE: per selected row the largest diagonal entry of J M^-1 J^T over the accepted steps, then, after
#: room for all rows, that of the last evaluation, which may be a trial far away
JACOBIAN, SPREAD, SCHUR, ROW_SCALE, PIVOT, MULTIPLIER = _stretches(
    "jacobian:jacobian_size spread:jacobian_size schur:schur_size row_scale:2*n_closure_rows pivot "
    "multiplier:n_closure_rows"
)
#: per selected row its distance from those before it, at the end of the step, at its start, and the most that it has
#: been; rows of the state's length: the Chebyshev series that leads over a singular pose
INDEPENDENCE = work("now past most", "n_closure_rows")
COLLOCATION_ROWS = 13
(COLLOCATION,) = _stretches(f"collocation:{COLLOCATION_ROWS}*ny*?n_closure_rows")
#: smallest pivot of J M^-1 J^T as fraction of its row's largest diagonal entry (1: rows at right angles, 0:
#: dependent or nothing): of the last evaluation; below which the stepper asks for other rows
LAST_PIVOT, LEAST_PIVOT = _floats(PIVOT, "last_pivot least_pivot")
#: what a contact does now; bent: what the bristles store
TOUCH = work(
    "gap rate normal_force friction_power damping_power stored bent slip force:3 offset:3 point:3", "n_contacts"
)
#: on the closures' second bodies; of an independent mechanism its kinetic energy, potential energy of gravity, and
#: what bodies, springs and contacts store [J]
CLOSURE_WRENCH, ENERGY = work("moment:3 force:3", "n_closures"), work("kinetic potential elastic", "n_components")
LAW = work("value rate second_rate", "n_laws")
#: what a load does now: force on b, its moment about the kernels' origin, length or coordinate, its rate, stored
#: energy, power that it brings in, power that it loses
LOAD = work("force:3 moment:3 value rate stored power loss", "n_loads")
#: of loads that bend: speeds along their coordinates, arguments of max, min and abs
LOAD_BENDS = work("now", "n_load_bends")
INTERNAL, DRIVE_FORCE, LEDGER_RATE, POSITION_RATE, Y, Y_NEW, Y_STAGE, SLOPES, DENSE = _stretches(
    "internal:n_internal drive_force:n_drives ledger_rate:n_ledger position_rate:nq+n_drives y:ny y_new:ny y_stage:ny "
    "slopes:slopes*ny dense:dense*ny"
)
#: what a method knows from step to step (`Room`), up to QUADRATURES
MEMORY, VECTORS, MATRICES = _stretches("memory:floats vectors:vectors*ny matrices:matrices*ny*ny")
#: of `integrate.modal_basis`, one oscillator per speed at most: omega^2 [1/s^2], damping [1/s], root of the stiffness
#: of a mode's spring; the rows of Q^T, K^1/2 P K^1/2 and C, the columns of B, what the springs accelerate
OSCILLATORS = work("square damping root", "?oscillations*nv")
AXES, COUPLING, READING, LIFTING, RESPONSE = _stretches(
    "axes:?oscillations*nv*nv coupling:?oscillations*nv*nv reading:?oscillations*nv*nv "
    "lifting:?oscillations*nv*ny response:?oscillations*nv*ny"
)
#: (z, z') of each oscillator; its phi functions in each quadrature, and what four sources add to (z, z') by them,
#: weights of 1 and Lambda each (`integrate.exponential`)
OSCILLATIONS, QUADRATURES = work("z rate", "oscillations*nv"), work("phi:10 share:8", "quadratures*nv")
MAGNITUDE, CORRECTION, LATCHED = _stretches("magnitude:n_groups correction:nv latched:n_contacts")
#: what the stepper watches of a contact, at the start (0) and at the end (1) of the step; trend: rate of the force;
#: slip_rate: rate of the sliding speed, 0 where it is not known; event_row: of its last closing; mode0, latched0: mode
#: and impact rate that hold within the step
WATCH = work(
    "gap0 rate0 force0 slip0 trend0 gap1 rate1 force1 slip1 trend1 event_row mode0 latched0 slip_rate0 slip_rate1",
    "n_contacts",
)
GUARDED = work("start:3 end:3", "n_guards")  # what guards watch, at the start and at the end of the step
(CONTROL,) = _stretches("control")

# Tables of effects ---------------------------------------------------------------------------------------------------
#: by the names that they declare (`effects.effect`); those of effects that a mechanism lacks are empty
OF_EFFECTS: dict[str, Any] = {}
for _effect in EFFECTS:
    for _array, _tables in (("h", _effect.wiring), ("f", _effect.numbers)):
        OF_EFFECTS |= {name: _table(_array, rows) for name, rows in _tables.items()}
    OF_EFFECTS |= {name: work(rows, number) for name, (number, rows) in _effect.work.items()}
    _stretches(" ".join(_effect.stretches))
HEADER = next(_place)

# the ledger before the contacts' slots (three deflections of each contact with bristles come after them):
# work of drives, loss of modal damping, both of the first independent mechanism; BOOKS says where those of others are
DRIVE_WORK, MODAL_LOSS, CONTACT_SLOTS = range(3)
#: a contact's slots there: losses of its damping and of friction, impulse of its normal force
CONTACT_LEDGER = layout("damping friction impulse")
# what an evaluation reports in n[EVALUATION]
OK, NOT_POSITIVE, SINGULAR, NOT_CLOSED, NOT_FINITE, JAMMED = range(6)

# Control floats, from w[h[CONTROL]] on -------------------------------------------------------------------------------
# time, next step, end of the segment, relative tolerance, length of the run, size of the mechanism, largest violation
# of a closure before projection, error norm of the last accepted step, largest growth of the next (1 after a
# rejection), length of fixed steps, the method's parameter, largest rate of a closure before projection, largest rate
# of the equations that a step met;
# then what `singular_step` keeps: independence of the closure rows at the end of the step, time of its start, time of
# the next singular pose, how far before it the stepper stops, the most that this may be (0: it does not stop), length
# of the polynomial that lies ready (0: none), the fraction of it that the present step is, the least fraction that a
# row has left of the most that it had, steps in a row that ended blindly close to a pose;
# then what `adaptive` keeps: length and error norm of the step rejected last (0: none since the last accepted one),
# what the last first step with a contact closed could have been, whether the next accepted step is a segment's first;
# then of an attempt that waits for rates (`method.await_rates`): its length, its error norm, the state's time; end and
# length of a step whose events have been resolved (`stepper.make_resolution`)
# fmt: off
(
    TIME, STEP, END, RTOL, SPAN, LENGTH, DRIFT, LAST_NORM, MOST_GROWTH, FIXED, PARAMETER, RATE_DRIFT, STEEPEST,
    SIGMA, PAST_TIME, PASS_TIME, REACH, MOST_REACH, COLLOCATED, FRACTION, LEFT, BLIND_STEPS,
    REJECTED_STEP, REJECTED_NORM, TOUCHED_STEP, FIRST, TRIED, NORM, AWAITED_TIME, RESOLVED_END, RESOLVED_STEP,
) = _floats(
    CONTROL,
    "time step end rtol span length drift last_norm most_growth fixed parameter rate_drift steepest "
    "sigma past_time pass_time reach most_reach collocated fraction left blind_steps "
    "rejected_step rejected_norm touched_step first tried norm awaited_time resolved_end resolved_step",
)
# fmt: on

# Integers in n -------------------------------------------------------------------------------------------------------
# report of the last evaluation; where active pieces and modes start in n, and its state in w; whether it left only
# what steps read; whether others make awaited rates; the stepper's own, last a step's stage, where its state and rates
# are, and whether the dense output of a step whose events have been resolved is there
_INTEGERS = _numbered(
    "evaluation active mode state abridged together status evaluations steps rejected next_output n_recorded n_events "
    "budget cap fresh immediate projections projection_evaluations jacobians culprit stiff_steps stage awaited "
    "rates_in extended"
)
# fmt: off
(
    EVALUATION, ACTIVE, MODE, STATE, ABRIDGED, TOGETHER,
    STATUS, EVALUATIONS, STEPS, REJECTED, NEXT_OUTPUT, N_RECORDED, N_EVENTS, BUDGET, CAP, FRESH, IMMEDIATE,
    PROJECTIONS, PROJECTION_EVALUATIONS, JACOBIANS, CULPRIT, STIFF_STEPS, STAGE, AWAITED, RATES_IN, EXTENDED,
) = _INTEGERS.values()
# fmt: on
INTEGERS = len(_INTEGERS)

# Table of lanes (`compile.lanes`) -------------------------------------------------------------------------------------
# a lane: nobody is in it; its stepper may proceed, waits for rates, has come to its end
LANE_IDLE, LANE_READY, LANE_WAITING, LANE_DONE = range(4)
# its words: whether to return at once, then of each lane its state, the address of what takes its steps, and the
# arguments of that: h, f, w, n, and eight of the record
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
#: where stretches of w, and tables, begin
INDICES = {f"at_{name}": index for name, index in STRETCHES.items()}
INDICES |= {f"at_{name}": table.place for name, table in NAMED.items()}
ARRAYS = {name: array for name, table in NAMED.items() for array in TABLES if table in TABLES[array]}
#: shapes of fields that are tuples, and how many numbers these have
TUPLES: dict[tuple[int, ...], int] = {(3,): 3, (3, 3): 9}


def row_fields(name: str) -> dict[str, tuple[int, tuple[int, ...]]]:
    """Offset and shape of each field in a row of the table `name`."""
    rows: Any = row_type(NAMED[name])
    return {field: (rows.fields[field][1] // rows[field].base.itemsize, rows[field].shape) for field in rows.names}


# The record ----------------------------------------------------------------------------------------------------------
#: a row of the event table; speed: rate of penetration at a closing, minus it at an opening [m/s]
EVENT = layout("contact kind time speed peak_force peak_depth duration")
#: free rows that one step may need: of the record; of the events, per contact
ROOM, EVENTS_OF_A_CONTACT = 8, 4
#: rate of the force of a contact that begins: grows, who knows how fast
STEEPLY = 1e300


def columns_of_record(contacts: int) -> tuple[int, int, int]:
    """Where a row of the record has the contacts' modes, their impact rates and the state; its time is first."""
    return 1, 1 + contacts, 1 + 2 * contacts


record_columns = kernel(columns_of_record)
