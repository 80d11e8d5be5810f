"""Every drive law is what its formula says, and smooth where it must be; breaks that rounding sets apart are one."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from flexclear import load_scene
from flexclear.dynamics import drives
from flexclear.dynamics import memory as m
from flexclear.dynamics.drives.oscillation import oscillate
from flexclear.dynamics.drives.pieces import Piece, Pieces, jump, pieces_of
from flexclear.dynamics.equations.prescribed_motion import make_laws
from flexclear.dynamics.model import laws
from flexclear.dynamics.run.run import engine_of
from flexclear.scene.laws import Law, Spline, Step
from tests.analytic.mechanism_runs import run
from tests.properties.kernels import from_python
from tests.properties.mechanisms import simulated

LAWS_OF_TIME = from_python(make_laws(oscillate))
#: eq. (35): 60 mm out and back
STROKE = Step(type="step", start=(0.0, 0.09), end=(0.09, 0.18), change=(0.06, -0.06))
WAVES = {"type": "harmonic", "amplitude": [0.3, -0.1], "frequency": [2.0, "1.5 Hz"], "phase": [0.4, "90 deg"]}
POINTS: dict[str, Any] = {"time": [0.0, 0.1, 0.3, 0.35, 0.6, 0.8, 1.0], "value": [0.0, 0.2, 0.1, 0.4, -0.3, 0.0, 0.0]}
TABLE = {"file": "moves.csv", "time": {"column": "t", "unit": "s"}, "value": {"column": "x", "unit": "mm"}}
RAMP = {"type": "polynomial", "coefficients": [0.1, -0.2, 0.5, 0.0, 0.0, 0.3, 0.0, -0.7], "origin": 0.2}
PEAK = {"type": "step", "start": [0.0, 0.2], "end": [0.2, 0.4], "change": [0.06, -0.06]}
CYCLE = {"time": [0.1, 0.2, 0.35, 0.5, 0.6], "value": [0.0, 0.02, 0.05, 0.01, 0.0], "ends": "periodic"}
#: drive law -> instances; overlapping steps, gaps and a step of no change among them
TABLES: dict[str, tuple[Any, ...]] = {
    "constant": ({"type": "constant", "value": 0.012}, {"type": "constant"}),
    "step": (
        STROKE,
        {"type": "step", "start": [0.2, 0.0, 0.25], "end": [0.3, 0.5, 0.26], "change": [0.1, -0.2, 0.05]},
        {"type": "step", "start": [0.1, 0.7], "end": [0.4, 0.8], "change": [0.0, 1.0]},
    ),
    "polynomial": (RAMP,),
    "harmonic": ({**WAVES, "offset": -0.2},),
    "spline": tuple(
        {"type": "spline", **POINTS, "degree": degree, "ends": ends}
        for degree in (3, 5)
        for ends in ("not-a-knot", "natural", "clamped", "periodic")
    ),
    "table": ({"type": "table", **TABLE, "points": [(t, 1e3 * t * t) for t in POINTS["time"]]},),
    "sum": ({"type": "sum", "laws": [RAMP, WAVES, {"type": "spline", **POINTS}]},),
    "piecewise": (
        {
            "type": "piecewise",
            "sections": [
                {"start": -0.1, "law": {"type": "harmonic", "amplitude": [0.5], "frequency": [3.0]}},
                {"start": 0.0, "law": {"type": "polynomial", "coefficients": [0.0, 1.5]}},
                {"start": 0.5, "law": {"type": "polynomial", "coefficients": [0.75, 1.5, 4.0], "origin": 0.5}},
            ],
        },
    ),
    "repeated": (
        {"type": "repeated", "period": 0.5, "times": 3, "law": PEAK},
        {"type": "repeated", "period": 0.5, "times": 2, "start": 0.1, "law": {"type": "spline", **CYCLE}},
    ),
    "delayed": (
        {"type": "delayed", "by": 0.15, "law": {"type": "sum", "laws": [RAMP, WAVES]}},
        {"type": "delayed", "by": -0.1, "law": {"type": "spline", **POINTS, "ends": "clamped"}},
    ),
}
LAWS = {name: tuple(TypeAdapter(Law).validate_python(law) for law in tables) for name, tables in TABLES.items()}


def pieces(law: Any) -> Pieces:
    return pieces_of(law, "length")


def value(law: Any, t: float, order: int = 0, side: str = "right") -> float:
    """A derivative of the law at t, from the piece that holds right (or left) of it."""
    before = [p for p in pieces(law).pieces if p.start < t]
    return before[-1].value(t, order) if side == "left" and before else pieces(law).value(t, order)


def compiled(law: Any, t: float, piece: int) -> np.ndarray:
    """Value, rate and second rate from the kernel, with this piece in force."""
    tables = laws.fill([pieces(law)])
    fractions, h, n = (
        np.array(tables[m.PIECE_HARMONICS]).ravel(),
        np.zeros(m.HEADER, dtype=np.int64),
        np.zeros(m.INTEGERS + 1, dtype=np.int64),
    )
    f = np.concatenate([tables[m.PIECES].ravel(), np.array(tables[m.HARMONICS]).ravel()])
    h[m.N_LAWS], h[m.LAW.at], h[m.PIECES.at], h[m.HARMONICS.at] = 1, 0, 0, tables[m.PIECES].size
    h[m.PIECE_HARMONICS.at], n[m.ACTIVE], n[m.INTEGERS] = m.HEADER, m.INTEGERS, piece
    w = np.zeros(3)
    LAWS_OF_TIME(np.concatenate([h, fractions]), f, w, n, t)
    return w


def adams_step(t: float, t0: float, h0: float, t1: float, h1: float) -> float:
    """Wang & Wang (2019), eq. (29)."""
    s = min(max((t - t0) / (t1 - t0), 0.0), 1.0)
    return h0 + (h1 - h0) * s * s * (3.0 - 2.0 * s)


def scale(law: Any, order: int) -> float:
    """Size of what is summed in a derivative of the law."""
    if law.type != "step":
        return 100.0  # of the splines' coefficients, over intervals of 0.05 s
    parts = zip(law.start, law.end, law.change, strict=True)
    return 1e-3 + sum(6.0 * abs(h) / (b - a) ** order for a, b, h in parts)


every_law = pytest.mark.parametrize("law", [law for laws in LAWS.values() for law in laws], ids=lambda law: law.type)
# numbers below 1e-50 are refused where a scene is read
sizes = st.floats(-0.1, 0.1).filter(lambda x: x == 0.0 or abs(x) > 1e-50)
spans = st.tuples(st.just(0.0) | st.floats(1e-50, 1.0), st.floats(0.01, 1.0), sizes)


def test_every_drive_law_is_tried_here() -> None:
    # expressions become pieces of these laws: tests/analytic/test_expressions.py
    assert set(LAWS) == set(drives.LAWS) - {"expression"}


@every_law
def test_value_and_rate_do_not_jump_between_pieces(law: Any) -> None:
    for t in pieces(law).starts[1:]:
        for order in (0, 1):
            left, right = (value(law, t, order, side) for side in ("left", "right"))
            # some roundings of (t - start) / (end - start) and of the sum of the terms
            assert left == pytest.approx(right, abs=1e-12 * scale(law, order))


@every_law
def test_derivatives_of_many_pieces_are_those_of_each(law: Any) -> None:
    made = pieces(law)
    those = np.repeat(np.arange(len(made.pieces)), 3)
    times = np.array(made.starts)[those] + np.tile([0.0, 0.01, 0.3], len(made.pieces))
    for order in range(3):
        each = [made.pieces[k].value(float(t), order) for k, t in zip(those, times, strict=True)]
        assert made.derivatives(those, times, order) == pytest.approx(np.array(each), rel=1e-13, abs=1e-13)


@every_law
def test_pieces_start_in_order(law: Any) -> None:
    assert np.all(np.diff(pieces(law).starts) > 0.0)


@every_law
def test_the_kernel_evaluates_the_pieces_and_their_exact_derivatives(law: Any) -> None:
    starts = [*pieces(law).starts, pieces(law).starts[-1] + 0.2]
    for k, (a, b) in enumerate(pairwise(starts)):
        for t in (a + 0.3 * (b - a), a + 0.9 * (b - a)):
            found, h = compiled(law, t, k), 1e-3 * (b - a)
            # rounding of polynomials of terms as large as `scale`
            assert found == pytest.approx([value(law, t, order) for order in range(3)], abs=1e-10)
            around = np.array([compiled(law, t + j * h, k) for j in (-2, -1, 1, 2)])
            slopes = (8.0 * (around[2] - around[1]) - (around[3] - around[0])) / (12.0 * h)
            # fourth order in h: 5e5 (the fifth rates of the spline) times h^4 / 30; rounding 1e-15 / h
            assert slopes[:2] == pytest.approx(found[1:], rel=1e-8, abs=1e-7)


@pytest.mark.parametrize("law", LAWS["spline"], ids=lambda law: f"{law.degree}-{law.ends}")
def test_splines_pass_their_points_as_smoothly_as_they_say(law: Any) -> None:
    for t, x in zip(law.time, law.value, strict=True):
        # coefficients of up to `scale`, from equations whose condition is some tens
        assert value(law, t) == pytest.approx(x, abs=1e-12)
    for t in pieces(law).starts[1:]:
        for order in range(law.degree):
            left, right = (value(law, t, order, side) for side in ("left", "right"))
            size = max(abs(value(law, s, order)) for s in np.linspace(0.0, 1.0, 50))
            assert left == pytest.approx(right, abs=1e-9 * max(size, 1.0))
    ends = {"natural": {3: (2,), 5: (3, 4)}, "clamped": {3: (1,), 5: (1, 2)}}.get(law.ends, {}).get(law.degree, ())
    for order in ends:
        size = max(abs(value(law, s, order)) for s in np.linspace(0.0, 1.0, 50))
        assert [value(law, t, order, "left") for t in (0.0, 1.0)] == pytest.approx([0.0, 0.0], abs=1e-10 * size)
    if law.ends == "periodic":
        for order in range(law.degree):
            size = max(abs(value(law, s, order)) for s in np.linspace(0.0, 1.0, 50))
            assert value(law, 0.0, order) == pytest.approx(value(law, 1.0, order, "left"), abs=1e-9 * size)


def test_a_sum_is_the_sum_and_sections_follow_each_other() -> None:
    total, (ramp, waves, spline) = LAWS["sum"][0], LAWS["sum"][0].laws
    for t in (0.05, 0.31, 0.77):
        for order in range(3):
            parts = sum(value(law, t, order) for law in (ramp, waves, spline))
            assert value(total, t, order) == pytest.approx(parts, abs=1e-11)
    sections = LAWS["piecewise"][0]
    assert value(sections, -0.5) == pytest.approx(0.5 * np.sin(-1.5), abs=1e-15)
    assert value(sections, 0.25) == pytest.approx(0.375, abs=1e-15)
    assert value(sections, 0.7) == pytest.approx(0.75 + 1.5 * 0.2 + 4.0 * 0.04, abs=1e-15)


def test_a_repeated_law_starts_over_and_goes_on_after_its_last_period() -> None:
    peaks, cycles = LAWS["repeated"]
    for t in (0.01, 0.17, 0.3, 0.49):
        for order in range(3):
            first = value(peaks, t, order)
            # times of 1 s in rounding, times rates of 1e3 in the second derivative
            assert [value(peaks, t + k * 0.5, order) for k in (1, 2)] == pytest.approx([first] * 2, abs=1e-12)
    assert value(peaks, 1.8) == value(peaks, -0.1) == 0.0
    assert value(cycles, 0.3) == pytest.approx(value(cycles, 0.8), abs=1e-15)
    assert pieces(cycles).span == (0.1, 1.1)
    assert list(pieces(peaks).starts) == pytest.approx([-1.0, 0.0, 0.2, 0.4, 0.5, 0.7, 0.9, 1.0, 1.2, 1.4])


def test_a_repeated_law_must_cover_its_period() -> None:
    short = {"type": "repeated", "period": 0.8, "times": 2, "start": 0.1, "law": {"type": "spline", **CYCLE}}
    with pytest.raises(ValueError, match=r"defined between 0.1 and 0.6 s only, not over its period from 0.1 to 0.9 s"):
        pieces(TypeAdapter(Law).validate_python(short))


def test_a_constant_drive_holds_its_value() -> None:
    for law in LAWS["constant"]:
        assert [value(law, t) for t in (-1.0, 0.0, 3.0)] == [law.value] * 3
        assert [value(law, t, order) for t in (-1.0, 3.0) for order in (1, 2)] == [0.0] * 4


@given(steps=st.lists(spans, min_size=1, max_size=4), t=st.floats(-0.5, 2.5))
def test_a_step_drive_is_the_sum_of_eq_29(steps: list[tuple[float, float, float]], t: float) -> None:
    start, end, change = ([f(s) for s in steps] for f in (lambda s: s[0], lambda s: s[0] + s[1], lambda s: s[2]))
    law = Step(type="step", start=tuple(start), end=tuple(end), change=tuple(change))
    known = sum(adams_step(t, a, 0.0, b, h) for a, b, h in zip(start, end, change, strict=True))
    # (t - start) / (end - start) of steps of 0.01 s at 1 s: 100 roundings' worth, times slopes of 1.5
    assert value(law, t) == pytest.approx(known, abs=1e-13)


def test_the_papers_stroke_jumps_in_acceleration_at_its_ends_and_in_jerk_at_its_middle() -> None:
    """6 h / T^2 = 44.44 m/s^2 of eq. (35); 12 h / T^3 = 987.65 m/s^3."""
    jump, jerk = 6.0 * 0.06 / 0.09**2, 12.0 * 0.06 / 0.09**3
    sides = {t: [value(STROKE, t, 2, side) for side in ("left", "right")] for t in (0.0, 0.09, 0.18)}
    # rounding of s = 1 in 6 h (1 - 2 s) / T^2
    assert sides[0.0] == pytest.approx([0.0, jump], abs=1e-12)
    assert sides[0.09] == pytest.approx([-jump, -jump], abs=1e-12)
    assert sides[0.18] == pytest.approx([jump, 0.0], abs=1e-12)
    assert [value(STROKE, 0.09, 3, side) for side in ("left", "right")] == pytest.approx([-jerk, jerk], rel=1e-13)


def test_a_run_is_driven_by_eq_35() -> None:
    dataset = run("sps4/ideal")
    found = dataset.drive_position.transpose("time", "drive").to_pandas()
    stroke = [adams_step(t, 0.0, 0.0, 0.09, 0.06) + adams_step(t, 0.09, 0.0, 0.18, -0.06) for t in found.index]
    for name in ("P1", "P2"):
        # rounding of 60 mm and of t
        assert found[name].to_numpy() == pytest.approx(np.array(stroke), abs=1e-15)
    assert np.abs(found[["P3", "P4"]].to_numpy()).max() == 0.0


# Breaks that rounding has set apart ---------------------------------------------------------------------------------

IDEAL = Path(__file__).parents[2] / "scenes" / "sps4" / "ideal.toml"


def test_breaks_that_differ_by_rounding_are_one():
    """Five strokes of 0.09 s halves: 5 * 0.09 + 0.09 and 6 * 0.09 differ in the last digit."""
    starts = [k * 0.09 for k in range(10)]
    ends = [s + 0.09 for s in starts]
    assert len(set(starts[1:]) | set(ends[:-1])) > 9  # the case is there
    law = {"type": "step", "start": starts, "end": ends, "change": [0.01, -0.01] * 5}
    scene = load_scene(IDEAL, {"drive.P1.law": law, "drive.P2.law": law, "time.end": 0.9})
    breaks = engine_of(scene, {}, lambda fraction, text: None).breaks
    np.testing.assert_allclose(breaks, 0.09 * np.arange(11), atol=1e-15)


@pytest.mark.parametrize("end", [0.5, 8.0, 1000.0])
def test_a_short_motion_in_a_long_run_meets_its_rests(end: float):
    """A quintic from rest to rest, whose coefficients leave a rate of some 1e-16 at its end."""
    quintic = Piece(0.1, (0.0, 0.0, 0.0, 10.0 / 0.3**3, -15.0 / 0.3**4, 6.0 / 0.3**5))
    law = Pieces((Piece(0.0, (0.0,)), quintic, Piece(0.4, (1.0,))))
    assert jump(law, 0.0, end) is None
    broken = Pieces((*law.pieces[:2], Piece(0.4, (1.0, 1e-3))))
    assert jump(broken, 0.0, end) == (0.4, "rate")


def test_a_cam_of_many_rows_that_rests_and_crosses_zero_is_examined_in_one_go() -> None:
    """20 000 pieces take some 0.1 s; a law that is evaluated anew at each break near zero takes hours."""
    t = np.linspace(0.0, 1.0, 20_001)
    rise, waves = 0.01 * np.sin(np.pi * t / 0.3) ** 4, 0.01 * np.sin(100.0 * np.pi * (t - 0.6)) ** 3
    x = np.where(t < 0.3, rise, np.where(t < 0.6, 0.0, waves))
    law = pieces(Spline(type="spline", time=tuple(t), value=tuple(x), ends="clamped"))
    begun = process_time()
    assert jump(law, 0.0, 1.0) is None
    assert process_time() - begun < 3.0
    *first, last = law.pieces[:10_001]  # in the rest
    assert jump(replace(law, pieces=(*first, replace(last, coefficients=(0.0, 1e-3)))), 0.0, 1.0) == (0.5, "rate")


def test_knots_of_many_smooth_pieces_are_no_breaks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps end on them all the same: a spline of 602 points moves as if each were a break, with output rows only."""
    t = np.linspace(0.0, 0.18, 602)  # not at times of output
    law = Spline(type="spline", time=tuple(t), value=tuple(0.03 * (1.0 - np.cos(2.0 * np.pi * t / 0.18))))
    made, end = pieces(law), len(t) - 2
    assert set(made.last) == {end}
    for time in (-0.01, 0.0, *t[[1, 300]], 0.1234, 0.18):
        known = [made.value(time, order) for order in range(3)]
        # rounding of a rate of 1 m/s
        np.testing.assert_allclose(compiled(law, time, 0), known, rtol=1e-12, atol=1e-16)
    kinked = Pieces((*made.pieces[:300], *(replace(p, coefficients=(0.0, 1.0)) for p in made.pieces[300:])))
    assert set(kinked.last) >= {299, end}
    scene = load_scene(IDEAL, {**dict.fromkeys(("drive.P1.law", "drive.P2.law"), law.model_dump()), "time.end": 0.18})
    few = simulated(scene, {})
    monkeypatch.setattr(drives.pieces, "FEW", 1000)
    drives.spline.through.cache_clear()
    many = simulated(scene, {})
    assert len(many.time) > len(few.time) + 500
    assert few.attrs["evaluations"] <= many.attrs["evaluations"] - 600  # none that a restart needs
    # m: both follow the same polynomials to the tolerance
    np.testing.assert_allclose(few.position[-1], many.position[-1], atol=1e-9)
