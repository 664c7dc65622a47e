"""Makes an episode whole again after a crash."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from shapechanger.demos.episodes.files import FRAMES, LOST, STEPS, cannot_write, lock, write_header
from shapechanger.demos.episodes.reader import read_header
from shapechanger.demos.episodes.scan import Line, scan

__all__ = ["CUT_OFF", "Repair", "repair"]

CUT_OFF: Final = "cut off"
"""Outcome of an episode that nobody closed."""


@dataclass(frozen=True, slots=True)
class Repair:
    """What was done.

    Attributes:
        kept: How many steps there are.
        lost: Why each line that does not count any more does not, in words.
        pictures: How many pictures belong to no step.
        was_closed: Whether it had been closed.
    """

    kept: int
    lost: tuple[str, ...]
    pictures: int
    was_closed: bool

    @property
    def changed(self) -> bool:
        """Whether anything was wrong."""
        return bool(self.lost or self.pictures or not self.was_closed)


def repair(path: Path) -> Repair:
    """Keep every complete step of an episode, and close it.

    What does not count is not deleted: lines and pictures are moved to the folder `lost`.

    Args:
        path: Folder of the episode.

    Raises:
        DemosError: If it is no episode, or is being recorded now.
        OutputError: If it cannot be written to; it is as it was then.
    """
    header, closed = read_header(path)
    fd = lock(path / STEPS, f"{path} is being recorded at this moment.")
    try:
        lines = scan(path, header, thorough=True)
        good = [line for line in lines if not line.wrong]
        bad = [line for line in lines if line.wrong]
        strays = _strays(path, good)
        try:
            if bad or strays:
                (path / LOST).mkdir(exist_ok=True)
            if bad:
                _move_lines(path, good, bad)
            for stray in strays:
                stray.rename(_free_name(path / LOST, stray.name))
        except OSError as error:
            raise cannot_write(path, error) from error
        kept = sum(line.step is not None for line in good)
        if closed is None:
            ending = {"steps": kept, "outcome": CUT_OFF}
            write_header(path, header.to_json() | {"closed": ending})
    finally:
        os.close(fd)
    return Repair(kept, tuple(line.wrong for line in bad), len(strays), closed is not None)


def _strays(path: Path, good: list[Line]) -> list[Path]:
    """Pictures that no good step names."""
    named = {line.step.frame for line in good if line.step is not None}
    return sorted(p for p in (path / FRAMES).glob("*") if p.name not in named)


def _move_lines(path: Path, good: list[Line], bad: list[Line]) -> None:
    """Leave the good lines only; the bad ones are on the disk before they are taken out."""
    _write(_free_name(path / LOST, STEPS), b"".join(line.raw for line in bad))
    part = path / f".{STEPS}.part"
    _write(part, b"".join(line.raw for line in good))
    part.replace(path / STEPS)


def _write(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _free_name(folder: Path, name: str) -> Path:
    """A name in a folder that nothing has yet."""
    stem, dot, ending = name.partition(".")
    path, number = folder / name, 1
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}{dot}{ending}"
    return path
