"""Forward transfer: values by hand, and edge cases."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics import (
    MIN_HEADROOM,
    Estimate,
    LearningCurves,
    forward_transfer,
    in_total_steps,
)

STEPS = np.array([0.0, 10.0, 20.0])


def curves(*rows: tuple[float, float, float]) -> LearningCurves:
    """Return scores of a few seeds."""
    return LearningCurves(STEPS, np.array(rows))


def transfer(arm: LearningCurves, scratch: LearningCurves) -> Estimate:
    """Return `forward_transfer` with few resamples."""
    return forward_transfer(arm, scratch, rng=np.random.default_rng(0))


# Areas 0.4 and 0.6, 0.5 on the mean; and 0.1 and 0.3, 0.2 on the mean.
ARM = curves((0.0, 0.4, 0.8), (0.2, 0.6, 1.0))
SCRATCH = curves((0.0, 0.1, 0.2), (0.1, 0.3, 0.5))


def test_forward_transfer() -> None:
    assert transfer(ARM, SCRATCH).value == pytest.approx(0.375)


def test_interval() -> None:
    """With enough seeds there is a bootstrap interval, whose ends are at most 1."""
    heights = np.linspace(0.0, 0.3, 5)
    arm = curves(*((h, 0.3 + h, 0.6 + h) for h in heights))
    scratch = curves(*((h, h, h) for h in heights))
    estimate = transfer(arm, scratch)
    assert estimate.method == "studentised bootstrap"
    assert estimate.value is not None
    assert estimate.low is not None
    assert estimate.high is not None
    assert 0.0 < estimate.low < estimate.value < estimate.high < 1.0
    # Most seeds can do nearly everything at once: less than nothing might seem to be left.
    skewed = curves(*((h, h, h) for h in (0.99, 0.98, 1.0, 0.95, 0.2)))
    assert transfer(skewed, scratch).high == 1.0


def test_forward_transfer_in_total_steps() -> None:
    """With half the budget on the source: (0.15 - 0.2) / (1 - 0.2)."""
    assert transfer(in_total_steps(ARM, 10, 0.0), SCRATCH).value == pytest.approx(-0.0625)


@pytest.mark.parametrize(
    ("height", "is_defined"), [(1.0, False), (0.995, False), (0.98, True), (0.0, True)]
)
def test_headroom_is_needed(height: float, is_defined: bool) -> None:
    estimate = transfer(ARM, curves((height, height, height)))
    assert (estimate.value is not None) is is_defined
    if not is_defined:
        assert f"less than {MIN_HEADROOM:g}" in estimate.note


@pytest.mark.parametrize("outside", [-0.1, 1.1])
def test_scores_must_be_clipped(outside: float) -> None:
    """Values outside [0, 1] are refused."""
    wild = curves((0.0, 0.5, outside))
    for arm, scratch in ((wild, SCRATCH), (ARM, wild), (in_total_steps(ARM, 5, outside), SCRATCH)):
        with pytest.raises(StudyError, match="clip=True"):
            transfer(arm, scratch)
