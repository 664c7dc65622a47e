"""The way from records to episodes, which all formats share."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.demos.episodes import Step
from shapechanger.demos.exchange import ImportContext
from shapechanger.demos.exchange.drives import SourceRecord, episode_of, stretches
from shapechanger.demos.exchange.exports import kept_steps
from tests.demos.exchange.small import header, picture

GOOD = [picture(n) for n in range(4)]
BAD: list[Any] = [b"", bytes(9), GOOD[0][:99], picture(0, 8, 8), Path("/nowhere.jpg")]


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
    rows = episode_of(iter(records), header(), context, name="x", what="record").rows
    kept = [(int(step.action[1]), jpeg) for step, jpeg in kept_steps(rows)]
    good = [n for n, (data, *fine) in enumerate(shown) if data in GOOD and all(fine)]
    assert kept == [(n, shown[n][0]) for n in good]
    left = [int(name) for names in context.left_out.values() for name in names]
    assert sorted([*left, *good]) == [*range(len(shown))]


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
    assert [record for part in found for record in part.records] == records
    for part in found:
        times = [record.step.captured_ns for record in part.records]
        assert times == (sorted(times) if part.timed else [None] * len(times))
