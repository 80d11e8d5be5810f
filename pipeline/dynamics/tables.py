"""The arrays through which scene and compiled kernels speak: wiring, numbers and work space.

A kernel's code depends only on the kinds of parts present. Everything else, how many there
are, what is joined to what, every number, stands in three flat arrays that every kernel takes:

- ``h`` (integers): a header with sizes and offsets, then the wiring tables;
- ``f`` (floats): the numbers of the scene;
- ``w`` (floats): the work space, the integrator's state and stages included.

The header also holds where this process has put the functions that other ones call (`assembly.calls`).

Flat arrays, because a compiled call costs what its arguments cost, and compilation too.

Words: a *link* is a body after rigidly joined ones are merged (link 0 is the ground). A *site* is a frame on a link
that a joint, closure, contact or load uses. A *port* is a site on a flexible link. A *coordinate* is one generalised
speed; free ones come first, in the order of elimination (descendants before ancestors), prescribed ones after. A
*column* is the twist (angular velocity; velocity of the point at the kernels' origin) per unit of a coordinate; every
coordinate has one, and every port one more per mode.
"""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.vectors import kernel

#: header of h: sizes
SIZES = (
    "N_LINKS N_SITES N_FLEX N_CLOSURES N_CLOSURE_ROWS N_KEPT_ROWS N_CONTACTS N_DRIVES NQ NV NY N_LEDGER N_PAIRS "
    "N_KNOWN_PAIRS N_KNOWN_ENTRIES N_CLOSURE_PAIRS N_GROUPS MASS_SIZE SCHUR_SIZE JACOBIAN_SIZE MOST_MODES N_LAWS "
    "N_LOADS N_TURNS LOAD_SLOT"
).split()
#: wiring tables in h: name -> columns
WIRING = {
    # parent, joint kind, first position, first coordinate, number of coordinates, flexible body or -1,
    # port of a flexible link's inboard frame or -1, port of the parent that carries it or -1
    "LINKS": 8,
    "SITES": 2,  # link, port or -1
    # link, number of modes, first position, first coordinate, first of its numbers, first and number of
    # its moments, whether modes move the inboard frame
    "FLEXES": 8,
    "MOMENTS": 2,  # row (3k + l) n + j, i of int rho S_ki S_lj
    "PORTS": 3,  # flexible body, first column, first of its shapes
    "PAIRS": 3,  # momentum, column, place in the mass matrix's envelope
    "KNOWN_PAIRS": 4,  # momentum, column, prescribed coordinate, free coordinate
    "ENVELOPE": 2,  # first column, start of each row of the mass matrix
    # sites a and b, first row, rows, support, its length, Jacobian, first entry, entries, first and number of kept rows
    "CLOSURES": 11,
    "CLOSURE_ROWS": 3,  # (0, i, 0): along axis i of frame A; (1, k, l): axis k of A against axis l of B
    "SUPPORT": 1,  # coordinates on which a closure depends
    "ENTRIES": 3,  # slot in the support, column, sign
    "KNOWN_ENTRIES": 4,  # closure, prescribed coordinate, column, sign
    "CLOSURE_PAIRS": 4,  # closure a, closure b >= a, start and number of their common slots
    "COMMON": 2,  # slot in a, slot in b
    "CLOSURE_ENVELOPE": 2,  # of the rows that are solved for
    # outer site, inner site, form of the normal law, friction law or -1, surfaces, place of the bristles'
    # deflection in the state or -1
    "CONTACTS": 6,
    "LAWS": 2,  # first piece, number of pieces; the drives' laws first
    "PIECE_HARMONICS": 2,  # first harmonic, number of harmonics
    "LOADS": 12,  # see `loads.fields`
    "LOAD_KINDS": 2,  # first load of a kind, number of them
    "GROUPS": 1,  # error group of each state variable
}
#: numbers in f: name -> columns
NUMBERS = {
    "LINK_NUMBERS": 10,  # mass, centre of mass (3), inertia about it (xx yy zz xy xz yz), link axes
    "SITE_NUMBERS": 12,  # position (3), rotation (9) in the link
    "FLEX_NUMBERS": 13,  # mass, first moment (3), second moment (9)
    "FLEX_DATA": 1,  # per body: C1 (3n), E (9n), modal mass (n n), stiffness (n), damping (n)
    "MOMENT_VALUES": 1,
    "PORT_NUMBERS": 12,  # undeformed position (3), rotation (9)
    "PORT_DATA": 1,  # per port: translation shape (3n), rotation shape (3n)
    # clearance, radius of the inner surface, floor, sticking speed, normal law (4), friction law (6)
    "CONTACT_NUMBERS": 14,
    "PIECES": 9,  # start, eight coefficients
    "HARMONICS": 3,  # amplitude, angular frequency, phase
    "LOAD_NUMBERS": 5,  # see `loads`
    "GRAVITY": 3,
    "FLOORS": 1,  # per error group: magnitude below which it is resolved absolutely
}
#: work space in w: its places, in order; sizes follow from the header (see `assembly.packing`)
WORK = (
    "X U DU LINK_FRAMES SITE_FRAMES JOINT OWN INERTIA WRENCH COLUMNS MOMENTA DEFORMATION BIAS MODAL_BIAS "
    "MODAL SCRATCH MASS FORCE ROWS RESIDUAL RESIDUAL_RATE GAMMA JACOBIAN SPREAD SCHUR ROW_SCALE PIVOT MULTIPLIER TOUCH "
    "LAW LOAD TURN DRIVE_FORCE LEDGER_RATE POSITION_RATE Y Y_NEW Y_STAGE SLOPES DENSE MEMORY MAGNITUDE CORRECTION "
    "LATCHED WATCH CONTROL"
).split()
#: header of h: addresses of compiled functions, zero until the engine writes them
ADDRESSES = "EVALUATE PROJECT DISPLACE".split()
_PLACE = {name: place for place, name in enumerate([*SIZES, *WIRING, *NUMBERS, *WORK, *ADDRESSES])}
HEADER = len(_PLACE)
#: places that only the kernels of some effects need, which name them themselves
ELSEWHERE = "LAWS PIECE_HARMONICS HARMONICS LOADS LOAD_KINDS LOAD_NUMBERS LOAD_SLOT ROW_SCALE PIVOT".split()
ELSEWHERE += (
    "N_KEPT_ROWS JACOBIAN_SIZE SCHUR_SIZE N_CLOSURE_PAIRS N_KNOWN_ENTRIES KNOWN_ENTRIES CLOSURE_PAIRS COMMON".split()
)
ELSEWHERE += "CLOSURE_ENVELOPE CLOSURE_ROWS SUPPORT ENTRIES GAMMA JACOBIAN SPREAD SCHUR".split()


def place(name: str) -> int:
    """Where the header keeps a size or an offset."""
    return _PLACE[name]


_SIZES = [place(name) for name in SIZES if name not in ELSEWHERE]
N_LINKS, N_SITES, N_FLEX, N_CLOSURES, N_CLOSURE_ROWS, N_CONTACTS, N_DRIVES, NQ, NV, NY, N_LEDGER = _SIZES[:11]
N_PAIRS, N_KNOWN_PAIRS, N_GROUPS, MASS_SIZE, MOST_MODES, N_LAWS, N_LOADS, N_TURNS = _SIZES[11:]
(
    LINKS,
    SITES,
    FLEXES,
    MOMENTS,
    PORTS,
    PAIRS,
    KNOWN_PAIRS,
    ENVELOPE,
    CLOSURES,
    CONTACTS,
    GROUPS,
) = (place(name) for name in WIRING if name not in ELSEWHERE)
(
    LINK_NUMBERS,
    SITE_NUMBERS,
    FLEX_NUMBERS,
    FLEX_DATA,
    MOMENT_VALUES,
    PORT_NUMBERS,
    PORT_DATA,
    CONTACT_NUMBERS,
    PIECES,
    GRAVITY,
    FLOORS,
) = (place(name) for name in NUMBERS if name not in ELSEWHERE)
# fmt: off
(
    X, U, DU, LINK_FRAMES, SITE_FRAMES, JOINT, OWN, INERTIA, WRENCH, COLUMNS, MOMENTA, DEFORMATION, BIAS,
    MODAL_BIAS, MODAL, SCRATCH, MASS, FORCE, ROWS, RESIDUAL, RESIDUAL_RATE, MULTIPLIER, TOUCH, LAW, LOAD,
    TURN, DRIVE_FORCE, LEDGER_RATE, POSITION_RATE, Y, Y_NEW, Y_STAGE, SLOPES, DENSE, MEMORY, MAGNITUDE,
    CORRECTION, LATCHED, WATCH, CONTROL,
) = (place(name) for name in WORK if name not in ELSEWHERE)
# fmt: on

# fields of a link, a flexible body, a port, a closure, a contact; numbers of numpy, because a kernel that is given
# an integer of Python as a constant is compiled anew for each value
PARENT, JOINT_KIND, Q0, C0, N_SPEEDS, FLEX, INBOARD_PORT, CARRIED_BY = np.arange(8)
FLEX_LINK, N_MODES, FLEX_Q0, FLEX_C0, DATA0, MOMENT0, N_MOMENTS, FLEX_INBOARD = np.arange(8)
PORT_FLEX, PORT_COLUMN, PORT_SHAPES = np.arange(3)
SITE_A, SITE_B, ROW0, N_ROWS, SUPPORT0, N_SUPPORT, JACOBIAN0, ENTRY0, N_ENTRIES, KEPT0, N_KEPT = np.arange(11)
OUTER, INNER, NORMAL_KIND, FRICTION_KIND, SURFACES, BRISTLE = np.arange(6)
CLEARANCE, RADIUS, FLOOR, STICK_SPEED, NORMAL_LAW, FRICTION_LAW = 0, 1, 2, 3, 4, 8
# a frame: origin (3), rotation (9), angular velocity, velocity, angular acceleration, acceleration; world axes
ORIGIN, AXES, OMEGA, VELOCITY, ALPHA, ACCELERATION, FRAME_SIZE = 0, 3, 12, 15, 18, 21, 24
# a joint's motion: rotation (9), position (3), rates (3 + 3), rate biases (3 + 3), then columns (6 each)
J_ROTATION, J_POSITION, J_OMEGA, J_VELOCITY, J_ALPHA, J_ACCELERATION, J_COLUMNS = 0, 9, 12, 15, 18, 21, 24
JOINT_SIZE = 60
# a law's value, rate and second rate; a piece of it; what a load does now, and in it the energy that it stores
LAW_SIZE, PIECE_SIZE, LOAD_SIZE, LOAD_STORED = 3, 9, 11, 8
# spatial inertia: mass, mass * centre (3), inertia about the kernels' origin (xx yy zz xy xz yz)
INERTIA_SIZE = 10
# what a contact does now
GAP, RATE, NORMAL_FORCE, FRICTION_POWER, DAMPING_POWER, STORED, BENT, SLIP = range(8)
TOUCH_FORCE, TOUCH_OFFSET, TOUCH_POINT, TOUCH_SIZE = 8, 11, 14, 17
# ledger before the contacts' slots (normal loss, work of friction each; then three deflections of each contact
# with bristles): work of drives, loss of modal damping
DRIVE_WORK, MODAL_LOSS, CONTACT_SLOTS = 0, 1, 2
# a contact's slots: losses of its damping and of friction, impulse of its normal force
DAMPING_LOSS, FRICTION_LOSS, IMPULSE, PER_CONTACT = range(4)
# what evaluate reports in n[EVALUATION]
OK, NOT_POSITIVE, SINGULAR, NOT_CLOSED, NOT_FINITE = range(5)
#: first entries of n, the integers that change: report of the last evaluation; where the laws' active pieces
#: and the contacts' modes start in n; where the state being evaluated starts in w
EVALUATION, ACTIVE, MODE, STATE = range(4)


@kernel
def link(h, i, field):
    """A field of link i."""
    return h[h[LINKS] + 8 * i + field]


@kernel
def flex(h, k, field):
    """A field of flexible body k."""
    return h[h[FLEXES] + 8 * k + field]


@kernel
def port(h, k, field):
    """A field of port k."""
    return h[h[PORTS] + 3 * k + field]


@kernel
def closure(h, c, field):
    """A field of closure c."""
    return h[h[CLOSURES] + 11 * c + field]


@kernel
def contact(h, c, field):
    """A field of contact c."""
    return h[h[CONTACTS] + 6 * c + field]


@kernel
def contact_numbers(h, c):
    """Where f holds the numbers of contact c."""
    return h[CONTACT_NUMBERS] + 14 * c


@kernel
def site_link(h, s):
    """Link of site s."""
    return h[h[SITES] + 2 * s]


@kernel
def site_port(h, s):
    """Port of site s, or -1."""
    return h[h[SITES] + 2 * s + 1]


@kernel
def link_frame(h, i):
    """Where w holds the frame of link i."""
    return h[LINK_FRAMES] + FRAME_SIZE * i


@kernel
def site_frame(h, s):
    """Where w holds the frame of site s."""
    return h[SITE_FRAMES] + FRAME_SIZE * s


@kernel
def column(h, k):
    """Where w holds column k."""
    return h[COLUMNS] + 6 * k


@kernel
def momentum(h, k):
    """Where w holds the momentum of column k."""
    return h[MOMENTA] + 6 * k


@kernel
def wrench(h, i):
    """Where w holds the wrench on link i."""
    return h[WRENCH] + 6 * i


@kernel
def touch(h, c):
    """Where w holds the state of contact c."""
    return h[TOUCH] + TOUCH_SIZE * c
