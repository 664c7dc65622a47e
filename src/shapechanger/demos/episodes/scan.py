"""What is whole in an episode's folder, and what is not."""

from __future__ import annotations

import binascii
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from shapechanger.demos.episodes.files import FRAMES, STEPS
from shapechanger.demos.episodes.header import EpisodeHeader
from shapechanger.demos.episodes.lines import decode_line, split_lines
from shapechanger.demos.episodes.step import Step
from shapechanger.errors import DemosError

__all__ = ["Line", "scan"]

# A name that leads nowhere else.
_FRAME_NAME: Final = re.compile(r"[0-9]{6,}\.jpg")


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the file of steps.

    Attributes:
        raw: Its bytes.
        fields: What it says; nothing if it is not whole.
        step: The step, if it is one.
        wrong: Why it does not count, in words; "" if it does.
    """

    raw: bytes
    fields: dict[str, Any]
    step: Step | None
    wrong: str


def scan(path: Path, header: EpisodeHeader, *, thorough: bool) -> list[Line]:
    """Look at every line, and at the picture that it names.

    Args:
        path: Folder of the episode.
        header: Its header.
        thorough: Whether to read each picture, and not only look at its size.

    Raises:
        DemosError: If the file cannot be read.
    """
    try:
        content = (path / STEPS).read_bytes()
    except OSError as error:
        raise DemosError(f"{path / STEPS} cannot be read: {error.strerror or error}.") from error
    sizes = header.action_size, header.state_size
    lines: list[Line] = []
    seen: dict[tuple[str, int, int], str] = {}
    newest = -1
    for raw in split_lines(content):
        try:
            fields = decode_line(raw)
            step = Step.from_json(fields) if fields.get("kind") == "step" else None
        except ValueError as error:
            lines.append(Line(raw, {}, None, str(error)))
            continue
        wrong = ""
        if step is not None:
            wrong = step.refusal(*sizes)
            if not wrong and step.index <= newest:
                wrong = f"it comes after step {newest}"
            if not wrong and step.frame:
                picture = (step.frame, step.frame_bytes, step.frame_crc)
                if picture not in seen:
                    seen[picture] = _wrong_with(path / FRAMES, step, thorough=thorough)
                wrong = seen[picture]
            newest = max(newest, step.index)
        lines.append(Line(raw, fields, step, wrong))
    return lines


def _wrong_with(frames: Path, step: Step, *, thorough: bool) -> str:
    """What is wrong with the picture of a step, in words; empty for nothing."""
    if not _FRAME_NAME.fullmatch(step.frame):
        return f"its picture is called {step.frame!r}"
    try:
        size = (frames / step.frame).stat().st_size
        if size != step.frame_bytes:
            return f"its picture {step.frame} has {size} bytes in place of {step.frame_bytes}"
        if thorough and binascii.crc32((frames / step.frame).read_bytes()) != step.frame_crc:
            return f"its picture {step.frame} was changed"
    except FileNotFoundError:
        return f"its picture {step.frame} is missing"
    except OSError as error:
        return f"its picture {step.frame} cannot be read ({error.strerror})"
    return ""
