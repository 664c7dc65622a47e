"""The verdict, for each thing that can happen."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.reports.verdict import Direction, caveats, direction, is_flat, verdict
from shapechanger.transfer.metrics import Estimate
from shapechanger.transfer.study import Study
from tests.reports.studies import make_study, rising

SCRATCH = rising(0.0, 1000.0, 3000.0)
FLAT = rising(997.0, 1005.0, 3000.0, noise=2.0)


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


@pytest.mark.parametrize(
    ("study", "words"),
    [
        (make_study(), "Transfer helped: over 10,240 target steps fine-tune's return averages "),
        (make_study(fine_tune=rising(-400.0, 700.0, 4000.0, seed=5)), "Transfer hurt: over "),
        (
            make_study(fine_tune=SCRATCH + np.linspace(-200.0, 200.0, 5)[:, np.newaxis]),
            "Transfer made no clear difference: over ",
        ),
        (
            make_study(arms=("scratch", "zero-shot")),
            "Transfer helped at the start: untrained on the target, zero-shot's return is 400 and ",
        ),
        (
            make_study(scratch=FLAT, fine_tune=FLAT, zero_shot=FLAT[:, :1]),
            "This budget or measure shows nothing: scratch's return starts at 997 and ends at 1,0",
        ),
    ],
    ids=["helped", "hurt", "unclear", "zero-shot", "flat"],
)
def test_the_verdict_is_one_short_sentence(study: Study, words: str) -> None:
    """At most 25 words; all other numbers stand in the table."""
    text = verdict(study)
    assert text.startswith(words)
    assert text.endswith(".")
    assert ". " not in text
    assert len(text.split()) <= 25


def test_scratch_that_stays_low_shows_something_if_another_arm_rises() -> None:
    """An ant that walks only with a source policy is the result, not a flaw of the study."""
    low = rising(0.0, 1.0, 3000.0, noise=0.1)
    assert not is_flat(make_study(scratch=low))
    assert is_flat(make_study(scratch=low + 100.0, fine_tune=low + 101.0, zero_shot=low[:, :1]))


def test_caveats_name_what_the_numbers_cannot_say() -> None:
    """One given policy, few seeds, and a source that takes the whole budget."""
    two = make_study(scratch=SCRATCH[:2], given=True)
    text = " ".join(caveats(two))
    assert "until its 2,048 source steps have passed" in text
    assert "one given source policy" in text
    assert "With 2 seeds the intervals are wide" in text
    assert len(caveats(make_study())) == 1
    assert caveats(make_study(source_steps=0)) == ()
    assert "only the jumpstart is meaningful" in caveats(make_study(source_steps=10_240))[0]
