"""Interface that each kind of body implements for the stages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flexclear.structure.fe.model import Interface, Model, SecondOrder
from flexclear.system.errors import InputError


def no_stresses(mesh: xr.Dataset, model: Model, vectors: np.ndarray, stiffening: bool, held: Interface | None) -> None:
    """Return None: the stresses of the body are unknown; raise InputError where they are needed."""
    if stiffening:
        raise InputError("[body] stiffening", "matrices do not give the stresses of a body", "remove stiffening")


@dataclass(frozen=True)
class Kind:
    """Functions of one kind of body.

    build: the mesh dataset, from the recipe, the folder that its paths are relative to, and its name in messages.
    vtu: a VTU file of the mesh dataset, for ParaView.
    assemble: the model of the mesh dataset.
    words: one word for the motion of each mode, from its family and vectors of shape (ndof, n).
    cut: one segment of a mesh dataset; None for kinds without any.
    exact: closed-form frequencies [Hz] next to those of a reference condition, by variable, from the modes'
        families and the interfaces' names; None for kinds without any.
    second_order: second-order motion of vectors (ndof, n) that follows from stresses: without stiffening by forces and
        accelerations (False), or with it, held at an interface, if any; None where it has no such part.
    """

    build: Callable[[Any, Path, str], xr.Dataset]
    vtu: Callable[[xr.Dataset], bytes]
    assemble: Callable[[xr.Dataset], Model]
    words: Callable[[Model, list[str], np.ndarray], list[str]]
    cut: Callable[[xr.Dataset, Sequence[int]], xr.Dataset] | None = None
    exact: Callable[[xr.Dataset, str, list[str], tuple[str, ...]], dict[str, np.ndarray]] | None = None
    second_order: Callable[[xr.Dataset, Model, np.ndarray, bool, Interface | None], SecondOrder | None] = no_stresses
