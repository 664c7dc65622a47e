"""Camera faults."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import UnknownName
from shapechanger.vehicles.cameras.camera import (
    CORRUPTIONS,
    Corruption,
    Picture,
    blur,
    dirt,
    find_corruption,
    glare,
    night,
)

_ALL = pytest.mark.parametrize("change", CORRUPTIONS.values(), ids=CORRUPTIONS)


def _picture(height: int = 120, width: int = 160) -> Picture:
    """Return an image with edges and all levels."""
    rng = np.random.default_rng(0)
    rough = rng.integers(0, 256, (height // 8 + 1, width // 8 + 1, 3), np.uint8)
    return np.kron(rough, np.ones((8, 8, 1), np.uint8))[:height, :width].copy()


@_ALL
@pytest.mark.parametrize("size", [(120, 160), (33, 47), (1, 1), (1, 300), (300, 1), (1080, 1920)])
def test_lenses_keep_size_and_type(change: Corruption, size: tuple[int, int]) -> None:
    """A lens is a function of image and seed, and does not change its input."""
    before = _picture(*size)
    kept = before.copy()
    after = change(before, 3)
    assert after.shape == before.shape
    assert after.dtype == np.uint8
    assert not np.may_share_memory(before, after)
    np.testing.assert_array_equal(before, kept)
    np.testing.assert_array_equal(after, change(before, 3))
    if before.size > 3:  # A blur of one pixel is that pixel.
        assert not np.array_equal(before, after)


@pytest.mark.parametrize("change", [night, glare, dirt])
def test_another_seed_gives_another_picture(change: Corruption) -> None:
    assert not np.array_equal(change(_picture(), 5), change(_picture(), 6))


def test_night_halves_the_brightness_and_adds_noise() -> None:
    """Noise varies between images."""
    white = np.full((120, 160, 3), 255, np.uint8)
    dark = night(white, 0)
    assert dark.mean(axis=(0, 1)) == pytest.approx([117.3, 127.5, 168.3], abs=0.5)
    assert dark.std(axis=(0, 1)) == pytest.approx(9.0, abs=0.3)
    other = white.copy()
    other[0, 0] = 254
    assert not np.array_equal(night(other, 0)[1:], dark[1:])


def test_blur_keeps_the_sum() -> None:
    point = np.zeros((121, 161, 3), np.uint8)
    point[56:65, 76:85] = 255
    soft = blur(point, 0).astype(float)[..., 0]
    assert soft.sum() == pytest.approx(255 * 81, rel=0.02)
    columns = np.arange(161)
    variance = (soft.sum(axis=0) * (columns - 80) ** 2).sum() / soft.sum()
    assert variance == pytest.approx((81 - 1) / 12 + (0.0125 * 161) ** 2, rel=0.05)


def test_an_unknown_lens_is_refused() -> None:
    """The error suggests the nearest name."""
    assert find_corruption("night") is night
    with pytest.raises(UnknownName, match="Did you mean 'glare'"):
        find_corruption("glair")
