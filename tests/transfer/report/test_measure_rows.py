"""The table of measures, compared with values worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.transfer.report.verdict import MeasureRow, arm_rows, measure_rows
from shapechanger.transfer.study import Study
from tests.transfer.report.studies import STEPS, make_study, rising

# Straight lines, so that areas and crossings are easy to compute. Scratch rises from 0 to 1000 in
# 10,240 steps, and its final value is the mean of the last three evaluations: 900.
SLOPE = STEPS / STEPS[-1]


def by_name(study: Study, arm: str) -> dict[str, MeasureRow]:
    """Return the rows of one arm."""
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
    flat = rising(-50.0, -50.0, 1e3)
    not_learnt = make_study(scratch=flat, fine_tune=flat, zero_shot=flat[:, :1])
    rows = by_name(not_learnt, "fine-tune")
    assert rows["Jumpstart"].unit == "value"
    assert "no score exists" in rows["Time to threshold 0.5: steps saved"].note


def test_notes_name_their_way_of_counting() -> None:
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


def test_the_source_ends_with_its_last_evaluation(study: Study) -> None:
    """The source row shows the transferred policy: the last evaluation instead of a mean."""
    row = next(row for row in arm_rows(study) if row.kind == "source")
    assert [float(text) for text in row.per_seed.split("; ")] == pytest.approx(
        study.source_return, abs=0.1
    )


def test_no_run_is_good_where_none_learned() -> None:
    low = rising(-900.0, -900.0, 1e3)
    study = make_study(scratch=low, fine_tune=low, zero_shot=low[:, :1])
    assert {row.good for row in arm_rows(study)} == {""}
