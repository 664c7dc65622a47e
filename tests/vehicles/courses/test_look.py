"""Random and default looks."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import UnknownName
from shapechanger.vehicles.courses.course import LOOKS, VARIANTS, Look


@pytest.mark.parametrize("world", LOOKS)
def test_a_random_look_stays_in_its_ranges(world: str) -> None:
    usual = Look.of(world)
    for seed in range(200):
        look = Look.random(world, np.random.default_rng(seed))
        assert 0.6 * usual.light <= look.light <= min(1.0, 1.4 * usual.light)
        assert abs(look.warmth - usual.warmth) <= 0.35
        assert 0.0 <= look.warmth <= 1.0
        assert abs(look.contrast - usual.contrast) <= 0.3
        assert 0.0 <= look.contrast <= 1.0
        assert 0.4 * usual.gloss <= look.gloss <= min(0.9, 1.6 * usual.gloss)
        assert 0 <= look.texture_seed < VARIANTS
        for channel in (*look.wall, *look.ground):
            assert 0.75 <= channel <= 1.0


def test_an_unknown_world_is_refused() -> None:
    with pytest.raises(UnknownName, match="Did you mean 'harbour'"):
        Look.of("harbor")
    with pytest.raises(UnknownName, match="Did you mean 'yard'"):
        Look.random("yrd", np.random.default_rng(0))
