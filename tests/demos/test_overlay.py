"""Actions drawn into images."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.demos.episodes import Step
from shapechanger.demos.jpeg import COLOURS, overlay
from tests.demos.episodes.making import ACTIONS

PICTURE = np.full((30, 40, 3), 7, np.uint8)


@pytest.mark.parametrize(("steering", "left", "right"), [(-1.0, 1, 0), (0.5, 0, 1)])
def test_the_bar_shows_the_steering(steering: float, left: int, right: int) -> None:
    drawn = overlay(PICTURE, Step(action=(steering, 0.0), driver="person"), ACTIONS)
    assert drawn.shape == (30 * 12 + 2 * 14, 480, 3)
    assert (drawn[: 30 * 12] == 7).all()
    blue = (drawn[30 * 12 + 7] == COLOURS["person"]).all(axis=1)
    assert blue[:235].any() == bool(left)
    assert blue[245:].any() == bool(right)
    assert blue.sum() == pytest.approx(240 * abs(steering), abs=3)


def test_the_suggestion_is_a_white_line() -> None:
    step = Step(action=(0.0, 0.0), driver="expert", wanted=(0.5, -1.0))
    drawn = overlay(PICTURE, step, ACTIONS)
    white = np.argwhere((drawn[30 * 12 + 7] == 255).all(axis=1)).ravel()
    assert white.tolist() == pytest.approx([360, 360], abs=2)
