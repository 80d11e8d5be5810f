"""The tables say what the runs say, in the paper's units, next to the paper's own numbers."""

import csv
import io

import numpy as np
import pytest
import xarray as xr

from flexclear.post.plotting.table import Table, as_csv, as_html, as_markdown, from_markdown
from papers.wang_wang_2019.figures import figure, table10, table_verdicts
from papers.wang_wang_2019.figures.errors import number
from papers.wang_wang_2019.figures.given import euler_bernoulli_ratio
from tests.paper import synthetic
from tests.paper.material import WOBBLE, everything


def rows(name, data=None):
    """Rows of a table as dictionaries."""
    table = figure(name).make(data or everything())
    return [dict(zip(table.columns, row, strict=True)) for row in table.rows]


def by_name(name, data=None):
    """Rows of a table by their first cells."""
    return {next(iter(row.values())): row for row in rows(name, data)}


def text(name, data=None):
    """A table with its notes, as Markdown."""
    return as_markdown(figure(name).make(data or everything()))


def value(cell: str) -> float:
    """The number before the +-."""
    return float(cell.partition(" ± ")[0])


def test_tables_are_read_back_as_they_were_written_with_whole_rows_and_cells_as_they_are():
    table = Table("A title", ("quantity", "value"), (("one", "1.0"), ("two", "2 ± 3")), ("First note.", "Second note."))
    assert from_markdown(as_markdown(table)) == table
    with pytest.raises(ValueError, match="not a table"):
        from_markdown("just text")
    with pytest.raises(ValueError, match="2 columns"):
        Table("t", ("a", "b"), (("1",),))
    commas = Table("t", ("a, b", "c"), (("1", "2"),))
    assert list(csv.reader(io.StringIO(as_csv(commas)))) == [["a, b", "c"], ["1", "2"]]
    assert "&lt;b&gt;" in as_html(Table("t", ("a",), (("<b>",),)))


@pytest.mark.parametrize("name", ["table04", "table05"])
def test_frequencies_that_agree_as_printed_say_so_with_the_error_of_their_mesh(name):
    assert {row["agrees as printed"] for row in rows(name)} == {"yes"}
    # the made-up finer mesh differs by 0.25 Hz
    assert all(row["ours, circle (Hz)"].endswith(" ± 0.250") for row in rows(name) if row["kind"] != "rigid")


def test_a_frequency_off_by_one_printed_digit_is_detected():
    square = figure("table04").needs[0]
    data = dict(everything())
    # 1576.805 reads 1576.8; 0.1 Hz more reads 1576.9
    data[square] = data[square].assign(frequency=data[square].frequency + 0.1 * (np.arange(7) == 0))
    assert [row["agrees as printed"] for row in rows("table04", data)] == ["no"] + ["yes"] * 5
    assert "5 of 6" in text("table04", data)


def test_free_free_table_starts_with_six_rigid_modes():
    assert [row["kind"] for row in rows("table05")] == ["rigid"] * 6 + ["bending"] * 4 + ["torsion", "bending"]


def test_ratio_of_beam_frequencies():
    # tabulated roots of cos x cosh x = 1: 7.853204624, 10.995607838 (ten digits)
    assert euler_bernoulli_ratio() == pytest.approx((10.995607838 / 7.853204624) ** 2, rel=1e-9)


def test_table_7_gives_the_wobble_that_the_runs_were_made_with():
    found = by_name("table07")
    for name, head in (("far_free", "ours, free-free"), ("far_fixed", "ours, fixed-fixed")):
        # outputs every 0.1 ms of a 300 Hz wobble miss its top by up to 0.1 %; four digits are printed
        assert value(found["displacement z0 (mm)"][head]) == pytest.approx(1e3 * WOBBLE[name], rel=2e-3)
        assert value(found["angle about y0 (rad)"][head]) == pytest.approx(10.0 * WOBBLE[name], rel=2e-3)


def test_rounding_noise_is_not_printed():
    assert number(3e-13) == "< 1e-10"
    assert number(2.776e-4) == "2.776e-04"
    assert number(13.57) == "13.570"


def test_table_7_says_when_fixed_modes_do_nothing():
    data = dict(everything())
    assert "vanish at both ends" not in text("table07", data)
    data["sps4/far_fixed:run"] = data["sps4/ideal:run"]
    assert "vanish at both ends" in text("table07", data)


def test_table_8_compares_the_clearance_run_with_the_paper():
    found = by_name("table08")
    assert found["velocity z0 (mm/s)"]["paper"] == "13.570"
    assert value(found["displacement z0 (mm)"]["ours"]) == pytest.approx(0.1, rel=2e-3)  # made with 1e-4 m, see above


def test_table_8_says_what_is_fitted_and_what_contradicts():
    """The made-up wobble has 1e-4 m and 0.2 m/s, 14 times the printed velocity; the first layout's is a fifth of it."""
    said = text("table08")
    assert "Angle and displacement are fitted, not predicted" in said
    assert "The velocity is a prediction, and the paper contradicts it: it is 14 times the printed one." in said
    assert "has 2.8 times the printed velocity and 0.1 times the printed displacement" in said
    agreeing = everything() | {"sps4/csj:run": synthetic.run("sps4/csj", clearance=True, noise=7e-6)}
    assert "contradicts" not in text("table08", agreeing)


def test_verdicts_on_clearance_have_the_first_layouts_numbers_in_brackets():
    """The made-up wobble of the first layout is a fifth of the other's."""
    found = judged()
    row = found["The velocity does not suffer from clearance"]
    own, first = (float(text.split(" %")[0]) for text in row["numbers"].rstrip(")").split("("))
    assert own == pytest.approx(5.0 * first, rel=0.05)  # one decimal is printed
    assert row["verdict"] == "does not hold"


def test_table_9_says_how_far_single_runs_count():
    data = everything()
    horizon = 1e3 * float(data["sps4/far_csj_free:post"].ensemble_horizon)
    heads = rows("table09")[0].keys()
    assert f"ours, free-free, to {horizon:.1f} ms" in heads
    assert 20.0 < horizon < 180.0  # the made-up ensemble parts inside the stroke


def test_table_9_spread_is_that_of_the_members():
    data = everything()
    ensemble, ideal = data["sps4/far_csj_free:ensemble"], data["sps4/ideal:run"]
    velocity = (
        ensemble.velocity.sel(body="platform", axis="z").values - ideal.velocity.sel(body="platform", axis="z").values
    )
    expected = 1e3 * np.abs(velocity).max(axis=1)
    cell = by_name("table09")["velocity z0 (mm/s)"]["ours, free-free, whole stroke"]
    mean, _, std = cell.partition(" ± ")
    assert float(mean) == pytest.approx(expected.mean(), abs=5e-4)  # three decimals are printed
    assert float(std) == pytest.approx(expected.std(ddof=1), rel=0.05)  # two digits are printed


def test_table_10_divides_medians_by_the_ideal_one_and_says_what_the_fixed_step_cannot_do():
    found, said = by_name("table10"), text("table10")
    # half of 44/3.6 - 36/4.4
    assert found["sps4/csj"]["equal error: integration (ideal = 1)"] == "10 ± 2"
    assert found["sps4/csj"]["CPU time, paper (ideal = 1)"] == "19.95"
    assert found["sps4/csj"]["equal error: integration (ms)"] == "40 ± 4"  # half the range of 36 to 44
    assert found["sps4/far_csj_fixed"]["equal error: evaluations"] == "60000"
    assert found["sps4/far_fixed"]["paper's step: integration (ms)"] == "–"
    assert "far_fixed: unstable" in said
    assert "Within a factor of 1.5 of the paper's ratio: sps4/far_fixed, sps4/csj." in said  # 21/20 and 400/20


def test_table_10_keeps_recording_out_of_its_ratios():
    """Records that take any time change the column of recording and no other."""
    data = dict(everything())
    data["sps4:timing"] = data["sps4:timing"].assign(
        equal_recording_seconds=data["sps4:timing"].equal_recording_seconds * 50
    )
    slow, plain = rows("table10", data), rows("table10")
    assert {k for a, b in zip(slow, plain, strict=True) for k in a if a[k] != b[k]} == {"recording (ms)"}


def test_table_10_takes_the_repeats_that_were_made():
    data = dict(everything())
    timing = data["sps4:timing"].copy(deep=True)
    timing.equal_integration_seconds[:, 2] = np.nan
    found = by_name("table10", data | {"sps4:timing": timing})
    assert found["sps4/csj"]["equal error: integration (ms)"] == "42 ± 2"  # 40 and 44
    assert found["sps4/ideal"]["equal error: integration (ideal = 1)"] == "1 ± 0"


def test_deviations_carry_the_error_of_their_time_integration():
    """Both runs of the made-up pair are moved alike by the tighter tolerance, so that the difference is not."""
    found = by_name("table08")
    assert found["velocity z0 (mm/s)"]["ours"].endswith("± 1e-10")
    data = dict(everything())
    data["sps4/ideal:tight"] = data["sps4/ideal:run"]
    moved = by_name("table08", data)["velocity z0 (mm/s)"]["ours"]
    assert moved.endswith("± 3e-03")  # 3e-6 m/s in the printed unit


@pytest.mark.parametrize(
    "motions, verdict",
    [
        (("quasi-periodic", "chaotic", "chaotic", "chaotic"), "holds"),
        (("periodic", "chaotic", "periodic", "chaotic"), "in part"),
        (("periodic", "periodic", "periodic", "periodic"), "does not hold"),
    ],
)
def test_the_claim_of_chaos_is_judged_by_the_sections_that_were_made(tmp_path, monkeypatch, motions, verdict):
    scenes = [f"sps4/{name}" for name in ("csj", "far_csj_free", "far_csj_fixed", "far_csj_cb")]
    lines = [f"{scene},{motion},500,1.5,1.0,2.0" for scene, motion in zip(scenes, motions, strict=True)]
    recorded = tmp_path / "verdicts.csv"
    recorded.write_text("\n".join(["scene,verdict,periods,exponent,exponent_low,exponent_high", *lines]))
    monkeypatch.setattr(table_verdicts, "SECTIONS", recorded)
    last = rows("table_verdicts")[-1]
    assert last["verdict"] == verdict
    assert f"CSJ {motions[0]}" in last["numbers"]
    recorded.unlink()
    assert rows("table_verdicts")[-1]["verdict"] == "cannot be determined from one stroke"


def judged(data: dict[str, xr.Dataset] | None = None) -> dict[str, dict[str, str]]:
    return {row["statement"]: row for row in rows("table_verdicts", data)}


def of_scene(name: str, **changed: xr.DataArray) -> dict[str, xr.Dataset]:
    """Everything, with other variables in one artifact."""
    data = dict(everything())
    data[name] = data[name].assign(changed)
    return data


def test_the_acceleration_of_the_flexible_rod_is_judged_too():
    run = everything()["sps4/far_cb:run"]
    largest = float(np.abs(everything()["sps4/ideal:run"].acceleration.sel(body="platform", axis="z")).max())
    ringing = run.acceleration + 0.5 * largest * (run.time == run.time[7])
    found = judged(of_scene("sps4/far_cb:run", acceleration=ringing))[
        "With ideal joints the rod's flexibility has no effect on the acceleration"
    ]
    assert found["verdict"] == "in part"
    assert "50 % (Craig-Bampton)" in found["numbers"]


def test_paths_of_the_ball_are_judged_by_how_far_it_goes():
    run, ideal = (everything()[f"sps4/{name}:run"] for name in ("csj", "ideal"))
    path = ideal.frame_position.sel(frame="ball_A1.centre")
    stroke = float(np.linalg.norm(path - path[0], axis=-1).max())
    words = "Clearance makes the path of the ball's centre significantly different"
    aside = run.frame_position + 0.1 * stroke * ((run.axis == "x") & (run.time == run.time[5]))
    assert judged()[words]["verdict"] == "does not hold"
    assert judged(of_scene("sps4/csj:run", frame_position=aside))[words]["verdict"] == "holds"


def test_costs_are_judged_in_each_of_the_ways_of_table_10():
    words = "Clearance makes the ideal model twenty times as dear"
    timing = everything()["sps4:timing"]
    like_paper = {
        f"{way}_integration_seconds": timing[f"{way}_integration_seconds"] * 0.0
        + xr.where(timing.scene == "sps4/csj", 19.95, 1.0)
        for way in ("equal", "step", "tolerance")
    }
    assert judged(of_scene("sps4:timing", **like_paper))[words]["verdict"] == "holds"
    failing = like_paper | {"step_integration_seconds": like_paper["step_integration_seconds"] * np.nan}
    found = judged(of_scene("sps4:timing", **failing))[words]
    assert found["verdict"] == "in part"
    assert "at the paper's step: CSJ fails" in found["numbers"]


def test_the_paper_s_step_amplifies_the_rod_s_vibrations():
    """Against the method itself, step by step, on an undamped vibration of 8.36 kHz at 1e-5 s."""
    angle = 2.0 * np.pi * 8362.7e-5

    def f(y: complex) -> complex:
        return 1j * angle * y

    y = list(np.exp(1j * angle * np.arange(4)))
    for _ in range(2000):
        a, b, c, d = (f(v) for v in y[-1:-5:-1])
        p = y[-1] + (55 * a - 59 * b + 37 * c - 9 * d) / 24
        y.append(y[-1] + (9 * f(p) + 19 * a - 5 * b + c) / 24)
    # the other roots have died out long before: what is left is rounding
    assert table10.growth(angle) == pytest.approx((abs(y[-1]) / abs(y[1000])) ** (1 / 1003), rel=1e-10)
    assert table10.growth(angle) - 1.0 == pytest.approx(1.9e-3, rel=0.03)  # it is unstable, by two digits
