"""Tables 1 to 6: parts, material, joint, frequencies and simulation as printed by the paper, and ours next to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from flexclear.publishing import Table
from papers.comparison import ABSENT, Data, Figure, drawn
from papers.wang_wang_2019 import published
from papers.wang_wang_2019.models import CSJ, IDEAL, JOINT, parameters
from papers.wang_wang_2019.published import TABLE1, TABLE2, TABLE3, TABLE6

COLUMNS = (
    "mode",
    "kind",
    "paper, ANSYS (Hz)",
    "paper, normal mode (Hz)",
    "difference of these (%)",
    "ours, square inertia (Hz)",
    "agrees as printed",
    "ours, circle (Hz)",
    "exact Rayleigh beam (Hz)",
    "exact Timoshenko beam (Hz)",
)
LEAST = 1e-3  # last digit printed [Hz]
MEANING = "± of ours: how much the frequency changes on a mesh of four times as many elements."


def _table(
    title: str, data: Sequence[xr.Dataset], ansys: Sequence[float], printed: Sequence[float], rigid: int
) -> Table:
    """Return one table of frequencies; `rigid` rows of zeros come first, as the paper prints them.

    data: modes with the square's inertia and with the circle's, elastic modes only, ascending; then both again on a
    finer mesh.
    """
    square, circle, square_fine, circle_fine = data
    rows = [_rigid_row(i + 1, circle, i) for i in range(rigid)]
    for i, (a, p) in enumerate(zip(ansys, printed, strict=True)):
        ours, right = float(square.frequency[i]), float(circle.frequency[i])
        rows.append(
            (
                str(rigid + i + 1), str(circle.kind.values[i]), f"{a:.1f}", f"{p:.1f}", f"{100 * abs(p - a) / a:.2f}",
                _with_error(ours, square_fine, i), "yes" if f"{ours:.1f}" == f"{p:.1f}" else "no",
                _with_error(right, circle_fine, i),
                _exact(circle, "exact_rayleigh", i), _exact(circle, "exact_timoshenko", i),
            )
        )  # fmt: skip
    agree = [f"{float(square.frequency[i]):.1f}" == f"{p:.1f}" for i, p in enumerate(printed)]
    return Table(
        title,
        COLUMNS,
        tuple(rows),
        (_about_section(agree, square, circle), _about_ansys(), _about_shear(circle), MEANING),
    )


def _with_error(hertz: float, fine: xr.Dataset, i: int) -> str:
    """Format a frequency, +- its change on the finer mesh."""
    return f"{hertz:.3f} ± {max(abs(hertz - float(fine.frequency[i])), LEAST):.3f}"


def euler_bernoulli_ratio() -> float:
    """Return the third over the second frequency of a uniform Euler-Bernoulli beam, both ends clamped or both free."""
    from scipy.optimize import brentq

    # roots of cos(x) = 1 / cosh(x) near (k + 1/2) pi; frequencies are as their squares
    second, third = (brentq(lambda x: np.cos(x) - 1.0 / np.cosh(x), k * np.pi, (k + 1) * np.pi) for k in (2, 3))
    return float((third / second) ** 2)


def _rigid_row(number: int, modes: xr.Dataset, i: int) -> tuple[str, ...]:
    ours = (
        f"{float(modes.rigid_frequency[i]):.2f}"
        if "rigid_frequency" in modes and i < modes.sizes["rigid_mode"]
        else "0"
    )
    return (str(number), "rigid", "0", "0", "0", "0 (removed)", "yes", f"{ours} (removed)", "0", "0")


def _exact(modes: xr.Dataset, name: str, i: int) -> str:
    return f"{float(modes[name][i]):.3f}" if name in modes and np.isfinite(modes[name][i]) else ABSENT


def _about_section(agree: list[bool], square: xr.Dataset, circle: xr.Dataset) -> str:
    count = len(agree)
    change = np.abs(square.frequency.values[:count] / circle.frequency.values[:count] - 1.0)
    worst = int(np.argmax(change))
    verdict = "all" if all(agree) else f"{sum(agree)} of {count}"
    return (
        "The column 'square inertia' takes the section's second moments in the mass matrix from the square of equal "
        f"area and those in the stiffness from the circle; so {verdict} of the paper's elastic values come out as "
        f"printed. The rod is round: 'circle' is the correct column, up to {100 * change[worst]:.1f} % away (mode "
        f"{worst + 1} of those listed, {circle.kind.values[worst]})."
    )


def _about_ansys() -> str:
    ratio, bound = published.TABLE5_ANSYS[5] / published.TABLE5_ANSYS[2], euler_bernoulli_ratio()
    return (
        "The ANSYS columns belong to no converged uniform rod: its torsional frequency is the same for clamped and "
        f"for free ends, yet they give {published.TABLE4_ANSYS[4]:.1f} and {published.TABLE5_ANSYS[4]:.1f} Hz; and the "
        f"third free bending frequency over the second is {ratio:.4f}, above the {bound:.4f} of an Euler-Bernoulli "
        "beam, which rotary inertia and shear can only lower."
    )


def _about_shear(circle: xr.Dataset) -> str:
    if "exact_timoshenko" not in circle or "exact_rayleigh" not in circle:
        return "The beam elements have rotary inertia but no shear flexibility."
    bending = np.array([str(kind).startswith("bending") for kind in circle.kind.values])
    drop = 1.0 - circle.exact_timoshenko.values[bending] / circle.exact_rayleigh.values[bending]
    return (
        "Shear flexibility, which these elements leave out, lowers the bending frequencies listed by "
        f"{100 * np.nanmin(drop):.1f} to "
        f"{100 * np.nanmax(drop):.1f} % (exact Timoshenko beam against exact Rayleigh beam)."
    )


def _figure(number: int, reference: str, ansys: Sequence[float], printed: Sequence[float], rigid: int) -> Figure:
    """Build the table of a reference condition; the other arguments as of `_table`."""
    variants = [f"sps4/frequencies/{reference}_{inertia}" for inertia in ("square", "circle")]
    needs = tuple(f"{scene}:{modes}/rod" for modes in ("modes", "fine-modes") for scene in variants)
    ends = f"{reference}-{reference} reference conditions"
    title = f"Table {number}: frequencies of the rod, {ends}"
    return Figure(
        f"Table {number}: natural frequencies of the rod under {ends}",
        needs,
        lambda data: _table(title, [data[name] for name in needs], ansys, printed, rigid),
    )


TABLE04 = _figure(4, "fixed", published.TABLE4_ANSYS, published.TABLE4_NORMAL_MODE, rigid=0)
TABLE05 = _figure(5, "free", published.TABLE5_ANSYS, published.TABLE5_NORMAL_MODE, rigid=published.RIGID_MODES)


HEADS = ("parameter", "paper", "ours")
ROD = "sps4/far_cb:mesh/rod1"
#: members of table 1 and their bodies in the scenes; the others belong to the ground
BODIES = {
    "cylinder": "cylinder1",
    "actuated rod": "rod1",
    "constrained rod": "central_rod",
    "socket on moving platform": "socket_A1",
    "ball": "ball_A1",
    "moving platform": "platform",
}


@drawn("Table 1: physical parameters of the parts, the paper's and those of the scenes", f"{IDEAL.scene}:run")
def parts(data: Data) -> Table:
    """Tabulate mass, length and moments of inertia; ours are those of the run."""
    bodies = parameters(data[f"{IDEAL.scene}:run"])["body"]
    rows = tuple(_part(member, bodies) for member in TABLE1)
    heads = ("member", "body here", "mass, paper (kg)", "mass, ours (kg)", "length, paper (mm)",
             "inertia, paper (kg mm²)", "inertia, ours (kg mm²)")  # fmt: skip
    platform = bodies["platform"]
    side = 1e3 * np.sqrt(6.0 * np.array(platform["inertia"]).max() / platform["mass"])
    notes = (
        "Inertia about the centre of mass: Ixx, Iyy, Izz. The paper's first column is the normal of plate and socket, "
        "which is z here. Members without a body belong to the ground.",
        f"The platform's moments are those of a square plate of side {side:.1f} mm and negligible thickness: the "
        "printed length, 100 mm, is half of its side; 200 mm of the base may be half of one, too.",
    )
    return Table("Table 1: physical parameters", heads, rows, notes)


def _part(member: str, bodies: dict[str, Any]) -> tuple[str, ...]:
    printed, name = TABLE1[member], BODIES.get(member)
    ours = bodies[name] if name else None
    return (
        member,
        name or ABSENT,
        _formatted(printed.mass, "{:.2f}"),
        _formatted(ours and ours["mass"], "{:.2f}"),
        _formatted(printed.length, "{:g}"),
        _formatted(printed.inertia, MOMENTS),
        _formatted(ours and 1e6 * np.diag(np.array(ours["inertia"])), MOMENTS),
    )


#: format of three moments of inertia
MOMENTS = "{:.3f}, {:.3f}, {:.3f}"


def _formatted(values: Any, form: str) -> str:
    return ABSENT if values is None else form.format(*np.atleast_1d(values))


MATERIAL = {
    "density": ("density (kg/m³)", "{:.0f}"),
    "poisson": ("Poisson's ratio", "{:.2f}"),
    "youngs_modulus": ("Young's modulus (Pa)", "{:.3g}"),
    "radius": ("radius (m)", "{:.3f}"),
    "length": ("length (m)", "{:.3f}"),
}


@drawn("Table 2: material of the flexible actuated rod, the paper's and that of its mesh", ROD)
def material(data: Data) -> Table:
    """Tabulate the material of the mesh from which the modes follow."""
    mesh = data[ROD]
    young, shear = (float(np.ravel(mesh[name].values)[0]) for name in ("youngs_modulus", "shear_modulus"))
    ours = {
        "density": float(np.ravel(mesh.density.values)[0]),
        "poisson": young / (2.0 * shear) - 1.0,
        "youngs_modulus": young,
        "radius": float(np.sqrt(np.ravel(mesh.area.values)[0] / np.pi)),
        "length": float(np.ptp(mesh.abscissa.values)),
    }
    rows = tuple(
        (words, form.format(TABLE2[name]), form.format(ours[name])) for name, (words, form) in MATERIAL.items()
    )
    notes = (
        f"{mesh.sizes['cell']} beam elements, as in the paper. The mass that follows is "
        f"{ours['density'] * np.pi * ours['radius'] ** 2 * ours['length']:.4f} kg (Table 1: 0.21 kg).",
    )
    return Table("Table 2: the flexible rod", HEADS, rows, notes)


@drawn("Table 3: the spherical joint with clearance, the paper's and that of the scenes", f"{CSJ.scene}:run")
def joint_with_clearance(data: Data) -> Table:
    """Tabulate the joint; ours are the run's parameters, with the stiffness that follows from them."""
    joint = parameters(data[f"{CSJ.scene}:run"])["joint"][JOINT]
    ball, young = joint["ball_radius"], f"{1e-9 * TABLE3['youngs_modulus']:g}"
    rows = (
        ("socket radius (mm)", f"{1e3 * TABLE3['socket_radius']:g}", f"{1e3 * (ball + joint['clearance']):g}"),
        ("ball radius (mm)", f"{1e3 * TABLE3['ball_radius']:g}", f"{1e3 * ball:g}"),
        ("clearance (mm)", "0.5, as follows", f"{1e3 * joint['clearance']:g}"),
        ("Poisson's ratio, socket and ball", f"{TABLE3['poisson']:g}", _both(joint, "poisson", 1.0)),
        ("Young's modulus (GPa), socket and ball", young, _both(joint, "youngs_modulus", 1e-9)),
        ("density (kg/m³)", f"{TABLE3['density']:g}", "not used: masses are those of Table 1"),
        ("coefficient of restitution", "not printed", f"{joint['normal']['restitution']:g}, assumed"),
    )
    return Table("Table 3: the joint with clearance", HEADS, rows, (_stiffness(joint),))


def _both(joint: dict, name: str, factor: float) -> str:
    return ", ".join(f"{factor * joint[material][name]:g}" for material in ("socket_material", "ball_material"))


def _stiffness(joint: dict) -> str:
    """Compute K of eq. (26) from the run's parameters, as a note."""
    sigma = [
        (1.0 - m["poisson"] ** 2) / (np.pi * m["youngs_modulus"])
        for m in (joint["socket_material"], joint["ball_material"])
    ]
    R, r = joint["ball_radius"] + joint["clearance"], joint["ball_radius"]
    K = 4.0 / (3.0 * np.pi * sum(sigma)) * np.sqrt(R * r / (R - r))
    return f"Stiffness by eq. (26): K = {K:.4g} N/m^1.5."


@drawn("Table 6: parameters of the simulation, the paper's and those of the scenes", f"{CSJ.scene}:run")
def simulation(data: Data) -> Table:
    """Tabulate the parameters of the simulation; ours are those of the CSJ run."""
    run = data[f"{CSJ.scene}:run"]
    given = parameters(run)
    joint, solver = given["joint"][JOINT], given.get("solver", {})
    friction = joint["friction"]
    steps = run.attrs.get("steps", 0)
    chosen = f"chosen by the tolerance: {steps} steps in the CSJ run" if steps else "chosen by the tolerance"
    rows = (
        ("time span (s)", f"{TABLE6['time_span']:g}", f"{float(run.time[-1] - run.time[0]):g}"),
        ("time step (s)", f"{TABLE6['time_step']:g}", chosen),
        ("integration tolerance", f"{TABLE6['tolerance']:g} mm", f"{solver.get('rtol', 1e-10):g}, relative"),
        ("power exponent", f"{TABLE6['exponent']:g}", f"{joint['normal'].get('exponent', 1.5):g}"),
        ("static friction coefficient", f"{TABLE6['static']:g}", f"{friction['static']:g}"),
        ("slip friction coefficient", f"{TABLE6['dynamic']:g}", f"{friction['dynamic']:g}"),
        ("critical velocity of static friction (mm/s)", f"{TABLE6['v_static']:g}", f"{1e3 * friction['v_static']:g}"),
        (
            "critical velocity of dynamic friction (mm/s)",
            f"{TABLE6['v_dynamic']:g}",
            f"{1e3 * friction['v_dynamic']:g}",
        ),
    )
    notes = (
        "The step is printed as '0.0 0 0 01s', most likely 1e-5 s. Runs at that step and at that tolerance stand in "
        "Table 10.",
    )
    return Table("Table 6: parameters of the simulation", HEADS, rows, notes)
