"""Procedural textures."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import UnknownName
from shapechanger.vehicles.courses.paint import clouds
from shapechanger.vehicles.courses.textures import PAINTERS, texture

_TILED = (
    "floor",
    "asphalt",
    "water",
    "sea",
    "paving",
    "grass",
    "hedge",
    "ceiling",
    "brick",
    "fence",
)


@pytest.mark.parametrize("name", PAINTERS)
def test_a_texture_is_small_and_not_uniform(name: str) -> None:
    """The dtype is uint8, with three channels and at most 512 pixels a side."""
    picture = texture(name, 0)
    assert picture.dtype == np.uint8
    assert picture.shape[2] == 3
    assert max(picture.shape) <= 512
    assert picture.std() > 1.0


@pytest.mark.parametrize("name", PAINTERS)
def test_textures_are_reproducible(name: str) -> None:
    """Equal seeds give equal textures in every process."""
    first = texture(name, 1).copy()
    texture.cache_clear()
    np.testing.assert_array_equal(texture(name, 1), first)
    assert not np.array_equal(texture(name, 2), first)


@pytest.mark.parametrize("name", _TILED)
def test_repeating_textures_have_no_seam(name: str) -> None:
    """Repeating textures are continuous across their edges."""
    picture = texture(name, 3).astype(float)
    inside = np.abs(np.diff(picture, axis=1)).mean(axis=(0, 2))
    seam = np.abs(picture[:, 0] - picture[:, -1]).mean()
    assert seam <= inside.max() * 1.5


def test_cached_textures_are_read_only() -> None:
    """Writing to a cached texture raises an error."""
    with pytest.raises(ValueError, match="read-only"):
        texture("door", 0)[0, 0, 0] = 1


def test_an_unknown_texture_is_refused() -> None:
    """The error suggests the nearest name."""
    with pytest.raises(UnknownName, match="Did you mean 'plaster'"):
        texture("plastre", 0)


def test_clouds_have_mean_0_and_deviation_1() -> None:
    field = clouds(np.random.default_rng(0), 64, 96, 4, 6)
    assert field.shape == (64, 96)
    assert field.mean() == pytest.approx(0.0, abs=1e-5)
    assert field.std() == pytest.approx(1.0, abs=1e-4)
