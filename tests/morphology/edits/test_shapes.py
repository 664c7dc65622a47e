"""Longer and thicker segments."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import Radius, Stretch
from tests.morphology.models import ant, built, leg, mass, pendulum, tip


def test_a_longer_segment_is_as_thick_as_before() -> None:
    """Radius and density stay, and the end moves out."""
    before, after = built(leg()), built(leg(), Stretch("thigh", 2.0))
    np.testing.assert_allclose(after.geom("thigh").size, [0.03, 0.3, 0.0])
    np.testing.assert_allclose(after.geom("thigh").pos, [0.0, 0.0, -0.3])
    volumes = [math.pi * 0.03**2 * length + 4 / 3 * math.pi * 0.03**3 for length in (0.3, 0.6)]
    assert mass(after, "thigh") == pytest.approx(500.0 * volumes[1])
    assert mass(before, "thigh") == pytest.approx(500.0 * volumes[0])
    np.testing.assert_allclose(tip(after, "toe") - tip(before, "toe"), [0.0, 0.0, -0.3], atol=1e-12)


def test_a_thicker_segment_is_as_long_as_before() -> None:
    """Children do not move."""
    before, after = built(leg()), built(leg(), Radius("thigh", 2.0))
    np.testing.assert_allclose(after.geom("thigh").size, [0.06, 0.15, 0.0])
    np.testing.assert_array_equal(after.body_pos, before.body_pos)
    assert mass(after, "thigh") == pytest.approx(
        500.0 * (math.pi * 0.06**2 * 0.3 + 4 / 3 * math.pi * 0.06**3)
    )


def test_a_glob_stretches_every_match() -> None:
    """Parents are stretched first, so that children move along."""
    model = built(ant(), Stretch("shank_*", 0.5))
    np.testing.assert_allclose(
        [model.geom(f"{leg}_ankle_geom").size[1] for leg in ("left", "right", "third", "fourth")],
        0.1 * math.sqrt(2.0),
    )
    whole = built(leg(), Stretch("*", 2.0))
    np.testing.assert_allclose(tip(whole, "toe"), [0.0, 0.4, 1.0 - 2.0 * (0.3 + 0.24)])


def test_a_pole_keeps_its_lean_along_an_axis() -> None:
    """Stretched along z only, the end of the pole stays 1 mm off."""
    model = built(pendulum(), Stretch("pole", 2.0, axis="z"))
    np.testing.assert_allclose(2.0 * model.geom("cpole").pos, [0.001, 0.0, 1.2])


@pytest.mark.parametrize("kind", [Stretch, Radius])
@pytest.mark.parametrize("factor", [0.0, -2.0, math.nan, math.inf, 1e-3, 1e3])
def test_absurd_factors_are_refused(kind: type[Stretch | Radius], factor: float) -> None:
    with pytest.raises(MorphologyError, match=r"must be a ratio between 0\.01 and 100, got"):
        kind("thigh", factor)


@pytest.mark.parametrize("kind", [Stretch, Radius])
def test_an_unknown_body_is_refused(kind: type[Stretch | Radius]) -> None:
    """The error suggests the nearest name."""
    with pytest.raises(
        UnknownName, match=r"No body matches 'thgih'\. Did you mean 'thigh'\? There"
    ):
        built(leg(), kind("thgih", 2.0))


def test_partial_factors_are_linear() -> None:
    half, twice = Stretch("thigh", 3.0).partly(0.5), Stretch("thigh", 2.0)
    np.testing.assert_array_equal(built(leg(), half).body_pos, built(leg(), twice).body_pos)
    half, twice = Radius("thigh", 3.0).partly(0.5), Radius("thigh", 2.0)
    np.testing.assert_array_equal(built(leg(), half).body_mass, built(leg(), twice).body_mass)
