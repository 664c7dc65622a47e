"""`shapechanger demos list | show | cut | bad | good | mark | merge | repair | import | export`.

Look at recordings, edit them, and convert them from and to other formats.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import tyro
from rich.table import Table

from shapechanger.cli.console import counted, plain_console, say
from shapechanger.demos.episodes import (
    Episode,
    Repair,
    drop,
    episode_at,
    episodes_of,
    keep,
    mark,
    read_episode,
    repair,
)
from shapechanger.demos.exchange import export_recording, formats, import_recording
from shapechanger.demos.merging import merge
from shapechanger.demos.report import distributions, recording_html
from shapechanger.errors import DemosError
from shapechanger.files import require_file, write_atomic
from shapechanger.reports.numbers import duration_text, shares_text

_WIDEST: Final = 400
_MB: Final = 1e6
_Data = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
_Episode = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EPISODE")]
_From = Annotated[int | None, tyro.conf.arg(name="from", metavar="STEP")]
_To = Annotated[int | None, tyro.conf.arg(name="to", metavar="STEP")]


@dataclass(frozen=True)
class ListEpisodes:
    """List the episodes of a recording."""

    data: _Data
    """Folder of the recording, or of one episode."""

    def run(self) -> None:
        """Print a line per episode and the totals."""
        table = Table(
            "episode", "of", "when (UTC)", "steps", "length", "drivers", "marks", "outcome",
            box=None, pad_edge=False,
        )  # fmt: skip
        for name in ("steps", "length", "marks"):
            next(c for c in table.columns if c.header == name).justify = "right"
        broken: list[str] = []
        steps = kept = 0
        seconds = 0.0
        paths = episodes_of(self.data)
        for path in paths:
            try:
                one = read_episode(path)
            except DemosError as error:
                broken.append(str(error))
                table.add_row(path.name, "", "", "", "", "", "", "cannot be read, see below")
                continue
            n, counted_n = len(one.steps), len(one.kept)
            steps, kept, seconds = steps + n, kept + counted_n, seconds + one.seconds
            table.add_row(
                path.name,
                one.origin,
                one.header.created[:16].replace("T", " "),
                str(n) if counted_n == n else f"{counted_n} of {n}",
                duration_text(one.seconds),
                shares_text(one.drivers),
                str(len(one.marks) or ""),
                one.outcome if one.closed else "not closed",
            )
        console = plain_console()
        # Truncated names could not be typed; let the terminal wrap the line.
        needed = console.measure(table, options=console.options.update(width=_WIDEST)).maximum
        plain_console(width=max(console.width, needed)).print(table)
        say(
            f"{counted(len(paths), 'episode')}: {kept} of {steps} steps count, "
            f"{duration_text(seconds)}"
        )
        for sentence in broken:
            say(sentence)


@dataclass(frozen=True)
class ShowEpisodes:
    """Summarise a recording in numbers, or as an HTML page with frames."""

    data: _Data
    """Folder of the recording, or of one episode."""
    out: Path | None = None
    """The page to write, such as page.html; it needs no other file."""

    def run(self) -> None:
        """Print the summary and write the page."""
        episodes: list[Episode] = []
        broken: list[str] = []
        for path in episodes_of(self.data):
            try:
                episodes.append(read_episode(path))
            except DemosError as error:
                broken.append(str(error))
        if self.out is not None:
            require_file(self.out)
        for line in _overview(episodes):
            say(line)
        for found in distributions(episodes):
            of = "" if found.unit == "1" else f" {found.unit}"
            extent = f"{found.values.min():.3g} to {found.values.max():.3g}{of}"
            say(f"{found.name}: {extent}, median {np.median(found.values):.3g}")
        for sentence in broken:
            say(sentence)
        if self.out is None:
            return

        name = self.data.resolve().name
        write_atomic(self.out, recording_html(name, episodes, broken).encode())
        say(f"wrote {self.out}")


def _overview(episodes: Sequence[Episode]) -> list[str]:
    """Describe a recording in a few lines."""
    counts: Counter[str] = Counter(step.driver for one in episodes for step in one.kept)
    seconds = sum(one.seconds for one in episodes)
    many = counted(len(episodes), "episode")
    steps = sum(len(one.steps) for one in episodes)
    kept = sum(len(one.kept) for one in episodes)
    lines = [f"{many}: {kept} of {steps} steps count, {duration_text(seconds)}"]
    if counts:
        lines.append(f"driven by {shares_text(dict(counts.most_common()))}")
    outcomes = Counter(one.outcome or "just ended" for one in episodes if one.closed)
    if outcomes:
        ended = ", ".join(f"{outcome} {count}" for outcome, count in outcomes.most_common())
        lines.append(f"ended by: {ended}")
    return lines


@dataclass(frozen=True)
class _Steps:
    """A range of steps of an episode."""

    episode: _Episode
    """Folder of the episode."""
    first: _From = None
    """The first step; the episode's if not given."""
    last: _To = None
    """The last step; the episode's if not given."""

    def _range(self) -> tuple[Episode, int, int]:
        """Return the episode, and the first and the last step."""
        episode = episode_at(self.episode)
        least, most = episode.steps[0].index, episode.steps[-1].index
        first = least if self.first is None else self.first
        last = most if self.last is None else self.last
        if not least <= first <= last <= most:
            raise DemosError(
                f"{episode.path} has the steps {least} to {most}, and not {first} to {last}."
            )
        return episode, first, last


class CutEpisode(_Steps):
    """Keep a range of steps of an episode and drop the rest."""

    def run(self) -> None:
        """Cut and print what is kept."""
        episode, first, last = self._range()
        least, most = episode.steps[0].index, episode.steps[-1].index
        if first > least:
            drop(episode.path, least, first - 1, "cut")
        if last < most:
            drop(episode.path, last + 1, most, "cut")
        _tell(episode.path)


class Bad(_Steps):
    """Drop steps of an episode, or all of them."""

    def run(self) -> None:
        """Drop the steps and print what is kept."""
        episode, first, last = self._range()
        drop(episode.path, first, last, "bad")
        _tell(episode.path)


class Good(_Steps):
    """Restore dropped steps of an episode, or all of them."""

    def run(self) -> None:
        """Restore the steps and print what is kept."""
        episode, first, last = self._range()
        keep(episode.path, first, last)
        _tell(episode.path)


@dataclass(frozen=True)
class MarkStep:
    """Mark a step of an episode."""

    episode: _Episode
    """Folder of the episode."""
    step: Annotated[int, tyro.conf.Positional, tyro.conf.arg(metavar="STEP")]
    """Number of the step."""
    text: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TEXT")] = ""
    """A few words."""

    def run(self) -> None:
        """Mark the step."""
        episode = episode_at(self.episode)
        mark(episode.path, self.step, self.text)
        say(f"marked step {self.step} of {episode.path}")


def _tell(path: Path) -> None:
    episode = read_episode(path)
    count, seconds = len(episode.kept), episode.seconds
    say(f"{count} of {len(episode.steps)} steps of {path} count, {seconds:.1f} s")


@dataclass(frozen=True)
class Merge:
    """Copy the episodes of several recordings into one; nothing is overwritten."""

    data: Annotated[
        tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="DATA [DATA ...]")
    ]
    """Folders of the recordings, or of single episodes."""
    out: Path
    """Folder of the recording that they come into."""

    def run(self) -> None:
        """Merge and print a summary."""
        done = merge(self.data, self.out)
        for source, target in done.episodes:
            if source.name != target.name:
                say(f"{source} became {target.name}: its name was taken")
        many = counted(len(done.episodes), "episode")
        say(f"copied {many}, {done.bytes_ / _MB:.1f} MB, to {self.out}")
        if done.layouts > 1:
            say(
                f"they have {done.layouts} different layouts, and a policy learns from one: "
                "`shapechanger demos list` lists their robots"
            )


@dataclass(frozen=True)
class RepairEpisodes:
    """Repair a recording after a crash: keep complete steps and move the rest aside."""

    data: _Data
    """Folder of the recording, or of one episode."""

    def run(self) -> None:
        """Repair each episode and print what was done."""
        refused: list[DemosError] = []
        for path in episodes_of(self.data):
            try:
                done = repair(path)
            except DemosError as error:
                refused.append(error)
                continue
            say(f"{path.name}: {_told(done)}")
        if refused:
            more = f" ({len(refused) - 1} more like it.)" if len(refused) > 1 else ""
            raise DemosError(f"{refused[0]}{more}")


def _told(done: Repair) -> str:
    """Describe a repair."""
    if not done.changed:
        return f"was complete, with {done.kept} steps"
    parts = [f"kept {done.kept} steps"]
    if done.lost:
        parts.append(f"moved {counted(len(done.lost), 'line')} aside, because {done.lost[0]}")
        if len(done.lost) > 1:
            parts[-1] += f", and so on ({len(done.lost) - 1} more)"
    if done.pictures:
        parts.append(f"moved {counted(done.pictures, 'image')} of no step aside")
    if not done.was_closed:
        parts.append("closed it")
    return ", ".join(parts)


PARTLY_IMPORTED: Final = 3
"""Exit code of an import that left something out."""


@dataclass(frozen=True)
class Import:
    """Import a recording from another format, leaving the source unchanged.

    What is whole is imported, and the rest is listed. The exit code is 0 if all was imported, 3 if
    something was left out, and 2 if nothing could be imported.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FROM")]
    """The folder to read."""
    out: Path
    """The recording to make; it must not exist yet."""
    format: str = "auto"
    """Format of the folder: tub, minari, lerobot, csv or an installed one; auto detects it."""
    camera: str = ""
    """Which camera to take from a LeRobot dataset or a tub that has several, such as front."""
    hz: float | None = None
    """Steps per second, for formats that do not state them; otherwise measured from their times."""
    strict: bool = False
    """Refuse a source that is incomplete or contradicts itself, instead of importing the rest."""

    def run(self) -> None:
        """Import and print a summary; exit with 3 if something was left out."""
        done = import_recording(
            self.source,
            self.out,
            self.format,
            camera=self.camera,
            hz=self.hz,
            strict=self.strict,
        )
        say(
            f"read {self.source} ({done.format}): {counted(done.episodes, 'episode')}, "
            f"{counted(done.steps, 'step')}, {counted(done.pictures, 'image')}\nwrote {self.out}"
        )
        for note in done.notes:
            say(f"note: {note}")
        for warning in done.warnings:
            say(f"warning: {warning}", stderr=True)
        for line in done.left_out:
            say(f"left out {line}", stderr=True)
        if done.left_out:
            sys.exit(PARTLY_IMPORTED)


@dataclass(frozen=True)
class Export:
    """Export a recording to another format, leaving the recording unchanged."""

    data: _Data
    """A recording, or one episode of it."""
    out: Path
    """The folder to make; it must not exist yet. For minari its name ends in a version, such as
    drive-v0."""
    to: str
    """Format to write: minari, lerobot, csv, mcap, tub or an installed one."""
    dropped: bool = False
    """Write dropped steps too, marked as such; only minari, csv and mcap can."""
    task: str = ""
    """What the robot does, in words, for policies that follow language; lerobot only."""
    images: bool = False
    """Store images as they were recorded, instead of video; lerobot only."""

    def run(self) -> None:
        """Export and print a summary."""
        done = export_recording(
            self.data, self.out, self.to, dropped=self.dropped, task=self.task, images=self.images
        )
        say(
            f"wrote {self.out} ({done.format}): {counted(done.steps, 'step')} of "
            f"{counted(done.episodes, 'episode')}"
        )
        if done.left_out:
            marks = "dropped" in formats()[done.format].options
            where = "; --dropped includes them" if marks else ""
            say(f"left out {done.left_out} dropped steps{where}")
        for note in done.notes:
            say(f"note: {note}")
        if done.format == "lerobot":
            say(f"load it with LeRobotDataset({self.out.name!r}, root={str(self.out)!r})")
        if done.format == "minari":
            say(
                f"load it with MINARI_DATASETS_PATH={self.out.absolute().parent} and "
                f"minari.load_dataset({self.out.name!r})"
            )
