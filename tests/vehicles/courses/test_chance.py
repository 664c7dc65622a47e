"""Weighted random choice."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.vehicles.courses.furniture import weighted_choice


def test_frequencies_follow_the_weights() -> None:
    """Frequencies are proportional to the weights; weight 0 is never drawn."""
    rng = np.random.default_rng(0)
    counts = np.bincount([weighted_choice(rng, [3.0, 0.0, 1.0]) for _ in range(4000)], minlength=3)
    assert counts / 4000 == pytest.approx([0.75, 0.0, 0.25], abs=0.03)
