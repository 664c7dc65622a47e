"""The verdict, for each thing that can happen."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.reports.verdict import Direction, caveats, direction, verdict
from shapechanger.transfer.metrics import Estimate
from tests.reports.studies import STEPS, make_study, rising

SCRATCH = rising(0.0, 1000.0, 3000.0)
NO_TRANSFER = "the comparison means little"


@pytest.mark.parametrize(
    ("estimate", "expected"),
    [
        (Estimate(0.3, 0.1, 0.5), "up"),
        (Estimate(-0.3, -0.5, -0.1), "down"),
        (Estimate(0.3, -0.1, 0.5), "unclear"),
        (Estimate(0.3, 0.0, 0.5), "unclear"),
        (Estimate(0.3), "unclear"),
        (Estimate(None), "unclear"),
    ],
)
def test_direction_goes_by_the_interval(estimate: Estimate, expected: Direction) -> None:
    """A value alone says nothing, and an interval that touches 0 does not either."""
    assert direction(estimate) == expected


def test_transfer_helped() -> None:
    """All three measures appear, and total steps too."""
    text = verdict(make_study())
    assert text.startswith(
        "Counted in target steps, transfer helped: fine-tune earned more than scratch over "
        "its whole learning curve (total reward gain +0."
    )
    assert ", ended higher (asymptotic gain +" in text
    assert " and reached the score 0.9 sooner (+" in text
    assert "Counted in total steps, 2,048 of which go to the source, it helped" in text
    assert NO_TRANSFER not in text


def test_transfer_hurt() -> None:
    """The same sentence the other way round."""
    text = verdict(make_study(fine_tune=rising(-400.0, 700.0, 4000.0, seed=5)))
    assert "transfer hurt: fine-tune earned less than scratch" in text
    assert "ended lower" in text
    assert "reached the score 0.9 later (-" in text
    assert "to the source, it hurt (total reward gain -" in text


def test_no_clear_difference() -> None:
    """Where the interval holds 0 nothing is claimed, in no direction."""
    noisy = SCRATCH + np.linspace(-200.0, 200.0, 5)[:, np.newaxis]
    text = verdict(make_study(fine_tune=noisy, source_steps=0))
    assert "transfer made no clear difference: fine-tune earned neither clearly more" in text
    assert "ended neither clearly higher nor clearly lower" in text
    assert "it made no clear difference (total reward gain" in text


def test_a_gain_that_is_paid_for_later() -> None:
    """What goes the other way is joined by "but"."""
    falling = 950.0 - 350.0 * STEPS / STEPS[-1] + rising(0.0, 0.0, 1e3, noise=5.0, seed=3)
    text = verdict(make_study(fine_tune=falling))
    assert "transfer helped: fine-tune earned more" in text
    assert ", but ended lower (" in text
    assert " and reached the score 0.9 sooner (" in text


def test_helped_in_target_steps_and_hurt_in_total_steps() -> None:
    """Each sentence goes by its own count."""
    text = verdict(make_study(source_steps=6144))
    assert "transfer helped" in text
    assert "it hurt (total reward gain -" in text


def test_a_source_that_takes_the_whole_budget() -> None:
    """Then total steps compare with the random policy, and only the jumpstart remains."""
    study = make_study(source_steps=10_240)
    text = verdict(study)
    assert "Counted in total steps, the budget cannot show a gain" in text
    assert "used 10,240 steps of 10,240" in text
    assert "fine-tune starts below the level that scratch has reached by then (jumpstart -" in text
    assert "only the jumpstart is meaningful" in caveats(study)[0]


def test_scratch_that_did_not_learn() -> None:
    """Gains are in returns then, there is no time, and the reader is warned."""
    text = verdict(make_study(scratch=rising(-50.0, -50.0, 1e3)))
    assert ", return)" in text
    assert "reached the score" not in text
    assert "Scratch itself did not clearly learn: it ended at -" in text
    assert text.endswith("so the comparison means little: try more target steps.")


def test_scratch_that_learnt_by_chance_only() -> None:
    """A scale exists, but the interval of what scratch has learnt holds 0."""
    scratch = rising(0.0, 0.0, 1e3, noise=1.0) + np.linspace(-90.0, 130.0, 5)[:, np.newaxis]
    study = make_study(scratch=scratch)
    assert study.summaries["fine-tune"].unit == "score"
    assert NO_TRANSFER in verdict(study)


@pytest.mark.parametrize(
    ("level", "words"),
    [
        (400.0, "transfer helped at the start: the source policy, which is not trained on the "),
        (-400.0, "transfer hurt at the start"),
        (0.0, "transfer made no clear difference at the start"),
    ],
)
def test_zero_shot_only(level: float, words: str) -> None:
    """Judged by its start; its end follows."""
    zero_shot = level + np.linspace(-50.0, 50.0, 5)[:, np.newaxis]
    text = verdict(make_study(arms=("scratch", "zero-shot"), zero_shot=zero_shot))
    assert words in text
    assert "worse than the end of scratch (asymptotic gain -" in text
    assert "scratch after 2,048 steps, as many as the source used (jumpstart" in text


def test_zero_shot_only_with_a_long_source() -> None:
    """Scratch is then read at its end, and the sentence says so."""
    text = verdict(make_study(arms=("scratch", "zero-shot"), source_steps=20_480))
    assert "worse than scratch at its end, though the source used 20,480 steps" in text


def test_caveats_name_what_the_numbers_cannot_say() -> None:
    """One given policy, and few seeds."""
    two = make_study(scratch=SCRATCH[:2], given=True)
    text = " ".join(caveats(two))
    assert "until its 2,048 source steps have passed" in text
    assert "one given source policy" in text
    assert "With 2 seeds the intervals are wide" in text
    assert len(caveats(make_study())) == 1
    assert caveats(make_study(source_steps=0)) == ()
