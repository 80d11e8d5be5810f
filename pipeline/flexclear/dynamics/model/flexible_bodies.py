"""Tables of the flexible bodies from their bundles; motion of points on these bodies with the modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model.interface_basis import (
    NO_COUPLING,
    InterfaceBasis,
    frame_index,
    frame_shapes,
    mass_coupled,
)
from flexclear.dynamics.model.mechanism import Mechanism, Site
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.numbering import Numbering
from flexclear.numerics.rotations import rotation_vector_to_matrix
from flexclear.scene.parts import FlexibleBody, RatioPerMode, Rayleigh
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled


def fill(numbering: Numbering, losses: list[int]) -> dict[Any, Any]:
    """Return the tables FLEXES .. PORTS and FLEX_NUMBERS .. PORT_DATA of the flexible bodies.

    losses: ledger index of the energy that modal damping dissipates, of each independent mechanism.
    """
    flex, flex_real, ends = list[tuple[int, ...]](), list[list[float]](), list[int]()
    data, index, value, interface = list[float](), list[int](), list[float](), list[float]()
    entry, entry_value = list[tuple[int, int]](), list[float]()
    mechanism, bodies = numbering.mechanism, numbering.mechanism.scene.flexible()
    any_shortened = any(b.stiffening is not None for b in bodies.values())
    for i in numbering.flexible:
        name, bundle = _body(mechanism, i)
        q, c = numbering.modal_positions[i], numbering.modal_coordinates[i]
        moments, where, row_ends = _moments(bundle)
        basis, moves = numbering.bases[i], int(_inboard_moves(mechanism, i))
        entries, places = basis.entries(), (i, len(q), q.start, c.start, len(data), len(value), len(ends))
        held = sum(j < basis.held for _, j in entries)
        of_basis = (basis.held, len(entry), len(entries), len(entry) + held, len(interface))
        flex.append((*places, moves, int(coupled(mechanism, i)), *of_basis, losses[mechanism.components.of(i)]))
        flex_real.append(
            [float(bundle["mass"].values), *bundle["first_moment"].values, *bundle["second_moment"].values.ravel()]
        )
        entry += entries
        entry_value += [basis.matrix[where_] for where_ in entries]
        interface += _interface_data(bundle, basis).tolist()
        data += _data(bundle, _damping(name, bodies[name], bundle)).tolist()
        if any_shortened:
            data += np.concatenate(_forms(mechanism, i, len(q))).tolist()
        ends += (len(value) + row_ends).tolist()
        value += moments.tolist()
        index += where.tolist()
    port, port_real, port_data = _ports(numbering, any_shortened)
    return {
        m.FLEXES: flex,
        m.MOMENTS: index,
        m.MOMENT_ROWS: ends,
        m.BASIS: entry,
        m.PORTS: port,
        m.FLEX_NUMBERS: flex_real,
        m.FLEX_DATA: data,
        m.MOMENT_VALUES: value,
        m.BASIS_VALUES: entry_value,
        m.INTERFACE_DATA: interface,
        m.PORT_NUMBERS: port_real,
        m.PORT_DATA: port_data,
    }


def _body(mechanism: Mechanism, link: int) -> tuple[str, Labelled]:
    """Return name and bundle of a flexible link's body."""
    name, bundle = mechanism.links[link].flexible, mechanism.links[link].bundle
    assert name is not None
    assert bundle is not None
    return name, bundle


def shortening(mechanism: Mechanism, link: int, frame: str | None = None) -> np.ndarray | None:
    """Return a bent body's shortening per pair of modes at a frame [1/(kg m)], or first moment [1/m]; (mode, mode).

    link: a flexible one.  frame: its name in the bundle, None for the first moment.  None without stiffening in the
    scene.
    """
    body, bundle = _body(mechanism, link)
    if mechanism.scene.flexible()[body].stiffening is None:
        return None
    if "frame_shortening" not in bundle:
        raise InputError(
            f"[body.{body}.stiffening]",
            "the bundle of its mesh has no shortening of bent bodies",
            "stiffening is for beams; remove it",
        )
    if frame is None:
        return bundle["shortening_first_moment"].values
    return bundle["frame_shortening"].values[frame_index(bundle, frame)]


def shift(
    shape: np.ndarray, shortening: np.ndarray | None, q: np.ndarray, u: np.ndarray, du: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""Return displacement :math:`S q + \tfrac12 q^T B q\, e_x` of a point in the body frame, and its two rates.

    shape: S, (3, mode).  shortening: B of a bent beam, (mode, mode); None where the scene leaves it out.
    q, u, du: modal coordinates, rates and second rates, (time, mode).
    """
    displacement, rate, second = q @ shape.T, u @ shape.T, du @ shape.T
    if shortening is not None:
        bent, turning = q @ shortening, u @ shortening
        displacement[:, 0] += 0.5 * np.sum(bent * q, axis=1)
        rate[:, 0] += np.sum(bent * u, axis=1)
        second[:, 0] += np.sum(bent * du, axis=1) + np.sum(turning * u, axis=1)
    return displacement, rate, second


def _damping(name: str, body: FlexibleBody, bundle: Labelled) -> np.ndarray:
    """Return damping 2 zeta omega of each mode [1/s]; raise InputError when ratios and modes differ in number."""
    square = np.diag(bundle["modal_stiffness"].values)
    given = body.damping
    if isinstance(given, Rayleigh):
        return given.alpha + given.beta * square
    if isinstance(given, RatioPerMode) and len(given.ratios) != len(square):
        raise InputError(
            f"[body.{name}.damping.ratios]",
            f"{len(given.ratios)} damping ratios are given for {len(square)} modes",
            "give one ratio per mode",
        )
    ratios = given.ratios if isinstance(given, RatioPerMode) else given or 0.0
    return 2.0 * np.asarray(ratios) * np.sqrt(square)


def _forms(mechanism: Mechanism, link: int, n: int) -> list[np.ndarray]:
    """Return int rho B and int rho x B of a body, n n entries each; zeros for a body without stiffening."""
    first = shortening(mechanism, link)
    second = None if first is None else _body(mechanism, link)[1]["shortening_second_moment"].values
    return [np.zeros(n * n) if form is None else form.ravel() for form in (first, second)]


def _data(bundle: Labelled, damping: np.ndarray) -> np.ndarray:
    """Return C1 (3n), E (9n), modal mass (n n), stiffness omega^2 (n), damping 2 zeta omega (n).

    The coordinates of a bundle are mass-normalised eigenmodes of its reduced matrices.
    """
    stiffness = np.diag(bundle["modal_stiffness"].values)
    chunks = [
        bundle["modal_first_moment"].values,
        bundle["position_mode_moment"].values,
        bundle["modal_mass"].values,
        stiffness,
        damping,
    ]
    return np.concatenate([c.ravel() for c in chunks])


def _interface_data(bundle: Labelled, basis: InterfaceBasis) -> np.ndarray:
    """Return C1 (3n), modal mass (n n) and stiffness (n n) in the interface basis."""
    T, mass = basis.matrix, bundle["modal_mass"].values
    mixed = mass if mass_coupled(bundle) else np.diag(np.diag(T.T @ np.diag(np.diag(mass)) @ T))
    stiffness = T.T @ (np.diag(bundle["modal_stiffness"].values)[:, None] * T)
    return np.concatenate([(bundle["modal_first_moment"].values @ T).ravel(), mixed.ravel(), stiffness.ravel()])


def _moments(bundle: Labelled) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return nonzero int rho S_ki S_lj by row (3k + l) n + j: values, modes i, and the end of each row among them."""
    F = bundle["mode_mode_moment"].values
    n = F.shape[-1]
    k, l, i, j = np.nonzero(np.abs(F) > NO_COUPLING * max(np.abs(F).max(), 1e-300))
    row = (3 * k + l) * n + j
    order = np.lexsort((i, row))
    return F[k, l, i, j][order], i[order], np.cumsum(np.bincount(row, minlength=9 * n))


def _inboard_frame(mechanism: Mechanism, link: int) -> str | None:
    """Return the bundle's name of a flexible link's inboard frame; None for a body without joint in the tree."""
    frame = mechanism.links[link].branch.frame
    return None if frame is None else frame.partition(".")[2]


def _inboard_moves(mechanism: Mechanism, link: int) -> bool:
    """Return True when modes move the inboard frame of a flexible link."""
    frame = _inboard_frame(mechanism, link)
    if frame is None:
        return False
    _, *shapes = frame_shapes(_body(mechanism, link)[1], frame)
    at_frame = shortening(mechanism, link, frame)
    return any(np.any(shape) for shape in [*shapes, *([] if at_frame is None else [at_frame])])


def coupled(mechanism: Mechanism, link: int) -> bool:
    """Return True when modes of a flexible link have common entries in its own block of the mass matrix.

    They have where they move the inboard frame, and with it the whole body.
    """
    return _inboard_moves(mechanism, link) or mass_coupled(_body(mechanism, link)[1])


def _ports(numbering: Numbering, shortened: bool) -> tuple[list[Any], list[Any], list[float]]:
    """Return the tables of ports: of sites, then one per flexible link's own frame (`Numbering.port_of_inboard`)."""
    mechanism = numbering.mechanism
    rows, reals, data = list[Any](), list[Any](), list[float]()
    ports = [(numbering.sites[p.site].link, p.frame.partition(".")[2], p.column) for p in numbering.ports]
    for link, frame, column in [*ports, *((i, _inboard_frame(mechanism, i), -1) for i in numbering.flexible)]:
        n = len(numbering.modal_positions[link])
        if frame is None:
            pose, *shapes = np.concatenate([np.zeros(3), np.eye(3).ravel()]), np.zeros((3, n)), np.zeros((3, n))
        else:
            pose, *shapes = frame_shapes(_body(mechanism, link)[1], frame)
        chunks: list[np.ndarray] = [(shape @ numbering.bases[link].moving).ravel() for shape in shapes]
        if shortened:
            at_frame = None if frame is None else shortening(mechanism, link, frame)
            chunks.append(np.zeros(n * n) if at_frame is None else at_frame.ravel())
        rows.append((numbering.flexible.index(link), column, len(data)))
        reals.append(pose)
        data += np.concatenate(chunks).tolist()
    return rows, reals, data


def start_place(mechanism: Mechanism, site: Site) -> Placement:
    """Return a site's placement in its link, moved by the deformation that the scene gives the body at the start."""
    q, bundle = mechanism.deformation.get(site.link), mechanism.links[site.link].bundle
    if q is None or bundle is None or site.frame is None:
        return site.placement
    label = site.frame.partition(".")[2]
    _, moves, turns = frame_shapes(bundle, label)
    rest = np.zeros((1, len(q)))
    shifted, _, _ = shift(moves, shortening(mechanism, site.link, label), q[None], rest, rest)
    return Placement(site.placement.p + shifted[0], rotation_vector_to_matrix(turns @ q) @ site.placement.R)
