"""Writes the layout of 2017: see `keys_2017`."""

from __future__ import annotations

import csv
from collections import defaultdict, deque
from collections.abc import Iterable
from decimal import Decimal
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.exchange.keys_2017 import COLUMNS, KEYS, LABELS, time_ns
from shapechanger.demos.exchange.places import refuse_name
from shapechanger.demos.exchange.recorded import Recorded, seen
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

__all__ = ["write_2017"]

_NS_PER_S: Final = 10**9
_AS_IN_2017: Final = {"header": False, "newline": "\r\n", "numbers": "0.0"}


def write_2017(episodes: Iterable[Recorded], folder: Path) -> int:
    """Write episodes into a folder that is there.

    What was imported from this layout gets the names back that it had.

    Returns:
        How many steps were written.

    Raises:
        DemosError: If an episode is not of four keys, of which at most one is held, or a step has
            no picture or no time.
    """
    lines: list[tuple[str, ...]] = []
    style: dict[str, Any] = dict(_AS_IN_2017)
    for episode in episodes:
        _require_keys(episode)
        style |= _known(episode.header.notes.get("labels"))
        names = _Names(episode.header.notes.get("files"))
        for number, (step, jpeg) in enumerate(seen(episode.rows)):
            where = f"step {number} of {episode.name}"
            if jpeg is None:
                raise DemosError(f"There is no picture at {where}: export it to csv.")
            if step.wall_ns is None:
                raise DemosError(f"Nobody knows when {where} was: export it to minari or csv.")
            if sorted(step.action)[:-1] != [0.0] * 3 or max(step.action) not in {0.0, 1.0}:
                raise DemosError(
                    f"The action at {where} is {list(step.action)}, and in the layout of 2017 at "
                    "most one number is 1 and the others are 0: export it to minari or csv."
                )
            name = names.of(step.wall_ns, len(lines))
            path = folder / name
            if path.exists():
                raise DemosError(f"Two steps belong into one file, {name}: export them to csv.")
            path.write_bytes(jpeg)
            form = "{:.0f}" if style["numbers"] == "0" else "{:.1f}"
            lines.append((name, *(form.format(abs(value)) for value in step.action)))
    with (folder / LABELS).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator=str(style["newline"]))
        if style["header"]:
            writer.writerow(COLUMNS)
        writer.writerows(lines)
    return len(lines)


class _Names:
    """The file names that pictures had, by their times.

    Args:
        files: Names, as the notes of an episode say them; anything else is nobody's name.
    """

    def __init__(self, files: object) -> None:
        self._by_time: defaultdict[int, deque[str]] = defaultdict(deque)
        for name in cast("list[object]", files) if isinstance(files, list) else []:
            if isinstance(name, str) and not refuse_name(name):
                at_ns = time_ns(name)
                if at_ns is not None:
                    self._by_time[at_ns].append(name)

    def of(self, wall_ns: int, number: int) -> str:
        """The name that the picture of this time had, or a new one."""
        if known := self._by_time.get(wall_ns):
            return known.popleft()
        return f"{(Decimal(wall_ns) / _NS_PER_S).normalize():f}_{number:06d}.jpg"


def _known(style: object) -> dict[str, Any]:
    """What the notes of an episode say of how labels are written, as far as it can be."""
    found = cast("dict[str, Any]", style) if isinstance(style, dict) else {}
    allowed = {"header": (True, False), "newline": ("\r\n", "\n"), "numbers": ("0", "0.0")}
    return {key: found[key] for key, values in allowed.items() if found.get(key) in values}


def _require_keys(episode: Recorded) -> None:
    names = Layout.from_json(episode.header.action_layout).names
    if names != KEYS:
        raise DemosError(
            f"The actions of {episode.name} are {', '.join(names)}, and those of the layout of "
            f"2017 {', '.join(KEYS)}: export it to minari or csv."
        )
