"""The findings of a study: measures against hand computations, the verdict and its caveats."""

from __future__ import annotations

import re

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.transfer.metrics.intervals import Estimate
from shapechanger.transfer.report.verdict import (
    Direction,
    MeasureRow,
    arm_rows,
    caveats,
    direction,
    learned,
    machine_text,
    measure_rows,
    other_arms,
    outcome,
    verdict,
    weak_individuals,
)
from shapechanger.transfer.study import Study
from tests.transfer.report.studies import STEPS, make_study, rising

SCRATCH = rising(0.0, 1000.0, 3000.0)
FLAT = rising(997.0, 1005.0, 3000.0, noise=2.0)
MANY = ("scratch", "zero-shot", "fine-tune", "evolution", "randomised")
# Straight lines, so that areas and crossings are easy to compute. Scratch rises from 0 to 1000 in
# 10,240 steps, and its final value is the mean of the last three evaluations: 900.
SLOPE = STEPS / STEPS[-1]


@pytest.mark.parametrize(
    ("expected", "ends"),
    [("up", (0.1, 0.5)), ("down", (-0.5, -0.1)), ("unclear", (-0.1, 0.5)), ("unclear", (0.0, 0.5))],
)
def test_direction_follows_the_interval(expected: Direction, ends: tuple[float, float]) -> None:
    assert direction(Estimate(0.3, *ends)) == expected
    assert direction(Estimate(0.3)) == direction(Estimate(None)) == "unclear"


@pytest.mark.parametrize(
    ("study", "words"),
    [
        (make_study(), "Transfer helped: over 10,240 target steps fine-tune's return averaged "),
        (make_study(fine_tune=rising(-400.0, 700.0, 4000.0, seed=5)), "Transfer hurt: over "),
        (
            make_study(fine_tune=SCRATCH + np.linspace(-200.0, 200.0, 5)[:, np.newaxis]),
            "Transfer made no clear difference: over ",
        ),
        (
            make_study(arms=("scratch", "zero-shot")),
            "Zero-shot stayed behind scratch: zero-shot's return was 400 without training, and "
            "scratch's went from 1.23 to 881 in 10,240 ",
        ),
        (
            make_study(scratch=FLAT, fine_tune=FLAT + 3000.0, zero_shot=FLAT[:, :1]),
            "No arm learned in 10,240 target steps: scratch's return went from 997 to 1,000, and "
            "fine-tune's went from 4,000 to 4,000.",
        ),
        (
            make_study(scratch=FLAT, fine_tune=FLAT, evolution=SCRATCH * 3.0, arms=MANY[:4]),
            "Neither scratch nor fine-tune learned in 10,240 target steps: scratch's return went ",
        ),
    ],
)
def test_the_verdict_is_one_short_sentence(study: Study, words: str) -> None:
    text = verdict(study)
    assert text.startswith(words)
    assert text.endswith(".")
    assert ". " not in text
    assert len(text.split()) <= 25


def test_the_other_arms_have_sentences() -> None:
    """Arms that are not trained on the target are compared with scratch at its end."""
    assert other_arms(make_study(arms=("scratch", "fine-tune"))) == ""
    good = np.linspace(1500.0, 1600.0, 5)[:, np.newaxis]
    assert other_arms(make_study(arms=MANY, randomised=good, evolution=SCRATCH)) == (
        "Of the other arms, evolution (617) made no clear difference. Without training, zero-shot "
        "(400) stayed behind scratch; randomised (1,550) came out ahead of scratch; scratch went "
        "from 1.23 to 881 in training."
    )
    # If there is no interval because all seeds are equal, the verdict states it.
    solved = {"scratch": np.tile(1000.0 * SLOPE, (5, 1)), "zero_shot": np.full((5, 1), 1000.0)}
    words = "cannot be judged without an interval"
    assert f"zero-shot (1,000) {words};" in other_arms(make_study(**solved))
    alone = make_study(**solved, arms=("scratch", "zero-shot"))
    assert verdict(alone).startswith(f"Zero-shot {words}: zero-shot's return was 1,000 without ")


WAY_ON = "again with --seeds 5, and it keeps these runs and adds the others."
JUDGED = re.compile("helped|hurt|differ|ahead|behind")
values = st.floats(-2000.0, 2000.0)


@st.composite
def studies(draw: st.DrawFn, *, flat: bool = False) -> Study:
    """Studies of two to six seeds whose arms start and end anywhere."""
    n, noise = draw(st.integers(2, 6)), 0.0 if flat else draw(st.floats(0.0, 100.0))
    curves = {}
    for i, arm in enumerate(("scratch", "fine_tune", "evolution", "zero_shot", "randomised")):
        start, end = draw(values), draw(values)
        rows = rising(start, start if flat else end, 3000.0, n, noise, seed=i)
        curves[arm] = rows if i < 3 else rows[:, :1]
    return make_study(arms=draw(st.sampled_from([MANY[:2], MANY[:3], MANY])), **curves)


law = settings(max_examples=30, deadline=None)


@law
@given(studies())
def test_a_verdict_needs_three_seeds(study: Study) -> None:
    """With two seeds there are means, and a way to add seeds to the study."""
    text, few = f"{verdict(study)} {other_arms(study)}", study.plan.seeds < 3
    assert text.count(f"A verdict needs at least 3 seeds: run the same study {WAY_ON}") == few
    assert not (few and JUDGED.search(text))


@law
@given(studies(), values)
def test_an_untrained_policy_is_no_baseline(study: Study, start: float) -> None:
    """No arm is called helpful without training, and the start of scratch judges none."""
    for sentence in f"{verdict(study)} {other_arms(study)}".split(". "):
        untrained = re.search("zero-shot|randomised", sentence)
        assert not (untrained and re.search("helped|hurt", sentence))
    runs = list(study.runs)
    for i, run in enumerate(runs):
        if run.run.kind == "scratch":
            first = msgspec.structs.replace(run.curve[0], mean_return=start)
            runs[i] = msgspec.structs.replace(run, curve=(first, *run.curve[1:]))
    other = msgspec.structs.replace(study, runs=tuple(runs))
    if learned(study, "scratch") and learned(other, "scratch"):
        assert outcome(other, "zero-shot") == outcome(study, "zero-shot")


@law
@given(studies(), studies(flat=True))
def test_the_verdict_says_when_nobody_learned(study: Study, flat: Study) -> None:
    """Without a rise there is no judgement, however far apart the arms are."""
    assert not any(learned(flat, arm) for arm in flat.plan.arms)
    for one in (study, flat):
        unlearned = not any(learned(one, arm) for arm in one.plan.arms)
        assert verdict(one).startswith("No arm learned in 10,240 target steps: ") == unlearned
        assert not (unlearned and JUDGED.search(f"{verdict(one)} {other_arms(one)}"))


def test_caveats_name_limits_of_the_study() -> None:
    """Caveats name a given policy, few seeds, and a source that takes the whole budget."""
    two = make_study(scratch=SCRATCH[:2], given=True)
    text = " ".join(caveats(two))
    assert "until its 2,048 source steps have passed" in text
    assert "start from the one that was given" in text
    assert "With 2 seeds the intervals are wide" in text
    assert len(caveats(make_study())) == 1
    assert caveats(make_study(source_steps=0)) == ()
    assert "only the jumpstart is meaningful" in caveats(make_study(source_steps=10_240))[0]


def test_runs_on_different_devices_are_a_caveat() -> None:
    """The caveat names the kinds of runs that were trained on each device."""
    study = make_study(source_steps=0)
    assert machine_text([study]) == study.machine
    places = {"scratch": "CPU", "fine-tune": "NVIDIA H100"}
    runs = tuple(
        msgspec.structs.replace(run, device=places.get(run.run.kind, "")) for run in study.runs
    )
    mixed = msgspec.structs.replace(study, runs=runs)
    (text,) = caveats(mixed)
    assert "on CPU scratch; on NVIDIA H100 fine-tune" in text
    assert machine_text([study, mixed]).endswith("; learned on CPU, NVIDIA H100")
    one = tuple(msgspec.structs.replace(run, device="CPU") for run in study.runs)
    assert caveats(msgspec.structs.replace(study, runs=one)) == ()


def test_individuals_where_an_arm_is_weak_are_named() -> None:
    """Each arm counts the individuals with at least 80 % success, and names the others."""
    shares = {"scratch": (0.0, 0.6, 0.8), "fine-tune": (0.8, 1.0, 0.9)}
    study = make_study(scratch=SCRATCH[:3], fine_tune=SCRATCH[:3], arms=tuple(shares))
    assert weak_individuals(study) == []

    fingers = msgspec.structs.replace(study.plan, individual="finger_seed")
    study = msgspec.structs.replace(study, plan=fingers)
    assert weak_individuals(study) == []

    runs = [
        msgspec.structs.replace(
            result,
            curve=tuple(
                msgspec.structs.replace(each, success=shares[result.run.kind][result.run.index])
                for each in result.curve
            ),
        )
        for result in study.runs
        if result.run.kind in shares
    ]
    assert weak_individuals(msgspec.structs.replace(study, runs=tuple(runs))) == [
        "scratch reaches 80% on 1 of 3 fingers, not on finger 0 (0%), finger 1 (60%).",
        "fine-tune reaches 80% on 3 of 3 fingers.",
    ]


def by_name(study: Study, arm: str) -> dict[str, MeasureRow]:
    return {row.measure: row for row in measure_rows(study) if row.arm == arm}


@pytest.fixture(scope="module")
def lines() -> Study:
    """Two seeds each: scratch from 0 to 1000, fine-tune 450 above it; random has the mean 0."""
    return make_study(
        scratch=np.array([1000.0 * SLOPE - 9.0, 1000.0 * SLOPE + 9.0]),
        fine_tune=np.array([1000.0 * SLOPE + 450.0, 1000.0 * SLOPE + 450.0]),
        zero_shot=np.array([[450.0], [450.0]]),
        random=np.array([[-1.0], [1.0]]),
        source_steps=1024,
    )


def test_gains_by_hand(lines: Study) -> None:
    """450 of 1350 is a gain of 1/3; s of scratch is 9 · sqrt(2), so 1/3 ± 12.706 · 9 / 1350."""
    rows = by_name(lines, "fine-tune")
    for name in ("Jumpstart", "Total reward gain", "Asymptotic gain"):
        assert rows[name].target == "+0.33 [+0.25, +0.42]"
        assert rows[name].unit == "score"
        assert rows[name].method == "Welch's t"
    # In total steps, scratch is read at step 1024, where it is 100.
    assert rows["Jumpstart"].total == "+0.26 [+0.17, +0.34]"


def test_times_by_hand(lines: Study) -> None:
    """A score of 0.5 is 675, which scratch reaches after 675 / 1000 of 10,240 steps: 6,912."""
    row = by_name(lines, "fine-tune")["Time to threshold 0.5: steps saved"]
    # Fine-tune starts at 450 and needs 225 more: 2,304 steps, or 3,328 with the source.
    assert row.target.startswith("+4,608 [")
    assert row.total.startswith("+3,584 [")
    assert row.unit == "steps"
    assert row.note == (
        "Reached by 2 of 2 seeds of fine-tune after a mean of 2,304 steps; in total steps by 2 of "
        "2 seeds after 3,328; by 2 of 2 seeds of scratch after 6,912."
    )


def test_censored_runs_are_noted() -> None:
    """Runs that never reach the threshold count as the budget, with a note."""
    study = make_study(fine_tune=rising(0.0, 300.0, 1000.0, seed=2))  # Scratch is the best arm.
    note = by_name(study, "fine-tune")["Time to threshold 0.9: steps saved"].note
    assert "0 of 5 seeds of fine-tune after a mean of 10,240 steps" in note
    assert note.endswith("Runs that did not reach it count as 10,240.")


def test_undefined_measures_have_a_reason() -> None:
    rows = by_name(make_study(arms=("scratch", "zero-shot")), "zero-shot")
    assert rows["Area ratio"].target == rows["Area ratio"].total == "undefined"
    assert rows["Area ratio"].method == "none"
    assert rows["Area ratio"].note.startswith("Undefined: it needs a learning curve")
    # Notes name their way of counting.
    row = by_name(make_study(source_steps=10_240), "fine-tune")["Area ratio"]
    assert row.total == "0 (no interval)"
    assert row.method.endswith("/ none")
    assert row.note.startswith("In total steps: No interval")


def test_arms_by_hand(lines: Study) -> None:
    """The final value is the mean of the last three evaluations: 800, 900 and 1000."""
    rows = {row.kind: row for row in arm_rows(lines)}
    assert list(rows) == ["source", "random", "zero-action", "scratch", "zero-shot", "fine-tune"]
    scratch = rows["scratch"]
    assert scratch.seeds == 2
    assert scratch.per_seed == "891.0; 909.0"
    assert scratch.final == scratch.final_return == "900 [786, 1,014]"
    assert scratch.first == "0 [-114, 114]"
    assert scratch.length == "100"
    # The best run ends at 1350, so good runs end at 1215 or more.
    assert scratch.good == "0 of 2"
    assert rows["fine-tune"].good == "2 of 2"
    assert rows["source"].good == ""
    assert scratch.terms == {}
    low = rising(-900.0, -900.0, 1e3)
    unlearned = make_study(scratch=low, fine_tune=low, zero_shot=low[:, :1])
    assert {row.good for row in arm_rows(unlearned)} == {""}


def test_the_source_ends_with_its_last_evaluation(study: Study) -> None:
    """The source row shows the transferred policy: the last evaluation instead of a mean."""
    row = next(row for row in arm_rows(study) if row.kind == "source")
    assert [float(text) for text in row.per_seed.split("; ")] == pytest.approx(
        study.source_return, abs=0.1
    )
