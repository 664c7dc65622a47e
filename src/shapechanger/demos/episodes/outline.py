"""Outlines of episodes, for lists: fast, and tolerant of damage."""

from __future__ import annotations

import contextlib
import math
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import msgspec
from msgspec import Meta

from shapechanger.demos.episodes.files import STEPS
from shapechanger.demos.episodes.reader import read_header
from shapechanger.demos.episodes.records import EpisodeHeader, durations_s
from shapechanger.errors import DemosError, translate_errors


class _LineHead(msgspec.Struct, frozen=True):
    """The part of a line that a list of episodes needs; an hour of steps has 72 000 lines."""

    kind: str
    step: int = -1
    first: int = 0
    last: int = -1
    captured_ns: int | None = None
    decided_ns: int | None = None
    # File, size and checksum. Such a name never leads to another folder.
    frame: tuple[Annotated[str, Meta(pattern=r"^[0-9]{6,}\.jpg\Z")], Any, Any] | None = None


_HEADS: Final = msgspec.json.Decoder(_LineHead)


class Outline(NamedTuple):
    """Summary of an episode, which may be incomplete or damaged.

    Attributes:
        header: Its metadata.
        steps: Number of complete steps.
        kept: Number of those that were not excluded.
        seconds: Duration of the kept steps, s.
        closed: Whether the episode was closed properly.
        outcome: How it ended; "" if unspecified.
    """

    header: EpisodeHeader
    steps: int
    kept: int
    seconds: float
    closed: bool
    outcome: str


def read_outline(path: Path) -> Outline:
    """Summarise an episode quickly; lines that are incomplete or damaged are left out.

    Raises:
        DemosError: If the header is missing or cannot be read.
        OSError: If the steps cannot be read.
    """
    header, closed = read_header(path)
    steps: dict[int, int | None] = {}
    edits: list[_LineHead] = []
    with (path / STEPS).open("rb") as lines:
        for raw in lines:
            with contextlib.suppress(msgspec.MsgspecError, UnicodeDecodeError):
                head = _HEADS.decode(raw)
                if head.kind == "step" and raw.endswith(b"\n"):
                    is_timed = head.captured_ns is not None
                    steps[head.step] = head.captured_ns if is_timed else head.decided_ns
                elif head.kind in {"drop", "keep"}:
                    edits.append(head)
    dropped: set[int] = set()
    for edit in edits:
        # Only existing steps, whatever range the line names.
        reach = {index for index in steps if edit.first <= index <= edit.last}
        (dropped.difference_update if edit.kind == "keep" else dropped.update)(reach)
    lasted = zip(steps, durations_s([*steps.values()], header.control_hz), strict=True)
    return Outline(
        header=header,
        steps=len(steps),
        kept=len(steps) - len(dropped),
        seconds=math.fsum(seconds for index, seconds in lasted if index not in dropped),
        closed=closed is not None,
        outcome="" if closed is None else str(closed.get("outcome", "")),
    )


def frame_of(line: str, where: str) -> str:
    """Return the name of the image in a line of `steps.jsonl`; "" for none.

    Args:
        line: The line.
        where: Name of the line in an error.

    Raises:
        DemosError: If the line is damaged.
    """
    with translate_errors(
        msgspec.MsgspecError, to=lambda error: DemosError(f"{where} is damaged: {error}.")
    ):
        frame = _HEADS.decode(line).frame
    return "" if frame is None else frame[0]
