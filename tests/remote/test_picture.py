"""Pictures: decoding what a stranger sent, and other sizes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import LinkError
from shapechanger.remote.observations import decode_picture, resize_picture
from tests.remote.robot import picture

sides = st.integers(1, 12)


def test_a_picture_is_rgb_and_upright() -> None:
    """Shape (height, width, 3), red where it is red."""
    seen = decode_picture(picture((160, 120), number=10))
    assert seen.shape == (120, 160, 3)
    assert seen.dtype == np.uint8
    assert abs(int(seen[..., 0].mean()) - 80) < 3
    assert seen[:, 0, 1].mean() < 10
    assert seen[:, -1, 1].mean() > 245


@given(data=st.binary(max_size=200))
def test_bytes_that_are_no_picture_are_refused_in_words(data: bytes) -> None:
    """Whatever they are."""
    with pytest.raises(LinkError, match="invalid JPEG"):
        decode_picture(data)


def test_a_torn_picture_is_refused() -> None:
    """Half a JPEG is no JPEG."""
    whole = picture((160, 120), 1)
    with pytest.raises(LinkError, match="invalid JPEG"):
        decode_picture(whole[: len(whole) // 2])


def test_a_few_bytes_cannot_ask_for_all_memory() -> None:
    """A header may claim gigabytes."""
    whole = bytearray(picture((16, 16), 1))
    frame = whole.index(b"\xff\xc0")
    whole[frame + 5 : frame + 9] = (20_000).to_bytes(2, "big") * 2
    with pytest.raises(LinkError, match="20000 x 20000 pixels is too large"):
        decode_picture(bytes(whole))


@given(width=sides, height=sides, wide=sides, high=sides, level=st.integers(0, 255))
def test_one_colour_stays_that_colour(
    width: int, height: int, wide: int, high: int, level: int
) -> None:
    """At any size, of the shape that was asked for."""
    small = resize_picture(np.full((height, width, 3), level, np.uint8), (wide, high))
    assert small.shape == (high, wide, 3)
    assert small.dtype == np.uint8
    assert (small == level).all()


@given(data=st.data(), wide=sides, high=sides, by=st.integers(1, 4))
def test_shrinking_by_a_whole_number_keeps_the_mean(
    data: st.DataObject, wide: int, high: int, by: int
) -> None:
    """A box is its mean, so the brightness stays, but for rounding."""
    seed = data.draw(st.integers(0, 2**32 - 1))
    whole = np.random.default_rng(seed).integers(0, 256, (by * high, by * wide, 3), np.uint8)
    assert abs(float(resize_picture(whole, (wide, high)).mean()) - float(whole.mean())) <= 0.5


def test_other_sizes_take_the_nearest_pixel() -> None:
    """Without mirroring or shifting: the middle of 5 from 10 and so on."""
    row = np.arange(5, dtype=np.uint8)
    whole = np.repeat(np.repeat(row[None, :, None], 2, axis=0), 3, axis=2)
    assert resize_picture(whole, (2, 2))[0, :, 0].tolist() == [1, 3]
    assert resize_picture(whole, (10, 2))[0, :, 0].tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]


def test_its_own_size_is_the_picture_itself() -> None:
    """No work for nothing."""
    whole = np.zeros((2, 3, 3), np.uint8)
    assert resize_picture(whole, (3, 2)) is whole
