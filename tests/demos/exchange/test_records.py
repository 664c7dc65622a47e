"""The way from records to episodes, which all formats share."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.demos.episodes import Step
from shapechanger.demos.exchange import ImportContext
from shapechanger.demos.exchange.format import SourceRecord, kept_steps, stretches
from shapechanger.demos.exchange.pictures import PictureError, load_jpeg, rows_of, with_pictures
from shapechanger.demos.jpeg import decode_picture
from tests.demos.exchange.small import header, huge, image_file, picture

GOOD = [picture(n) for n in range(4)]
BAD: list[Any] = [b"", bytes(9), GOOD[0][:99], picture(0, 8, 8), Path("/nowhere.jpg")]


LEVEL = np.full((32, 40, 3), 102, np.uint8)
DEPTH = np.linspace(400, 4000, 32 * 40).reshape(32, 40)


@pytest.mark.parametrize(
    ("kind", "mode"),
    [*(("PNG", mode) for mode in ("RGB", "RGBA", "L", "P")), ("BMP", "RGB"), ("BMP", "1")],
)
def test_images_of_8_bits_become_jpegs(kind: str, mode: str) -> None:
    data, context = image_file(LEVEL, kind, mode), ImportContext()
    jpeg, size, is_new = load_jpeg(data)
    assert (size, is_new) == ((40, 32), True)
    assert mode == "1" or abs(float(decode_picture(jpeg, "").mean()) - 102) < 1
    step = Step(action=(0.0,), driver="person")
    with_pictures([SourceRecord(name="0", step=step, picture=data)], "record", context)
    assert context.notes == ["1 image encoded as JPEG of quality 100."]


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (image_file(DEPTH.astype(np.uint16)), "more than 8 bits a value, like that of a depth"),
        (image_file(DEPTH.astype(np.float32), "TIFF"), "not JPEG, PNG or BMP"),
        (image_file(np.dstack([LEVEL, LEVEL[..., :1]])), "partly transparent"),
        (image_file(LEVEL)[:60], "a damaged image"),
        (picture(0)[:200], "a damaged image"),
        (huge(), "a damaged image"),
        (picture(0, 16, 8), "of 16 x 8 pixels, and not 40 x 32"),
        (None, "an empty image"),
        (bytes(99), "an empty image"),
    ],
)
def test_other_images_are_named(image: bytes | None, reason: str) -> None:
    with pytest.raises(PictureError, match=reason):
        load_jpeg(image, (40, 32))


@settings(max_examples=25, deadline=None)
@given(
    shown=st.lists(st.tuples(st.sampled_from([*GOOD, *BAD]), st.booleans(), st.booleans())),
)
def test_each_record_is_a_step_with_its_picture_or_left_out(
    shown: list[tuple[Any, bool, bool]],
) -> None:
    context = ImportContext()
    records = [
        SourceRecord(
            name=str(n),
            step=Step(action=(0.0 if finite else math.nan, n), driver="person"),
            picture=data,
            fault="" if fine else "with a fault",
        )
        for n, (data, finite, fine) in enumerate(shown)
    ]
    rows = rows_of(iter(records), header().image_size, context, "record")
    kept = [(int(step.action[1]), jpeg) for step, jpeg in kept_steps(rows)]
    good = [n for n, (data, *fine) in enumerate(shown) if data in GOOD and all(fine)]
    assert kept == [(n, shown[n][0]) for n in good]
    left = [int(name) for names in context.left_out.values() for name in names]
    assert sorted([*left, *good]) == [*range(len(shown))]


@settings(max_examples=25, deadline=None)
@given(st.lists(st.sampled_from([None, *GOOD, *BAD]), max_size=8))
def test_records_with_whole_pictures_of_one_size_remain(shown: list[Any]) -> None:
    """So that rates and jumps see the others as missing."""
    step = Step(action=(0.0,), driver="person")
    records = [SourceRecord(name=str(n), step=step, picture=data) for n, data in enumerate(shown)]
    kept, size = with_pictures(records, "record", ImportContext())
    small = sum(data == BAD[3] for data in shown)
    large = sum(data in GOOD for data in shown)
    pictures = [record.picture for record in kept if record.picture is not None]
    if size == (8, 8):
        assert small >= large
        assert pictures == [BAD[3]] * small
    else:
        assert large >= small
        assert pictures == [data for data in shown if data in GOOD]
    assert len(kept) - len(pictures) == shown.count(None)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.none() | st.integers(0, 2**60), min_size=1, max_size=20))
def test_stretches_are_all_records_in_order_and_without_jumps(times_ns: list[int | None]) -> None:
    records = [
        SourceRecord(
            name=str(n), number=n, step=Step(action=(0.0,), driver="person", captured_ns=ns)
        )
        for n, ns in enumerate(times_ns)
    ]
    found = stretches([records], "record", ImportContext())
    assert [record for part, _, _ in found for record in part] == records
    for part, _, timed in found:
        times = [record.step.captured_ns for record in part]
        assert times == (sorted(times) if timed else [None] * len(times))
