"""What the episodes of a folder are, in a line each, read fast enough for a small computer."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes.files import STEPS, is_episode
from shapechanger.demos.episodes.reader import read_header
from shapechanger.errors import DemosError
from shapechanger.link.messages import MAX_EPISODES, EpisodeSummary, Recordings

__all__ = ["EPISODE_ID", "Summaries"]

EPISODE_ID: Final = re.compile(r"[0-9A-Za-z][0-9A-Za-z._-]{0,127}")
"""Names of folders that a client may ask for."""

# As `Step.to_json` begins. Only these are told apart without reading the line as JSON: there are
# 1200 a minute.
_STEP: Final = re.compile(rb'\{"kind":"step","step":(\d{1,15}),')
_MOST_WORDS: Final = 200


class Summaries:
    """The list of the episodes of a folder; what has not changed is read once.

    Args:
        folder: Folder of the recordings.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: dict[str, tuple[tuple[int, ...], EpisodeSummary]] = {}

    def newest(self, before: str) -> Recordings:
        """The newest episodes, newest first.

        Args:
            before: Only those whose id sorts before this one; "" for all.

        Raises:
            OSError: If the folder cannot be read.
        """
        found = sorted(self._ids(), reverse=True)
        self._known = {name: self._known[name] for name in found if name in self._known}
        found = [name for name in found if not before or name < before]
        listed = tuple(self.summary(name) for name in found[:MAX_EPISODES])
        return Recordings(episodes=listed, more=len(found) > MAX_EPISODES)

    def summary(self, name: str) -> EpisodeSummary:
        """One episode."""
        path = self._folder / name
        try:
            stamp = _stamp(path)
            known = self._known.get(name)
            if known is not None and known[0] == stamp:
                return known[1]
            summary = _summary(path)
        except (DemosError, OSError) as error:
            return EpisodeSummary(
                id=name,
                steps=0,
                kept=0,
                seconds=0.0,
                closed=False,
                created="",
                driver="",
                outcome=str(error)[:_MOST_WORDS],
            )
        self._known[name] = stamp, summary
        return summary

    def _ids(self) -> list[str]:
        if not self._folder.exists():
            return []
        return [
            path.name
            for path in self._folder.iterdir()
            if EPISODE_ID.fullmatch(path.name) and not path.is_symlink() and is_episode(path)
        ]


def _stamp(path: Path) -> tuple[int, ...]:
    """What changes when an episode does."""
    numbers: list[int] = []
    for file in (path / STEPS, path / "episode.json"):
        found = file.stat()
        numbers += [found.st_mtime_ns, found.st_size, found.st_ino]
    return tuple(numbers)


def _summary(path: Path) -> EpisodeSummary:
    header, closed = read_header(path)
    steps, dropped = _steps(path / STEPS)
    kept = len(steps) - len(dropped)
    return EpisodeSummary(
        id=path.name,
        steps=len(steps),
        kept=kept,
        seconds=kept / header.control_hz,
        closed=closed is not None,
        created=header.created[:_MOST_WORDS],
        driver=header.driver[:_MOST_WORDS],
        outcome="" if closed is None else str(closed.get("outcome", ""))[:_MOST_WORDS],
    )


def _steps(file: Path) -> tuple[set[int], set[int]]:
    """The indices of all steps, and of those that do not count.

    Raises:
        OSError: If the file cannot be read.
    """
    steps: set[int] = set()
    dropped: set[int] = set()
    said: list[dict[str, Any]] = []
    with file.open("rb") as lines:
        for line in lines:
            step = _STEP.match(line)
            if step is not None and line.endswith(b"\n"):
                steps.add(int(step[1]))
            elif step is None:
                said += _drop(line)
    for drop in said:
        # Not beyond the steps that there are, whatever a line says.
        reach = {index for index in steps if drop["first"] <= index <= drop["last"]}
        (dropped.difference_update if drop["kind"] == "keep" else dropped.update)(reach)
    return steps, dropped


def _drop(line: bytes) -> list[dict[str, Any]]:
    """The line, if it drops steps or keeps them; one that is cut off does not count."""
    try:
        fields = json.loads(line)
    except ValueError:
        return []
    if not isinstance(fields, dict):
        return []
    said = cast("dict[str, Any]", fields)
    numbers = isinstance(said.get("first"), int) and isinstance(said.get("last"), int)
    return [said] if said.get("kind") in ("drop", "keep") and numbers else []
