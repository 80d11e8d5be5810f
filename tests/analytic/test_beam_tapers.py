"""Tapered rods against the closed forms of cones and wedges, whose sections the elements must not make a staircase."""

import math
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.special import iv, jv, kv, yv

from flexclear.pipeline.structure.fe import beam
from flexclear.pipeline.structure.kinds import kind
from tests.analytic.beam_models import BENDING, BENDING_Z, EXTENSION, RECIPE, TORSION, frequencies, order
from tests.analytic.beam_solutions import PAPER_ROD, scan

E, G, RHO, L = PAPER_ROD.youngs_modulus, PAPER_ROD.shear_modulus, PAPER_ROD.density, PAPER_ROD.length
#: thick and thin end [m]
THICK, THIN = 0.012, 0.004
#: distances of the ends from the apex of the cone or wedge [m]
FAR = L * THICK / (THICK - THIN)
NEAR = FAR - L
CONE = ({"type": "circle", "radius": THICK}, {"type": "circle", "radius": THIN})
WEDGE = (
    {"type": "rectangle", "width": 0.02, "height": THICK},
    {"type": "rectangle", "width": 0.02, "height": THIN},
)


def taper(sections: tuple[dict[str, Any], dict[str, Any]], elements: int, **changes: Any) -> xr.Dataset:
    return kind.build(RECIPE | {"elements": elements, "section": sections[0], "end_section": sections[1]} | changes)


def bending(n: int, ratio: float, ends: str, count: int) -> np.ndarray:
    """Euler-Bernoulli frequencies [Hz] of EI ~ x^(n+2), rho A ~ x^n, x from the apex; n = 2 cone, n = 1 wedge.

    v = x^(-n/2) {J, Y, I, K}_n(2 k sqrt x), k^4 = omega^2 rho A x^2 / EI; Kirchhoff (1882), Mabie & Rogers (1972),
    J. Acoust. Soc. Am. 51, 1771-1774.  ratio: EI / (rho A x^2) [m^2/s^2].  ends: far (thick) end first.
    """

    def determinant(omega: float) -> float:
        k = (omega**2 / ratio) ** 0.25
        rows = []
        for x, end in ((FAR, ends[0]), (NEAR, ends[1])):
            v = [_derivative(n, m, k, x) for m in range(4)]
            conditions = {"C": (v[0], v[1]), "F": (v[2], (n + 2) * v[2] / x + v[3]), "P": (v[0], v[2])}
            rows += list(conditions[end])
        matrix = np.array(rows)
        matrix /= np.abs(matrix).max(axis=0)
        return float(np.linalg.det(matrix / np.abs(matrix).max(axis=1)[:, None]))

    return scan(determinant, 0.3 * math.sqrt(ratio) * NEAR / L**2, count) / (2.0 * np.pi)


def _derivative(n: int, m: int, k: float, x: float) -> np.ndarray:
    """m-th derivative of the four solutions: each one raises the order, with sign - for J, Y and K, + for I."""
    z, power = 2.0 * k * math.sqrt(x), x ** (-(n + m) / 2.0)
    signs = np.array([(-k) ** m, (-k) ** m, k**m, (-k) ** m])
    return signs * power * np.array([jv(n + m, z), yv(n + m, z), iv(n + m, z), kv(n + m, z)])


def waves(p: float, speed: float, ends: str, count: int) -> np.ndarray:
    """Frequencies [Hz] of (x^(2p+1)... u')' + ...: extension (p = 1/2) and torsion (p = 3/2) of a cone.

    u = x^-p {J, Y}_p(q x), q = omega / speed, solves (x^(2p+1) u')' + q^2 x^(2p+1) u = 0.
    """

    def determinant(omega: float) -> float:
        q = omega / speed
        rows = []
        for x, end in ((FAR, ends[0]), (NEAR, ends[1])):
            step = 1.0 if end == "F" else 0.0  # the derivative raises the order
            rows.append([jv(p + step, q * x), yv(p + step, q * x)])
        return float(np.linalg.det(np.array(rows)))

    return scan(determinant, 0.2 * speed / L, count) / (2.0 * np.pi)


@pytest.mark.parametrize("ends", ["CF", "FC", "CC", "PP", "FF"])
@pytest.mark.parametrize("shape", ["cone", "wedge"])
def test_bending_converges_from_above_at_order_four(shape: str, ends: str) -> None:
    if shape == "cone":
        # I / (A x^2) = (r / x)^2 / 4
        n, ratio, sections, plane = 2, E / RHO * (THICK / FAR) ** 2 / 4.0, CONE, BENDING
    else:
        n, ratio, sections, plane = 1, E / RHO * (THICK / FAR) ** 2 / 12.0, WEDGE, BENDING_Z
    exact = bending(n, ratio, ends, 3)
    elements = [16, 32]
    error = np.array(
        [frequencies(taper(sections, k, theory="euler-bernoulli"), plane, ends, 3) / exact - 1.0 for k in elements]
    )
    assert error.min() > 0.0
    assert error[-1].max() < 1e-4  # 0.01 % with 32 elements
    # coarser meshes are not in the asymptotic range, finer ones meet the rounding of the first mode, 1e-8
    np.testing.assert_allclose(order(elements, error), 4.0, atol=0.15)


@pytest.mark.parametrize("ends", ["CF", "FC", "CC", "FF"])
@pytest.mark.parametrize("motion, p, name", [(EXTENSION, 0.5, "extension"), (TORSION, 1.5, "torsion")])
def test_waves_in_a_cone_converge_from_above(motion: tuple[int, ...], p: float, name: str, ends: str) -> None:
    exact = waves(p, math.sqrt((E if name == "extension" else G) / RHO), ends, 2)
    for degree, elements, expected in (("linear", [16, 32, 64], 2.0), ("quadratic", [8, 16, 32], 4.0)):
        error = np.array(
            [frequencies(taper(CONE, k, **{name: degree}), motion, ends, 2) / exact - 1.0 for k in elements]
        )
        assert error.min() > 0.0
        np.testing.assert_allclose(order(elements, error), expected, atol=0.15)


@pytest.mark.parametrize("theory", ["rayleigh", "timoshenko"])
def test_a_tapered_cantilever_deflects_as_the_integral_says(theory: str) -> None:
    """End force at the thin end: int s^2 / EI + int 1 / (kappa G A), s from that end."""
    section = CONE[0] | {"shear_coefficient": 0.9}
    found = beam.assemble(taper((section, CONE[1]), 32, theory=theory))
    free, tip = np.arange(6, found.size), found.nodal_size - 5
    force = np.zeros(found.size)
    force[tip] = 1.0
    deflection = np.linalg.solve(found.stiffness.toarray()[np.ix_(free, free)], force[free])[tip - 6]
    s, w = np.polynomial.legendre.leggauss(60)
    s, w = 0.5 * L * (1.0 + s), 0.5 * L * w
    radius = THIN + (THICK - THIN) * s / L
    expected = np.sum(w * s**2 / (E * np.pi * radius**4 / 4.0))
    if theory == "timoshenko":
        expected += np.sum(w / (0.9 * G * np.pi * radius**2))
    # cubic elements are exact for uniform cells only; the error falls with the fourth power, 32 leave 1e-5
    assert deflection == pytest.approx(expected, rel=2e-5)
    assert deflection < expected


def test_tapered_tube_and_its_mass() -> None:
    """Mass and first moment of a hollow cone against the volume of frusta."""
    tube = [{"type": "tube", "radius": r, "inner_radius": 0.5 * r} for r in (THICK, THIN)]
    rod = taper((tube[0], tube[1]), 3)
    ones = np.zeros((rod.sizes["node"], 6))
    ones[:, 0] = 1.0
    found = beam.assemble(rod)
    mass = ones.ravel() @ found.mass @ ones.ravel()
    frustum = math.pi * L / 3.0 * (THICK**2 + THICK * THIN + THIN**2)
    assert mass == pytest.approx(RHO * 0.75 * frustum, rel=1e-14)
