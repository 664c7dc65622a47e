"""Reads what `minari_out` wrote, so that nothing has changed: see `minari_files`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes import DRIVERS, EpisodeHeader, Step
from shapechanger.demos.exchange import minari_files as files
from shapechanger.demos.exchange.hdf5_file import column, open_hdf5
from shapechanger.demos.exchange.pictures import Pictures
from shapechanger.demos.exchange.recorded import Recorded, Row
from shapechanger.errors import DemosError, UnknownName

__all__ = ["read_own"]

_CHUNK: Final = 256  # Steps that are in memory at once.
_ALWAYS: Final = (
    "actions",
    "rewards",
    "terminations",
    "truncations",
    "infos/rewarded",
    "infos/applied",
    "infos/has_applied",
    "infos/wanted",
    "infos/has_wanted",
    *(f"infos/{name}" for name in files.TIMES),
    "infos/driver",
    "infos/stop_reason",
    "infos/more",
)


def read_own(main: Path, said: object, count: int) -> Iterator[Recorded]:
    """The episodes of a dataset.

    Args:
        main: The HDF5 file.
        said: What `metadata.json` says of the headers.
        count: How many episodes there are.

    Raises:
        DemosError: If something in it is not whole.
    """
    fields = cast("dict[str, Any]", said) if isinstance(said, dict) else {}
    headers = fields.get("episodes")
    if fields.get("format") != files.HEADERS_FORMAT or not isinstance(headers, list):
        raise DemosError(
            f"{main.with_name(files.METADATA)} was written by another version of Shapechanger: "
            f"this one reads format {files.HEADERS_FORMAT}."
        )
    plain = cast("list[dict[str, Any]]", headers)
    if len(plain) != count:
        raise DemosError(
            f"{main.with_name(files.METADATA)} has the headers of {len(plain)} episodes, and says "
            f"that there are {count}."
        )
    for number, header in enumerate(plain):
        where = f"{main.with_name(files.METADATA)}, episode {number}"
        try:
            known = EpisodeHeader.from_json(header)
        except DemosError as error:
            raise DemosError(f"{where}: {error}") from error
        yield Recorded(
            header=known,
            rows=_rows(main, f"episode_{number}", known),
            name=where,
            outcome=str(header.get("outcome", "")),
        )


def _rows(main: Path, group: str, header: EpisodeHeader) -> Iterator[Row]:
    pictures = Pictures(header.image_size)
    frame = -1
    with open_hdf5(main) as file:
        steps = int(column(file, f"{group}/rewards", main).shape[0])
        names = dict.fromkeys(_ALWAYS, "") | _observed(file, group, header)
        columns = {
            name: column(file, f"{group}/{place or name}", main, steps)
            for name, place in names.items()
        }
        cut_off = bool(column(file, f"{group}/infos/cut_off", main, 1)[0])
        for start in range(0, steps, _CHUNK):
            chunk = {name: values[start : start + _CHUNK] for name, values in columns.items()}
            for place in range(min(_CHUNK, steps - start)):
                at = {name: values[place] for name, values in chunk.items()}
                where = f"{main}, step {start + place} of {group}"
                step, marks, dropped = _step(at, where)
                if cut_off and start + place == steps - 1:
                    step = replace(step, truncated=False)
                jpeg = None
                if "infos/frame" in at and int(at["infos/frame"]) != frame:
                    frame = int(at["infos/frame"])
                    jpeg = bytes(at[files.JPEG])
                    pictures.check(jpeg, f"of {where}")
                yield Row(step=step, jpeg=jpeg, marks=marks, dropped=dropped)


def _observed(file: Any, group: str, header: EpisodeHeader) -> dict[str, str]:
    """The places of picture and state."""
    pictured = f"{group}/infos/frame" in file
    state = bool(header.state_layout)
    places: dict[str, str] = {}
    if state:
        places[files.STATE] = f"observations/{files.STATE}" if pictured else "observations"
    if pictured:
        beside = f"infos/{files.JPEG}"
        inside = f"observations/{files.IMAGE}" if state else "observations"
        places |= {
            files.JPEG: beside if f"{group}/{beside}" in file else inside,
            "infos/frame": "infos/frame",
        }
    return places


def _step(at: dict[str, Any], where: str) -> tuple[Step, tuple[str, ...], str | None]:
    """A step, its marks, and why it does not count."""
    try:
        more = json.loads(at["infos/more"])
        driver = at["infos/driver"].decode()
        times = {name: int(at[f"infos/{name}"]) for name in files.TIMES}
        step = Step(
            action=_vector(at["actions"]),
            driver=driver,
            applied=_vector(at["infos/applied"]) if at["infos/has_applied"] else None,
            wanted=_vector(at["infos/wanted"]) if at["infos/has_wanted"] else None,
            state=_vector(at[files.STATE]) if files.STATE in at else (),
            captured_ns=_known(times["captured_ns"]),
            decided_ns=_known(times["decided_ns"]),
            wall_ns=_known(times["wall_ns"]),
            reward=float(at["rewards"]) if at["infos/rewarded"] else None,
            terms={name: float(value) for name, value in more.get("terms", {}).items()},
            terminated=bool(at["terminations"]),
            truncated=bool(at["truncations"]),
            stop_reason=str(more.get("stop_reason", at["infos/stop_reason"].decode())),
        )
        marks = tuple(str(mark) for mark in more.get("marks", ()))
        dropped = more.get("dropped")
    except (ValueError, TypeError, AttributeError, LookupError) as error:
        raise DemosError(f"{where} cannot be read: {error}.") from error
    if driver not in DRIVERS:
        raise DemosError(f"{where}: {UnknownName('driver', driver, DRIVERS)}")
    return step, marks, None if dropped is None else str(dropped)


def _vector(values: Any) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _known(time_ns: int) -> int | None:
    return None if time_ns == files.UNKNOWN_NS else time_ns
