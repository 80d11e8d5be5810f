"""Beam frequencies: the elements against closed forms, and the closed forms against independent ones."""

import numpy as np
import pytest

from flexclear.pipeline.structure.fe import beam
from tests.analytic.beam_models import BENDING, build, frequencies
from tests.analytic.beam_solutions import PAPER_ROD, element_stiffness

# Finite-element frequencies [Hz] of the paper's rod from a program of other authorship that shares no code with
# this one: consistent Rayleigh mass, cubic deflections; keys are the ends (C clamped, F free, P pinned) and elements.
ELEMENTS = {
    ("FF", 2): (1567.9065387914186, 4838.335519793527, 11676.988265679327, 18263.365322754766),
    ("FF", 4): (1566.1120856353364, 4284.308187581014, 8285.19120248972, 14858.680463312916),
    ("FF", 12): (1564.4882760528321, 4259.459914504601, 8221.007402548948, 13339.590516424732),
    ("CC", 2): (1602.3240052032395, 5724.292554751857),
    ("CC", 4): (1579.067277417862, 4355.313618255282, 8538.163010273025, 15880.659637894998),
    ("CC", 12): (1577.0026042017876, 4316.201879649168, 8370.848463714992, 13643.794535536754),
    ("CF", 1): (249.40801209568147, 2429.119839012649),
    ("CF", 2): (248.35555761599477, 1559.2806925479883, 5208.700759760067, 14444.126563383414),
    ("CF", 12): (248.23625761579262, 1546.4166647860095, 4289.474070761246, 8294.960724670302),
    ("PP", 2): (698.7694106315633, 3070.1881918465206, 7629.387885181169, 13700.272798257924),
    ("PP", 12): (696.0251060608961, 2766.5908290607304, 6161.586343135218, 10805.067525023285),
}
EULER_BERNOULLI_ELEMENTS = {
    ("FF", 12): (1581.2073778197496, 4359.11929050624, 8548.482104475035, 14141.75185491859),
    ("CC", 12): (1581.207899229326, 4359.13775873549, 8548.676712442815, 14142.881215846128),
    ("CF", 12): (248.48654673247827, 1557.2629617879643, 4360.853012786506, 8548.474951057937),
    ("PP", 12): (697.5142882495918, 2790.1925649758396, 6279.238213266375, 11169.228974702484),
}
# two eigensolvers on matrices whose spectrum spans 1e6: eps * 1e6, with a margin of ten
SOLVERS = 1e-9


@pytest.mark.parametrize(
    "theory, ends, elements, expected",
    [("rayleigh", *case, hertz) for case, hertz in ELEMENTS.items()]
    + [("euler-bernoulli", *case, hertz) for case, hertz in EULER_BERNOULLI_ELEMENTS.items()],
)
def test_elements_agree_with_an_independent_program(
    theory: str, ends: str, elements: int, expected: tuple[float, ...]
) -> None:
    hertz = frequencies(build(elements=elements, theory=theory), BENDING, ends, len(expected))
    np.testing.assert_allclose(hertz, expected, rtol=SOLVERS)


@pytest.mark.parametrize("elements", [12, 256])
def test_every_cell_has_the_textbook_stiffness(elements: int) -> None:
    """Also far from the origin, where elements built from global monomials lose six digits."""
    stiffness = beam.assemble(build(elements=elements)).stiffness.toarray()
    h = PAPER_ROD.length / elements
    expected = element_stiffness(PAPER_ROD, h)
    scale = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
    # entries that couple two neighbouring nodes belong to one cell only
    for cell in (0, elements // 2, elements - 1):
        rows, columns = slice(6 * cell, 6 * cell + 6), slice(6 * cell + 6, 6 * cell + 12)
        error = np.abs(stiffness[rows, columns] - expected[:6, 6:]) / scale[:6, 6:]
        assert error.max() < 1e-12  # the node positions themselves round at 1e-16 L, cells are L/256
    assert np.abs(stiffness[:6, :6] - expected[:6, :6]).max() <= 1e-12 * expected.max()
