"""Tables of the flexible bodies from their bundles; motion of points on these bodies with the modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model import interface_basis
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
    data, index, interface = list[float](), list[int](), list[float]()
    value = list[list[float]]()
    entry, entry_value = list[tuple[int, int]](), list[float]()
    mechanism, bodies = numbering.mechanism, numbering.mechanism.scene.flexible()
    any_stiffened = any(b.stiffening is not None for b in bodies.values())
    for i in numbering.flexible:
        name, bundle = _body(mechanism, i)
        q, c = numbering.modal_positions[i], numbering.modal_coordinates[i]
        moments, where, row_ends = _moments(bundle)
        basis, moves = numbering.bases[i], int(_inboard_moves(mechanism, i))
        entries, places = basis.entries(), (i, len(q), q.start, c.start, len(data), len(value), len(ends))
        of_basis = (basis.held, len(entry), len(entries), len(interface))
        flex.append((*places, moves, int(coupled(mechanism, i)), *of_basis, losses[mechanism.components.of(i)]))
        flex_real.append(
            [
                float(bundle["mass"].values),
                *bundle["first_moment"].values,
                *bundle["second_moment"].values.ravel(),
                *bundle["untilted_inertia"].values[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
            ]
        )
        entry += entries
        entry_value += [basis.matrix[where_] for where_ in entries]
        interface += _interface_data(bundle, basis).tolist()
        data += _data(bundle, _damping(name, bodies[name], bundle)).tolist()
        if any_stiffened:
            first = second_first_moment(mechanism, i)
            data += (np.zeros(3 * len(q) ** 2) if first is None else first.ravel()).tolist()
        ends += (len(value) + row_ends).tolist()
        value += moments.tolist()
        index += where.tolist()
    port, port_real, port_data = _ports(numbering, any_stiffened)
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


def second_first_moment(mechanism: Mechanism, link: int) -> np.ndarray | None:
    """Return second derivatives of a flexible link's first moment by modes [kg/m], (axis, mode, mode).

    None without stiffening in the scene.
    """
    body, bundle = _body(mechanism, link)
    stiffened = mechanism.scene.flexible()[body].stiffening is not None
    return bundle["second_order_first_moment"].values if stiffened else None


def second_motion(mechanism: Mechanism, link: int, frame: str) -> tuple[np.ndarray, np.ndarray] | tuple[None, None]:
    """Return second derivatives of a frame's displacement [1/m] and rotation [1/m^2] by modes, (axis, mode, mode).

    link: a flexible one.  frame: its name in the bundle.  None without stiffening in the scene.
    """
    body, bundle = _body(mechanism, link)
    if mechanism.scene.flexible()[body].stiffening is None:
        return None, None
    k = interface_basis.frame_index(bundle, frame)
    return bundle["frame_second_translation"].values[k], bundle["frame_second_rotation"].values[k]


def shift(
    shape: np.ndarray, second: np.ndarray | None, q: np.ndarray, u: np.ndarray, du: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""Return displacement :math:`S q + \tfrac12 q^T G q` of a point in the body frame, and its two rates.

    shape: S, (3, mode).  second: G, (3, mode, mode); None where loads do not stiffen the body.
    q, u, du: modal coordinates, rates and second rates, (time, mode).
    """
    displacement, rate, acceleration = q @ shape.T, u @ shape.T, du @ shape.T
    if second is not None:
        bent, turning = np.einsum("ti,kij->tkj", q, second), np.einsum("ti,kij->tkj", u, second)
        displacement += 0.5 * np.einsum("tkj,tj->tk", bent, q)
        rate += np.einsum("tkj,tj->tk", bent, u)
        acceleration += np.einsum("tkj,tj->tk", bent, du) + np.einsum("tkj,tj->tk", turning, u)
    return displacement, rate, acceleration


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


def _interface_data(bundle: Labelled, basis: interface_basis.InterfaceBasis) -> np.ndarray:
    """Return C1 (3n), modal mass (n n) and stiffness (n n) in the interface basis."""
    T, mass = basis.matrix, bundle["modal_mass"].values
    mixed = mass if interface_basis.mass_coupled(bundle) else np.diag(np.diag(T.T @ np.diag(np.diag(mass)) @ T))
    stiffness = T.T @ (np.diag(bundle["modal_stiffness"].values)[:, None] * T)
    return np.concatenate([(bundle["modal_first_moment"].values @ T).ravel(), mixed.ravel(), stiffness.ravel()])


def _moments(bundle: Labelled) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return nonzero rows of MOMENT_VALUES by row (3k + l) n + j, modes i, and the end of each row among them."""
    F, L = bundle["mode_mode_moment"].values, bundle["second_order_moment"].values
    n, both = F.shape[-1], np.stack([F + L, F])
    k, l, i, j = np.nonzero(np.any(np.abs(both) > interface_basis.NO_COUPLING * max(np.abs(F).max(), 1e-300), axis=0))
    row = (3 * k + l) * n + j
    order = np.lexsort((i, row))
    return both[:, k, l, i, j][:, order].T, i[order], np.cumsum(np.bincount(row, minlength=9 * n))


def _inboard_frame(mechanism: Mechanism, link: int) -> str | None:
    """Return the bundle's name of a flexible link's inboard frame; None for a body without joint in the tree."""
    frame = mechanism.links[link].branch.frame
    return None if frame is None else frame.partition(".")[2]


def _inboard_moves(mechanism: Mechanism, link: int) -> bool:
    """Return True when modes move the inboard frame of a flexible link."""
    frame = _inboard_frame(mechanism, link)
    if frame is None:
        return False
    _, *shapes = interface_basis.frame_shapes(_body(mechanism, link)[1], frame)
    return any(np.any(shape) for shape in [*shapes, *second_motion(mechanism, link, frame)] if shape is not None)


def coupled(mechanism: Mechanism, link: int) -> bool:
    """Return True when modes of a flexible link have common entries in its own block of the mass matrix.

    They have where they move the inboard frame, and with it the whole body.
    """
    return _inboard_moves(mechanism, link) or interface_basis.mass_coupled(_body(mechanism, link)[1])


def _ports(numbering: Numbering, stiffened: bool) -> tuple[list[Any], list[Any], list[float]]:
    """Return the tables of ports: of sites, then one per flexible link's own frame (`Numbering.port_of_inboard`)."""
    mechanism = numbering.mechanism
    rows, reals, data = list[Any](), list[Any](), list[float]()
    ports = [(numbering.sites[p.site].link, p.frame.partition(".")[2]) for p in numbering.ports]
    for link, frame in [*ports, *((i, _inboard_frame(mechanism, i)) for i in numbering.flexible)]:
        n = len(numbering.modal_positions[link])
        if frame is None:
            pose, *shapes = np.concatenate([np.zeros(3), np.eye(3).ravel()]), np.zeros((3, n)), np.zeros((3, n))
        else:
            pose, *shapes = interface_basis.frame_shapes(_body(mechanism, link)[1], frame)
        chunks: list[np.ndarray] = [(shape @ numbering.bases[link].moving).ravel() for shape in shapes]
        if stiffened:
            forms = (None, None) if frame is None else second_motion(mechanism, link, frame)
            chunks += [np.zeros(3 * n * n) if form is None else form.ravel() for form in forms]
        rows.append((numbering.flexible.index(link), len(data)))
        reals.append(pose)
        data += np.concatenate(chunks).tolist()
    return rows, reals, data


def start_place(mechanism: Mechanism, site: Site) -> Placement:
    """Return a site's placement in its link, moved by the deformation that the scene gives the body at the start."""
    q, bundle = mechanism.deformation.get(site.link), mechanism.links[site.link].bundle
    if q is None or bundle is None or site.frame is None:
        return site.placement
    label = site.frame.partition(".")[2]
    _, moves, turns = interface_basis.frame_shapes(bundle, label)
    rest = np.zeros((1, len(q)))
    second = second_motion(mechanism, site.link, label)
    shifted, turned = (shift(S, G, q[None], rest, rest)[0][0] for S, G in zip((moves, turns), second, strict=True))
    return Placement(site.placement.p + shifted, rotation_vector_to_matrix(turned) @ site.placement.R)
