"""Procedural textures."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import UnknownName
from shapechanger.vehicles.courses.textures import PAINTERS, texture


@pytest.mark.parametrize("name", PAINTERS)
def test_a_texture_is_small_varied_and_reproducible(name: str) -> None:
    """Equal seeds give equal textures in every process, of at most 512 pixels a side."""
    image = texture(name, 1).copy()
    assert (image.dtype, image.shape[2]) == (np.uint8, 3)
    assert max(image.shape) <= 512
    assert image.std() > 1.0
    texture.cache_clear()
    np.testing.assert_array_equal(texture(name, 1), image)
    assert not np.array_equal(texture(name, 2), image)


@pytest.mark.parametrize(
    "name",
    ["floor", "asphalt", "water", "sea", "paving", "grass", "hedge", "ceiling", "brick", "fence"],
)
def test_repeating_textures_have_no_seam(name: str) -> None:
    image = texture(name, 3).astype(float)
    inside = np.abs(np.diff(image, axis=1)).mean(axis=(0, 2))
    seam = np.abs(image[:, 0] - image[:, -1]).mean()
    assert seam <= inside.max() * 1.5


def test_cached_textures_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        texture("door", 0)[0, 0, 0] = 1


def test_an_unknown_texture_is_refused() -> None:
    with pytest.raises(UnknownName, match="Did you mean 'plaster'"):
        texture("plastre", 0)
