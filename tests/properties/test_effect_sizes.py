"""Which effects matter: from made-up points whose differences and scatter are known."""

import numpy as np
import pytest

from flexclear.artifacts.points import Point
from flexclear.post.answers.effect_answer import ideal_sentences, members_to_decide, sentence, table
from flexclear.post.answers.effect_sizes import (
    IDEAL,
    Pair,
    assemble,
    chart,
    influence_of,
    is_decided,
    staying_contacts_sentence,
    undecided_quantities,
    variants,
    with_pairs,
)
from flexclear.scene.quantity import Quantity
from flexclear.scene.variants import Effect

VELOCITY = Quantity("slider", "velocity")
TIME = np.linspace(0.0, 1.0, 201)


def point(offset: float, scatter: float = 0.0) -> Point:
    """A slider that swings by 1 m/s, `offset` off, its members scattered by so much [m/s]."""
    series = np.zeros((len(TIME), 3))
    series[:, 0] = np.sin(2.0 * np.pi * TIME) + offset
    values = {"slider.velocity.series": series, "slider.velocity.largest": np.array(1.0 + offset)}
    deviation = {
        name: np.full_like(value, scatter / np.sqrt(value.shape[-1] if value.ndim else 1))
        for name, value in values.items()
    }
    return Point(values, {}, deviation if scatter else {}, 100)


def separating(offset: float, later: float) -> Point:
    """The slider of `point`, whose members agree up to half of the run and then scatter by `later` [m/s]."""
    made = point(offset, later)
    early = {name: np.where(TIME[:, None] < 0.5, 1e-6, v) if v.ndim else v for name, v in made.deviation.items()}
    return Point(made.values, {}, early, 100)


def study(**pairs: Pair):
    words = {name: f"effect {name}" for name in pairs} | {IDEAL: IDEAL}
    named = {IDEAL if name == "ideal" else name: pair for name, pair in pairs.items()}
    return assemble(named, words | {name: name for name in named}, [VELOCITY], ["m/s"], "", TIME)


def test_without_scatter_a_change_is_the_distance_of_the_two_runs():
    change = influence_of(Pair(point(0.0), point(0.03), 0), VELOCITY)
    assert change.difference == pytest.approx(0.03)
    assert change.uncertainty == 0.0


def test_scatter_leaves_a_change_undecided_and_more_members_decide_it():
    few, many = (Pair(point(0.0, 0.05), point(0.03, 0.05), members) for members in (4, 1024))
    assert undecided_quantities(few, [VELOCITY]) == [VELOCITY]
    assert undecided_quantities(many, [VELOCITY]) == []
    change = influence_of(few, VELOCITY)
    # chance falls with the square root of the members, and Student's t with it
    assert 4 < members_to_decide(change, 1.0, 4) < 1000


def test_no_change_is_decided_when_chance_is_below_a_hundredth():
    change = influence_of(Pair(point(0.0, 1e-3), point(0.0, 1.01e-3), 8), VELOCITY)
    assert change.difference == 0.0
    assert is_decided(change, 1.0)
    assert not is_decided(change, 0.01)


def test_the_same_members_do_not_differ():
    change = influence_of(Pair(point(0.0, 1e-3), point(0.0, 1e-3), 8), VELOCITY)
    assert change.difference == change.uncertainty == 0.0


def test_an_effect_that_is_not_listed_is_in_no_table():
    made = study(weak=Pair(point(0.0), point(5e-3), 0), other=Pair(point(0.0), point(5e-3), 0))
    words = made["words"].values.copy()
    words[1] = ""
    assert [row[0] for row in table(made.assign_coords(words=("effect", words))).rows] == ["weak"]


def test_the_summary_says_what_changes_by_how_much_and_how_sure_it_is():
    (changed,) = ideal_sentences(study(ideal=Pair(point(0.0), point(0.03), 0)))
    assert "changes by up to <b class='n'>30 mm/s</b> (3 % of its largest value)" in changed
    (same,) = ideal_sentences(study(ideal=Pair(point(0.0), point(0.0), 0)))
    assert "does not change" in same
    (open_,) = ideal_sentences(study(ideal=Pair(point(0.0, 5e-3), point(0.0), 4)))
    # Student's t of 6 degrees of freedom at 1e-3 times 5 mm/s over the root of 4 runs: 15 mm/s, all of it chance
    assert "changes by less than <b class='n'>15 mm/s</b>" in open_


def test_the_summary_has_a_part_up_to_the_horizon_and_one_beyond():
    (said,) = ideal_sentences(study(ideal=Pair(separating(0.0, 0.5), separating(5e-3, 0.5), 4)))
    # Student's t of 6 degrees of freedom at 1e-3, 5.96, times 1 um/s in three directions of two variants of 4 runs
    assert "up to t = 495 ms it changes by up to <b class='n'>5.0000 ± 0.0073 mm/s</b> (0.5 % of its largest" in said
    # the same of 0.5 m/s in all directions together: 5.96 times 0.5 times the root of 2 over that of 4
    assert "over the whole run it changes by less than <b class='n'>2.1 m/s</b>" in said


def test_the_change_over_the_whole_run_is_at_least_that_up_to_the_horizon():
    """Of 0.1 m/s, next to members that scatter by 0.05 m/s beyond it: chance of 0.21 m/s hides that there."""
    made = study(weak=Pair(separating(0.0, 0.05), separating(0.1, 0.05), 4))
    assert float(made["early"][0, 0]) == pytest.approx(0.1)
    assert float(made["dropped"][0, 0]) == pytest.approx(0.1)
    # 5.96 times 0.05 times the root of 2 over that of 4
    assert float(made["dropped_uncertainty"][0, 0]) == pytest.approx(0.21, rel=0.01)


def test_summary_table_and_chart_have_one_number_for_one_question():
    """A change of 0.3 m/s with a chance of 0.4 m/s, and one that is all chance."""
    likely, chance = Pair(point(0.0, 0.1), point(0.5, 0.1), 4), Pair(point(0.0, 0.1), point(0.0, 0.11), 4)
    made = study(ideal=likely, other=chance)
    (said,) = ideal_sentences(made)
    rows = {row[0]: row[1] for row in table(made).rows}
    assert f"<b class='n'>{rows[IDEAL]}</b>" in said
    assert "±" in rows[IDEAL]
    limit = rows["other"]
    assert limit.startswith("< ")
    drawn = chart("c", made, "t")["c.svg"].decode()
    assert f"<!-- {limit.replace('<', '&lt;')} -->" in drawn
    assert "<!-- none -->" not in drawn


def test_a_quantity_that_goes_with_the_effect_is_called_not_comparable():
    gone = Point({}, {}, {}, 100)
    assert [row[1] for row in table(study(clearance=Pair(point(0.0), gone, 0))).rows] == ["not comparable"]


def test_a_contact_that_no_ideal_joint_replaces_is_named_in_the_answer():
    made = study(weak=Pair(point(0.0), point(5e-3), 0)).assign_attrs(staying=staying_contacts_sentence(["floor"]))
    assert "floor stays in every variant, as a ball on a plane has no ideal counterpart" in sentence(made, {})
    assert staying_contacts_sentence([]) == ""


def test_an_effect_whose_change_is_less_than_twice_its_chance_is_not_certain_to_be_needed():
    """0.27 m/s, next to chance of 0.42 m/s: 5.96 times 0.1 times the root of 2 over that of 4."""
    found = study(weak=Pair(point(0.0, 0.1), point(0.5, 0.1), 4))
    assert sentence(found, {}).startswith("For errors below 1 %, no effect is certain to be needed (undecided: weak).")


def test_effects_that_the_budget_did_not_reach_are_named_last():
    found = study(strong=Pair(point(0.0), point(0.2), 0)).assign_attrs(undone="gravity")
    assert sentence(found, {}).endswith("Not examined within the budget: gravity.")


def test_the_answer_says_which_accuracy_calls_for_which_effect():
    found = study(strong=Pair(point(0.0), point(0.2), 0), weak=Pair(point(0.0), point(5e-3), 0))
    text = sentence(found, {})
    assert text.startswith("For errors below 1 %, model strong. ")
    assert text.endswith(
        "Percentages are of each quantity's largest value; of positions and angles, of the largest change."
    )


def test_a_requested_accuracy_decides_instead_of_levels():
    found = study(strong=Pair(point(0.0), point(0.2), 0), weak=Pair(point(0.0), point(5e-3), 0))
    assert (
        sentence(found, {"slider.velocity": 0.1}) == "For the requested accuracy, model strong."
    )  # and no percentages


def test_what_chance_may_hide_is_not_called_absent():
    found = study(unsure=Pair(point(0.0, 0.5), point(0.0, 0.51), 4))
    assert "undecided: unsure" in sentence(found, {})


def test_a_refused_variant_is_named_with_its_reason_and_in_other_words_than_one_beyond_the_budget():
    found = study(broken=Pair(point(0.0), Point({}, {}, {}, 0, "it jams\n  hint: oil it"), 0))
    told = "Refused by the solver, also at a tighter tolerance, without broken: it jams hint: oil it"
    assert told in table(found).notes
    text = sentence(found.assign_attrs(undone="gravity"), {})
    assert text.startswith("For errors below 1 %, no effect is certain to be needed. ")
    assert text.endswith(f"Not examined within the budget: gravity. {told}.")
    assert "undecided" not in text


def test_up_to_the_horizon_a_change_is_decided_however_the_members_scatter_later():
    """A change of 5 mm/s of a motion that scatters by 0.5 m/s from t = 0.5 s on."""
    found = study(weak=Pair(separating(0.0, 0.5), separating(5e-3, 0.5), 4))
    # members separate within a 200th of the run after the last output at which they agree
    assert float(found["horizon"][0]) == pytest.approx(0.5, abs=0.006)
    assert float(found["early"][0, 0]) == pytest.approx(5e-3)
    # Student's t of 6 degrees of freedom at 1e-3, 5.96, times 1 um/s in three directions of two variants of 4 runs
    assert float(found["early_uncertainty"][0, 0]) == pytest.approx(5.96 * 6**0.5 * 1e-6 / 2.0, rel=1e-2)
    assert float(found["dropped_uncertainty"][0, 0]) > 1.0
    first, second = table(found).rows
    assert first[0].endswith("up to 495 ms")
    assert "would decide" in second[-1]
    text = sentence(found, {})
    assert "its change is decided for each effect; over the whole run means of 4 runs leave it open for weak" in text
    assert text.startswith(
        "For errors below 1 %, no effect is certain to be needed (undecided beyond the horizon: weak)."
    )
    assert sentence(found, {VELOCITY.name: 1e-3}).startswith("For the requested accuracy, model weak.")


def test_the_error_of_the_integration_bounds_what_is_decided_up_to_the_horizon():
    pair = Pair(separating(0.0, 0.5), separating(5e-3, 0.5), 4)
    found = assemble({"weak": pair}, {"weak": "weak"}, [VELOCITY], ["m/s"], "", TIME, lambda quantity, until: 2e-3)
    assert float(found["early"][0, 0]) == 0.0
    assert float(found["early_uncertainty"][0, 0]) == pytest.approx(9e-3, rel=1e-2)  # 5 mm/s and 2 mm/s of each run


def test_effects_that_are_added_and_combined_are_rows_of_the_same_table():
    """Two effects of 0.2 and 0.1 m/s that together change the velocity by 0.35 m/s: 0.05 beyond their sum."""
    one, two = Effect("one", "gravity"), Effect("two", "friction")
    speeds = {("one", "two"): 0.0, ("two",): 0.2, ("one",): 0.1, (): 0.35}
    points = {frozenset(gone): point(speed) for gone, speed in speeds.items()}
    assert set(variants([one, two])) == set(points)
    full = points[frozenset()]
    pairs = {name: Pair(full, points[frozenset({name})], 0) for name in ("one", "two")}
    made = assemble(pairs, {"one": "gravity", "two": "friction"}, [VELOCITY], ["m/s"], "", TIME)
    found = with_pairs(made, [one, two], [VELOCITY], points, 0)
    assert found["dropped"].values[:, 0] == pytest.approx([0.25, 0.15])
    assert found["added"].values[:, 0] == pytest.approx([0.2, 0.1])
    assert float(found["interaction"].sel(effect="one", other="two")[0]) == pytest.approx(0.05)
    assert float(found["dropped_pair"].sel(effect="one", other="two")[0]) == pytest.approx(0.35)
    rows = {row[0]: row[1:] for row in table(found).rows}
    assert rows["gravity"] == ("250 mm/s", "one run")
    assert rows["friction, added alone"] == ("100 mm/s", "")
    assert rows["gravity, interaction"] == ("50 mm/s, with friction", "")
    assert "added alone" in chart("c", found, "t")["c.svg"].decode()
    points[frozenset({"one", "two"})] = Point({}, {}, {}, 0, "it jams")
    refused = with_pairs(made, [one, two], [VELOCITY], points, 0)
    assert np.isnan(refused["added"].values).all()
    assert np.isnan(refused["interaction"].values).all()
    assert (
        "Refused by the solver, also at a tighter tolerance, without gravity and friction: it jams"
        in table(refused).notes
    )
