"""Named fields: compiled, interpreted and traced kernels read and write what `memory` declares."""

import numpy as np
import pytest
from numba import njit, types
from numba.core.errors import NumbaError, TypingError

import flexclear.dynamics.compile.calls  # noqa: F401  (registers the types of named fields)
from flexclear.dynamics import memory as m
from flexclear.dynamics.effects.declared import EFFECTS
from flexclear.dynamics.fields import Data, data
from flexclear.dynamics.memory import ARRAYS, row_fields
from flexclear.dynamics.memory import NAMED as TABLES

ROWS = 3


def arrays() -> tuple[np.ndarray, ...]:
    """h, f, w, n with every stretch and ROWS rows of every table at an offset of its own; entries are all different."""
    h, sizes = np.zeros(m.HEADER, np.int64), {"h": m.HEADER, "f": 0, "w": 0}
    for name, table in TABLES.items():
        h[table.at] = sizes[ARRAYS[name]]
        sizes[ARRAYS[name]] += ROWS * table.size
    for place in m.STRETCHES.values():
        h[place] = sizes["w"]
        sizes["w"] += m.AWAITED_TIME + 1  # the most named floats that a stretch has
    for k, place in enumerate(m.SIZES.values()):
        h[place] = -1 - k
    topology = np.arange(m.HEADER, sizes["h"]) * 10
    f, w = (np.arange(float(sizes[array])) + start for array, start in (("f", 0.25), ("w", 0.5)))
    n = np.arange(m.INTEGERS + 2 * ROWS)
    n[m.ACTIVE], n[m.MODE] = m.INTEGERS, m.INTEGERS + ROWS
    return np.concatenate([h, topology]), f, w, n


def test_names_are_those_of_memory_and_none_means_two_things() -> None:
    floats = {name: offset for name, (_, offset) in m.FLOATS.items()}
    kinds = (m.SIZES, m.STRETCHES, m.REPORTS, m.LISTS, floats, TABLES)
    names = [name for kind in (*kinds, m.INDICES) for name in kind]
    assert len(names) == len(set(names))
    stretches = {one.partition(":")[0] for effect in EFFECTS for one in effect.stretches}
    of_effects = {name for effect in EFFECTS for name in effect.sizes} | stretches | set(m.OF_EFFECTS)
    for kind in kinds:
        named = set(kind) - of_effects  # those of effects are read by their names alone
        assert {name: getattr(m, name.upper()) for name in named} == {name: kind[name] for name in named}
    assert sorted([*m.REPORTS.values(), *m.LISTS.values()]) == list(range(m.INTEGERS))
    assert len(m.SIZES) + len(m.STRETCHES) + len(TABLES) + len(m.ADDRESSES) == m.HEADER


@pytest.mark.parametrize("name", TABLES)
def test_python_has_each_field_of_each_row(name: str) -> None:
    """Against rows as NumPy has them."""
    given = arrays()
    h = given[0]
    table, array = TABLES[name], dict(zip("hfwn", given, strict=True))[ARRAYS[name]]
    begin = h[table.at]
    rows = m.named(table, array[begin : begin + ROWS * table.size])
    for field, (_, shape) in row_fields(name).items():
        held = getattr(getattr(Data(*given), name)[1], field)
        size = int(np.prod(shape))
        entries = [held[k] for k in range(size)] if shape else [held]
        np.testing.assert_array_equal(entries, np.ravel(rows[field][1]))


def changed(h, f, w, n):
    """Something of every kind: returns a number, and writes into w and n."""
    d = data(h, f, w, n)
    frame, touch = d.link_frames[1], d.touch[2]
    frame.origin = (frame.omega[2], d.link_numbers[0].com[1], 7)
    frame.axes = d.site_numbers[2].axes
    touch.gap += d.link_numbers[1].inertia[4]
    d.law[1].rate = d.gravity[0].acceleration[2]
    d.roots[1] += d.u[2]
    d.evaluation, d.abridged = d.links[2].joint, d.state + 3
    d.mode[1] += 5
    d.rtol = d.last_pivot + d.w[d.at_y + 1] + d.at_touch
    return d.nv + d.links[d.n_links + 2].parent + d.touch[1].gap


def test_compiled_kernels_do_as_interpreted_ones() -> None:
    plain, coded = arrays(), arrays()
    pointers = types.CPointer(types.int64), types.CPointer(types.float64)
    assert pointers[0] != pointers[1]
    scope = {**changed.__globals__, "data": lambda *given: Data(*given)}
    by_python = type(changed)(changed.__code__, scope)(*plain)
    assert njit(changed)(*coded) == by_python
    for a, b, before in zip(plain, coded, arrays(), strict=True):
        np.testing.assert_array_equal(a, b)
        assert (a is plain[2] or a is plain[3]) != np.array_equal(a, before)
    links = m.named(m.LINKS, plain[0][plain[0][m.LINKS.at] :][: ROWS * m.LINKS.size])
    assert plain[3][m.EVALUATION] == links["joint"][2]


def test_a_name_that_nothing_declares_is_an_error_of_the_compiler() -> None:
    def unknown(h, f, w, n):
        return data(h, f, w, n).links[0].parents

    def whole(h, f, w, n):
        data(h, f, w, n).n_links = 3

    with pytest.raises(TypingError, match="parents"):
        njit(unknown)(*arrays())
    with pytest.raises((NumbaError, TypeError), match="cannot assign n_links"):
        njit(whole)(*arrays())
    with pytest.raises(AttributeError, match="parents"):
        _ = Data(*arrays()).links[0].parents
