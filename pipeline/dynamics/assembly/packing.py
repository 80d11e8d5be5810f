"""Named tables into the flat arrays h, f, w and n that the kernels take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics import tables
from pipeline.dynamics.assembly.places import PIVOT_SIZE
from pipeline.dynamics.integrate import state
from pipeline.dynamics.integrate.method import Method


@dataclass(frozen=True)
class Packed:
    """Wiring and numbers of a system; `sizes` are those of the header, by name."""

    h: np.ndarray
    f: np.ndarray
    sizes: dict[str, int]
    work_size: int
    integers: int

    def offset(self, name: str) -> int:
        """Where a table or a stretch of the work space begins."""
        return int(self.h[tables.place(name)])

    def table(self, name: str) -> np.ndarray:
        """A view of a named wiring or number table, shape (rows, columns)."""
        wiring = name in tables.WIRING
        columns = tables.WIRING[name] if wiring else tables.NUMBERS[name]
        start = self.offset(name)
        end = start + self.sizes[f"rows of {name}"] * columns
        return (self.h if wiring else self.f)[start:end].reshape(-1, columns)

    def work_space(self) -> tuple[np.ndarray, np.ndarray]:
        """A zeroed work space w with the ground in place, and the integers n."""
        w, n = np.zeros(self.work_size), np.zeros(self.integers, dtype=np.int64)
        axes = self.offset("LINK_FRAMES") + tables.AXES
        w[axes : axes + 9] = np.eye(3).ravel()
        n[tables.ACTIVE] = state.INTEGERS
        n[tables.MODE] = state.INTEGERS + self.sizes["N_LAWS"]
        return w, n


def pack(
    sizes: Mapping[str, int],
    wiring: Mapping[str, np.ndarray],
    numbers: Mapping[str, np.ndarray],
    method: Method,
    columns: int,
) -> Packed:
    """Pack named tables; `columns`: number of twist columns; `method` says what room it needs."""
    all_sizes = dict(sizes)
    h = np.zeros(tables.HEADER, dtype=np.int64)
    chunks: list[np.ndarray] = [h]
    start = tables.HEADER
    for name in tables.WIRING:
        chunk = np.asarray(wiring[name], dtype=np.int64).ravel()
        h[tables.place(name)] = start
        all_sizes[f"rows of {name}"] = len(chunk) // tables.WIRING[name]
        start += len(chunk)
        chunks.append(chunk)
    reals: list[np.ndarray] = []
    start = 0
    for name in tables.NUMBERS:
        chunk = np.asarray(numbers[name], dtype=float).ravel()
        h[tables.place(name)] = start
        all_sizes[f"rows of {name}"] = len(chunk) // tables.NUMBERS[name]
        start += len(chunk)
        reals.append(chunk)
    all_sizes |= _sizes(all_sizes, wiring)
    for name in tables.SIZES:
        h[tables.place(name)] = all_sizes[name]
    start = 0
    for name, length in _work_lengths(all_sizes, method, columns).items():
        h[tables.place(name)] = start
        start += length
    integers = state.INTEGERS + all_sizes["N_LAWS"] + all_sizes["N_CONTACTS"]
    return Packed(np.concatenate(chunks), np.concatenate(reals), all_sizes, start, integers)


def _sizes(sizes: Mapping[str, int], wiring: Mapping[str, np.ndarray]) -> dict[str, int]:
    """The header's sizes that follow from the tables."""
    count = {name: sizes[f"rows of {name}"] for name in tables.WIRING}
    return {
        "N_LINKS": count["LINKS"],
        "N_SITES": count["SITES"],
        "N_FLEX": count["FLEXES"],
        "N_CLOSURES": count["CLOSURES"],
        "N_CLOSURE_ROWS": count["CLOSURE_ROWS"],
        "N_KEPT_ROWS": count["CLOSURE_ENVELOPE"],
        "N_CONTACTS": count["CONTACTS"],
        "N_LAWS": count["LAWS"],
        "N_LOADS": count["LOADS"],
        "NV": count["ENVELOPE"],
        "NY": count["GROUPS"],
        "N_PAIRS": count["PAIRS"],
        "N_KNOWN_PAIRS": count["KNOWN_PAIRS"],
        "N_KNOWN_ENTRIES": count["KNOWN_ENTRIES"],
        "N_CLOSURE_PAIRS": count["CLOSURE_PAIRS"],
        "N_GROUPS": sizes["rows of FLOORS"],
        "MASS_SIZE": envelope_size(wiring["ENVELOPE"]),
        "SCHUR_SIZE": envelope_size(wiring["CLOSURE_ENVELOPE"]),
        "JACOBIAN_SIZE": int(sum(c[tables.N_ROWS] * c[tables.N_SUPPORT] for c in wiring["CLOSURES"])),
    }


def envelope_size(envelope: np.ndarray) -> int:
    """Entries of a matrix in envelope form."""
    if not len(envelope):
        return 0
    last = len(envelope) - 1
    return int(envelope[last, 1] + last - envelope[last, 0] + 1)


def _work_lengths(s: Mapping[str, int], method: Method, columns: int) -> dict[str, int]:
    known, contacts, ny = s["N_DRIVES"], s["N_CONTACTS"], s["NY"]
    jacobian = s["JACOBIAN_SIZE"]
    rows, coordinates, positions = s["N_CLOSURE_ROWS"], s["NV"] + known, s["NQ"] + known
    lengths = {
        "X": positions,
        "U": coordinates,
        "DU": coordinates,
        "LINK_FRAMES": tables.FRAME_SIZE * s["N_LINKS"],
        "SITE_FRAMES": tables.FRAME_SIZE * s["N_SITES"],
        "JOINT": tables.JOINT_SIZE,
        "OWN": tables.INERTIA_SIZE * s["N_LINKS"],
        "INERTIA": tables.INERTIA_SIZE * s["N_LINKS"],
        "WRENCH": 6 * s["N_LINKS"],
        "COLUMNS": 6 * columns,
        "MOMENTA": 6 * columns,
        "DEFORMATION": 6 * s["NV"],
        "BIAS": coordinates,
        "MODAL_BIAS": s["NV"],
        "MODAL": 18 * s["MOST_MODES"],
        "SCRATCH": 18,
        "MASS": s["MASS_SIZE"],
        "FORCE": s["NV"],
        "ROWS": 6 * rows,
        "RESIDUAL": rows,
        "RESIDUAL_RATE": rows,
        "GAMMA": rows,
        "JACOBIAN": jacobian,
        "SPREAD": jacobian,
        "SCHUR": s["SCHUR_SIZE"],
        "ROW_SCALE": 2 * rows,
        "PIVOT": PIVOT_SIZE,
        "MULTIPLIER": rows,
        "TOUCH": tables.TOUCH_SIZE * contacts,
        "LAW": tables.LAW_SIZE * s["N_LAWS"],
        "LOAD": tables.LOAD_SIZE * s["N_LOADS"],
        "TURN": s["N_TURNS"],
        "DRIVE_FORCE": known,
        "LEDGER_RATE": s["N_LEDGER"],
        "POSITION_RATE": positions,
        "Y": ny,
        "Y_NEW": ny,
        "Y_STAGE": ny,
        "SLOPES": method.slopes * ny,
        "DENSE": method.dense * ny,
        "MEMORY": method.memory(s["NQ"], s["NV"], ny),
        "MAGNITUDE": s["N_GROUPS"],
        "CORRECTION": s["NV"],
        "LATCHED": contacts,
        "WATCH": state.WATCH_SIZE * contacts,
        "CONTROL": state.N_CONTROLS,
    }
    return {name: lengths[name] for name in tables.WORK}
