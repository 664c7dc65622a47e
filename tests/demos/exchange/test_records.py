"""Records of any format become the steps of episodes."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.demos.episodes import Step
from shapechanger.demos.episodes.records import longest_period_s
from shapechanger.demos.exchange import ExchangeEpisode, ExchangeRecord, ImportContext
from shapechanger.demos.exchange.base import drives, whole_records
from shapechanger.demos.exchange.files import load_jpeg
from shapechanger.demos.jpeg import decode_picture
from shapechanger.errors import DemosError
from shapechanger.layout import Layout
from tests.demos.exchange.small import findings_of, header, huge, image_file, picture

GOOD = [picture(n) for n in range(4)]
BAD: list[Any] = [b"", bytes(9), GOOD[0][:99], picture(0, 8, 8), Path("/nowhere.jpg")]
LEVEL = np.full((32, 40, 3), 102, np.uint8)
DEPTH = np.linspace(400, 4000, 32 * 40).reshape(32, 40)


@pytest.mark.parametrize(
    ("kind", "mode"),
    [*(("PNG", mode) for mode in ("RGB", "RGBA", "L", "P")), ("BMP", "RGB"), ("BMP", "1")],
)
def test_images_of_8_bits_become_jpegs(kind: str, mode: str) -> None:
    jpeg, size = load_jpeg(image_file(LEVEL, kind, mode))
    assert size == (40, 32)
    assert mode == "1" or abs(float(decode_picture(jpeg, "").mean()) - 102) < 1


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (image_file(DEPTH.astype(np.uint16)), "more than 8 bits a value, like that of a depth"),
        (image_file(DEPTH.astype(np.float32), "TIFF"), "not JPEG, PNG or BMP"),
        (image_file(np.dstack([LEVEL, LEVEL[..., :1]])), "partly transparent"),
        (image_file(LEVEL)[:60], "a damaged image"),
        (picture(0)[:200], "a damaged image"),
        (huge(), "a damaged image"),
        (b"", "an empty image"),
        (bytes(99), "an empty image"),
    ],
)
def test_other_images_are_refused(image: bytes, reason: str) -> None:
    with pytest.raises(DemosError, match=reason):
        load_jpeg(image)


@settings(max_examples=25, deadline=None)
@given(shown=st.lists(st.tuples(st.sampled_from([*GOOD, *BAD]), st.booleans(), st.booleans())))
def test_each_record_becomes_a_step_with_its_image_or_is_left_out(
    shown: list[tuple[Any, bool, bool]],
) -> None:
    context = ImportContext()
    records = [
        ExchangeRecord(
            name=f"record {n}",
            step=Step(action=(0.0 if finite else math.nan, n), driver="person"),
            image=data,
            fault="" if fine else f"with a fault {n}",
        )
        for n, (data, finite, fine) in enumerate(shown)
    ]
    episode = ExchangeEpisode(header=header(state_layout=Layout(())), records=records, name="it")
    kept = [(int(one.step.action[1]), one.jpeg) for one in whole_records(episode, context)]
    good = [n for n, (data, *fine) in enumerate(shown) if data in GOOD and all(fine)]
    assert kept == [(n, shown[n][0]) for n in good]
    faults = [n for n, (*_, fine) in enumerate(shown) if not fine]
    text = findings_of(context)
    assert all(f"record {n}: with a fault {n}" in text for n in faults)
    assert bool(text) == (len(good) < len(shown))


@settings(max_examples=50, deadline=None)
@given(
    st.lists(
        st.tuples(st.none() | st.integers(0, 2**60), st.sampled_from([None, *GOOD, *BAD])),
        min_size=1,
        max_size=12,
    )
)
def test_drives_have_intact_records_in_order_of_one_size_without_pauses(
    made: list[tuple[int | None, Any]],
) -> None:
    records = [
        ExchangeRecord(
            name=f"record {n}",
            number=n,
            image=image,
            step=Step(action=(0.0,), driver="person", captured_ns=at),
        )
        for n, (at, image) in enumerate(made)
    ]
    found = list(drives([records], header(), ImportContext()))
    kept = [record for part, _ in found for record in part]
    assert [one.number for one in kept] == sorted(one.number for one in kept)
    small, large = (sum(one.image in some for one in records) for some in (BAD[3:4], GOOD))
    pictures = [one.image for one in kept if one.image is not None]
    size = found[0][1].image_size if found else None
    if size == (8, 8):
        assert small >= large
        assert pictures == [BAD[3]] * small
    elif size:
        assert large >= small
        assert pictures == [image for _, image in made if image in GOOD]
    assert len(kept) - len(pictures) == sum(image is None for _, image in made)
    for part, head in found:
        times = [one.step.captured_ns for one in part]
        if head.clock == "none":
            assert times == [None] * len(times)
        else:
            longest_ns = 1e9 * longest_period_s(head.control_hz)
            assert all(0 <= later - now <= longest_ns for now, later in pairwise(times))
