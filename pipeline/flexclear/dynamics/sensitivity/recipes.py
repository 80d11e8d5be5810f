"""Changes of reduced bodies with numbers of their mesh recipes, by differences of bundles.

Bundles have their own eigenmodes. These change smoothly with a number of the recipe, but for their signs and, where
frequencies coincide, for rotations among modes of equal frequency; both are undone first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from flexclear.artifacts.labelled import Labelled, LabelledArrays, label_dataset
from flexclear.system.errors import InputError, SolverError

#: change of a recipe's number between bundles, as a fraction of it
RECIPE_STEP = 1e-3
#: largest disagreement of differences over two and over four bundles, as a fraction of the change or of the value
AGREEMENT, SLIGHT = 1e-2, 1e-4
#: variables of modes that do not depend on their signs
UNSIGNED = ("frequency", "effective_mass")
#: shapes of the modes, from which their signs are seen
SHAPES = ("frame_translation_shape", "frame_rotation_shape", "shape_translation", "shape_rotation")


@dataclass(frozen=True)
class Varied:
    """A number of a body's recipe; changes: of the variables of its bundle, per unit of the number."""

    body: str
    value: float
    written_in: str
    changes: Mapping[str, np.ndarray]

    def bundle(self, base: Labelled, amount: float) -> LabelledArrays:
        """Return the body's bundle with the number changed by `amount` of its units."""
        arrays = label_dataset(base)
        moved = {
            name: replace(arrays[name], values=arrays[name].values + amount * change)
            for name, change in self.changes.items()
        }
        return replace(arrays, variables={**arrays.variables, **moved})


def vary_number(
    path: str, body: str, number: tuple[float, str], base: Labelled, around: Mapping[int, Labelled]
) -> Varied:
    """Return a number of a recipe from bundles at -2, -1, 1 and 2 steps (`RECIPE_STEP`) of it.

    Raises InputError where the bundles differ in their variables' shapes, SolverError where they do not change
    smoothly.
    """
    middle, sides = label_dataset(base), {k: label_dataset(bundle) for k, bundle in around.items()}
    names = [n for n in middle if middle[n].values.dtype.kind == "f"]
    if any(n not in side or side[n].values.shape != middle[n].values.shape for side in sides.values() for n in names):
        raise InputError(path, f"changes the number of modes or nodes of '{body}'", "give [modes] a count")
    turns = {k: _alignment(middle, side) for k, side in sides.items()} if "frequency" in middle else {}
    changes = {}
    for name in names:
        v = {k: _in_aligned_modes(name, side, turns[k]) if turns else side[name].values for k, side in sides.items()}
        narrow = (v[1] - v[-1]) / (2.0 * RECIPE_STEP)
        change = (v[-2] - 8.0 * v[-1] + 8.0 * v[1] - v[2]) / (12.0 * RECIPE_STEP)
        off, largest, size = (float(np.abs(x).max(initial=0.0)) for x in (narrow - change, change, middle[name].values))
        if name not in UNSIGNED and off > AGREEMENT * largest + SLIGHT * size:
            raise SolverError(f"{path}: the modes of '{body}' do not change smoothly with it")
        changes[name] = change
    return Varied(body, *number, changes)


def _alignment(base: LabelledArrays, other: LabelledArrays) -> np.ndarray:
    """Return the matrix from the modes of `base` to those of `other`: signs, and rotations of equal frequencies."""
    frequency = base["frequency"].values
    one, two = (
        np.concatenate([b[name].values.reshape(-1, len(frequency)) for name in SHAPES if name in b])
        for b in (base, other)
    )
    overlap, turn, first = two.T @ one, np.zeros((len(frequency),) * 2), 0
    for k in range(1, len(frequency) + 1):
        # modes with frequencies closer than this fraction may rotate among each other
        if k == len(frequency) or frequency[k] - frequency[k - 1] > 1e-6 * frequency[k]:
            u, _, v = np.linalg.svd(overlap[first:k, first:k])
            turn[first:k, first:k], first = u @ v, k
    return turn


def _in_aligned_modes(name: str, bundle: LabelledArrays, turn: np.ndarray) -> np.ndarray:
    """Return a variable of a bundle in aligned modes."""
    array = bundle[name]
    values = array.values
    if name not in UNSIGNED:
        for axis, dim in enumerate(array.dims):
            if dim.startswith("mode"):
                values = np.moveaxis(np.tensordot(values, turn, axes=(axis, 0)), -1, axis)
    return values
