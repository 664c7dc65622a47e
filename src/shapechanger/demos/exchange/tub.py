"""Donkeycar's tubs: the records of a drive, with their pictures.

Version 2 is a folder with `manifest.json`, catalogs and `images/`. The manifest has five lines of
JSON: inputs, types, metadata, more metadata, and an object with `paths` (the catalogs in order),
`current_index`, `max_len` and `deleted_indexes`, which counts records over all catalogs. A catalog
has one JSON object a line; `_timestamp_ms` is Unix time, `_session_id` says which start of the car
it belongs to, and `cam/image_array` names a file in `images/`. Version 1 has a file
`record_N.json` for each record, its picture beside it, perhaps `milliseconds` since the start, and
`meta.json` with inputs, types and perhaps the Unix time of the start.

Source: github.com/autorope/donkeycar, donkeycar/parts/datastore_v2.py and tub_v2.py (`Manifest`,
`ManifestIterator`, `Tub.write_record`) for version 2, parts/datastore.py for version 1, read at
the commits 1e831b81, 38a1c2db and b253cef6.

`user/angle` is -1 at the left and 1 at the right, `user/throttle` 1 forward: as here. In the
`user/mode` "user" a person drives, and `pilot/...` is what a policy wanted. In the other modes
`pilot/...` drives, except that in "local_angle" the throttle is the person's. Other inputs of the
types float, int and boolean become the state; a tub does not say in which unit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from pathlib import Path

from shapechanger.demos.episodes import EpisodeHeader
from shapechanger.demos.exchange.pictures import Pictures, size_of
from shapechanger.demos.exchange.places import cannot_read, inside
from shapechanger.demos.exchange.recorded import Recorded, Row
from shapechanger.demos.exchange.timing import one_rate, rate_hz, require_order, split_at_gaps
from shapechanger.demos.exchange.tub_files import IMAGES, MANIFEST, Record, read_v1, read_v2
from shapechanger.demos.exchange.tub_record import IMAGE, TUB_ACTIONS, state_layout, step_of
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

__all__ = ["read_tub"]

# A drive of a few records says nothing about its rate.
_LONG_ENOUGH = 10


def read_tub(folder: Path) -> Iterator[Recorded]:
    """The episodes of a tub: its sessions, or its drives where it has no sessions.

    Records that are marked as deleted are left out.

    Raises:
        DemosError: If the tub is not whole; the sentence says what to do.
    """
    newer = (folder / MANIFEST).is_file()
    inputs, records = (read_v2 if newer else read_v1)(folder)
    images = folder / IMAGES if newer else folder
    if not records:
        raise DemosError(f"The tub {folder} has no records that are not deleted.")
    state = state_layout(inputs)
    size = _size(images, records[0])
    drives = list(_drives(records, in_order=newer))
    rates = [rate_hz(_times_ns(drive)) for drive in drives]
    long = [n for n, drive in enumerate(drives) if len(_times_ns(drive)) >= _LONG_ENOUGH]
    one_rate(
        [rates[n] for n in long],
        [f"The drive from {drives[n][0].where}" for n in long],
        "put the records of each rate into a tub of their own",
    )
    pictures = Pictures(size)
    for drive, hz in zip(drives, rates, strict=True):
        session = drive[0].session
        header = EpisodeHeader(
            action_layout=TUB_ACTIONS.to_json(),
            state_layout="" if state is None else state.to_json(),
            image_size=size,
            control_hz=hz,
            body="car",
            clock="none",
            source="tub",
            notes={"session": session} if session else {},
        )
        yield Recorded(
            header=header, rows=_rows(images, drive, state, pictures), name=drive[0].where
        )


def _rows(
    images: Path, drive: Sequence[Record], state: Layout | None, pictures: Pictures
) -> Iterator[Row]:
    pictured = IMAGE in drive[0].fields
    for record in drive:
        name = record.fields.get(IMAGE)
        if (name is not None) != pictured:
            raise DemosError(
                f"{record.where} has {'no' if pictured else 'a'} picture ({IMAGE}), and "
                f"{drive[0].where} has {'one' if pictured else 'none'}: delete the records "
                "without one."
            )
        jpeg = pictures.read(inside(images, str(name), record.where)) if pictured else None
        yield Row(step=step_of(record, state), jpeg=jpeg)


def _drives(records: Sequence[Record], *, in_order: bool) -> Iterator[Sequence[Record]]:
    """The records of each episode.

    Args:
        records: All of them, in order.
        in_order: Whether the time must not run backwards. The milliseconds of version 1 begin anew
            with each start of the car, which is a new drive then.
    """
    for session, group in groupby(records, key=lambda record: record.session):
        drive = list(group)
        times_ns = _times_ns(drive)
        if session or not times_ns:
            parts = [slice(0, len(drive))]
        elif in_order:
            parts = split_at_gaps(times_ns) if sorted(times_ns) == times_ns else [slice(None)]
        else:
            starts = [0] + [n + 1 for n, (a, b) in enumerate(pairwise(times_ns)) if b < a]
            parts = [
                slice(first + part.start, first + part.stop)
                for first, last in pairwise([*starts, len(drive)])
                for part in split_at_gaps(times_ns[first:last])
            ]
        for part in parts:
            require_order(
                _times_ns(drive[part]),
                [record.where for record in drive[part]],
                "put the records after that into a tub of their own",
            )
            yield drive[part]


def _times_ns(drive: Sequence[Record]) -> list[int]:
    """When each record was made, ns; nothing if one of them does not say."""
    times = [record.time_ns for record in drive if record.time_ns is not None]
    return times if len(times) == len(drive) else []


def _size(images: Path, record: Record) -> tuple[int, int] | None:
    """Width and height of the first picture; None where there is none."""
    if IMAGE not in record.fields:
        return None
    path = inside(images, str(record.fields[IMAGE]), record.where)
    try:
        return size_of(path.read_bytes(), str(path))
    except OSError as error:
        raise cannot_read(path, error) from error
