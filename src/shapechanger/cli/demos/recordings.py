"""Commands of `shapechanger demos` that show, edit and convert recordings."""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
import tyro
from rich.table import Column, Table

from shapechanger.cli.console import counted, print_table, say
from shapechanger.demos.episodes import (
    Drop,
    Episode,
    EpisodeMark,
    Keep,
    edit,
    episode_at,
    episodes_of,
    merge,
    read_episode,
    repair,
)
from shapechanger.demos.exchange import export_recording, import_recording
from shapechanger.demos.report import distributions, recording_html
from shapechanger.errors import DemosError
from shapechanger.files import require_file, write_atomic
from shapechanger.reports.numbers import duration_text, shares_text

_Data = Annotated[
    Path,
    tyro.conf.Positional,
    tyro.conf.arg(metavar="DATA", help="Folder of the recording, or of one episode."),
]
Change = Literal["cut", "bad", "good", "mark"]


@dataclass(frozen=True)
class DemosShow:
    """List the episodes of a recording and summarise them, or write an HTML page with frames."""

    data: _Data
    out: Path | None = None
    """The page to write, such as page.html; it needs no other file."""

    def run(self) -> None:
        # Each episode, or the reason why it cannot be read.
        found: dict[Path, Episode | DemosError] = {}
        for path in episodes_of(self.data):
            try:
                found[path] = read_episode(path)
            except DemosError as error:
                found[path] = error
        episodes = [one for one in found.values() if isinstance(one, Episode)]
        if self.out is not None:
            require_file(self.out)
        else:
            print_table(_table(found))
        steps = sum(len(one.steps) for one in episodes)
        kept = sum(len(one.kept) for one in episodes)
        length = duration_text(sum(one.seconds for one in episodes))
        say(f"{counted(len(found), 'episode')}: {kept} of {steps} steps count, {length}")
        counts = Counter(step.driver for one in episodes for step in one.kept)
        if counts:
            say(f"driven by {shares_text(dict(counts.most_common()))}")
        outcomes = Counter(one.outcome or "just ended" for one in episodes if one.closed)
        if outcomes:
            ended = ", ".join(f"{outcome} {count}" for outcome, count in outcomes.most_common())
            say(f"ended by: {ended}")
        for numbers in distributions(episodes):
            of = "" if numbers.feature.unit == "1" else f" {numbers.feature.unit}"
            extent = f"{numbers.values.min():.3g} to {numbers.values.max():.3g}{of}"
            say(f"{numbers.feature.name}: {extent}, median {np.median(numbers.values):.3g}")
        broken = [str(one) for one in found.values() if isinstance(one, DemosError)]
        for sentence in broken:
            say(sentence)
        if self.out is not None:
            name = self.data.resolve().name
            write_atomic(self.out, recording_html(name, episodes, broken).encode())
            say(f"wrote {self.out}")


def _table(found: dict[Path, Episode | DemosError]) -> Table:
    table = Table(
        Column("episode", overflow="fold"),  # A truncated name could not be typed.
        *("of", "when (UTC)", "steps", "length", "drivers", "marks", "outcome"),
        box=None,
        pad_edge=False,
    )
    for path, one in found.items():
        if isinstance(one, DemosError):
            table.add_row(path.name, *[""] * 6, "cannot be read, see below")
            continue
        n, kept = len(one.steps), len(one.kept)
        table.add_row(
            path.name,
            one.origin,
            one.header.created[:16].replace("T", " "),
            str(n) if kept == n else f"{kept} of {n}",
            duration_text(one.seconds),
            shares_text(one.drivers),
            str(len(one.marks) or ""),
            one.outcome if one.closed else "not closed",
        )
    return table


@dataclass(frozen=True)
class DemosEdit:
    """Drop, restore or mark steps of an episode; no data is deleted."""

    change: Annotated[Change, tyro.conf.Positional]
    """cut drops the steps outside the range; bad drops the range, good restores it; mark marks the
    step of --from."""
    episode: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EPISODE")]
    """Folder of the episode."""
    first: Annotated[int | None, tyro.conf.arg(name="from", metavar="STEP")] = None
    """The first step of the range; the episode's first step if not given."""
    last: Annotated[int | None, tyro.conf.arg(name="to", metavar="STEP")] = None
    """The last step of the range; the episode's last step if not given."""
    text: str = ""
    """With mark: a few words."""

    def run(self) -> None:
        episode = episode_at(self.episode)
        if self.change == "mark":
            if self.first is None or self.last is not None:
                raise DemosError("A mark is at one step: give its number as --from, without --to.")
            edit(episode.path, EpisodeMark(self.first, self.text))
            say(f"marked step {self.first} of {episode.path}")
            return
        if self.text:
            raise DemosError(f"--text is for mark, not for {self.change}.")
        least, most = episode.steps[0].index, episode.steps[-1].index
        first = least if self.first is None else self.first
        last = most if self.last is None else self.last
        if not least <= first <= last <= most:
            raise DemosError(
                f"{episode.path} has the steps {least} to {most}, and not {first} to {last}."
            )
        if self.change == "good":
            edit(episode.path, Keep(first, last))
        else:
            outside = [(least, first - 1), (last + 1, most)]
            for start, end in outside if self.change == "cut" else [(first, last)]:
                if start <= end:
                    edit(episode.path, Drop(start, end, self.change))
        changed = read_episode(episode.path)
        count, seconds = len(changed.kept), changed.seconds
        say(f"{count} of {len(changed.steps)} steps of {episode.path} count, {seconds:.1f} s")


@dataclass(frozen=True)
class DemosMerge:
    """Copy the episodes of several recordings into one; no file is overwritten."""

    data: Annotated[
        tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="DATA [DATA ...]")
    ]
    """Folders of the recordings, or of single episodes."""
    out: Path
    """Folder of the recording to copy them to."""

    def run(self) -> None:
        copied = merge(self.data, self.out)
        for source, target in copied:
            if source.name != target.name:
                say(f"{source} became {target.name}: another episode has its name")
        say(f"copied {counted(len(copied), 'episode')} to {self.out}")
        headers = [read_episode(path).header for path in episodes_of(self.out)]
        layouts = {(header.action_layout, header.state_layout) for header in headers}
        if len(layouts) > 1:
            say(
                f"the episodes have {len(layouts)} different layouts, and a policy can learn from "
                "only one: `shapechanger demos show` lists their robots"
            )


@dataclass(frozen=True)
class DemosRepair:
    """Repair a recording after a crash: keep complete steps and move the rest aside."""

    data: _Data

    def run(self) -> None:
        refused: list[DemosError] = []
        for path in episodes_of(self.data):
            try:
                say(f"{path.name}: {repair(path)}")
            except DemosError as error:
                refused.append(error)
        if refused:
            more = f" ({len(refused) - 1} more like it.)" if len(refused) > 1 else ""
            raise DemosError(f"{refused[0]}{more}")


PARTLY_IMPORTED: Final = 3
"""Exit code of an import that left something out."""


@dataclass(frozen=True)
class DemosImport:
    """Import a recording from another format, leaving the source unchanged.

    Complete parts are imported, and the rest is listed. The exit code is 0 if all was imported, 3
    if parts were left out, and 2 if no part could be imported.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FROM")]
    """The folder to read."""
    out: Path
    """The recording to make; it must not exist yet."""
    format: str = "auto"
    """Format of the folder: tub, minari, lerobot, csv or an installed one; auto detects it."""
    camera: str = ""
    """Camera to import from a LeRobot dataset or a tub with several cameras, such as front."""
    hz: float | None = None
    """Steps per second, if the source does not state them; by default measured from its times, or
    20 if it has none."""
    strict: bool = False
    """Refuse a source that is incomplete or contradicts itself, instead of importing the rest."""

    def run(self) -> None:
        """Import and print a summary; exit with 3 if something was left out."""
        done = import_recording(
            self.source, self.out, self.format, camera=self.camera, hz=self.hz, strict=self.strict
        )
        say(
            f"read {self.source} ({done.format}): {counted(done.episodes, 'episode')}, "
            f"{counted(done.steps, 'step')}, {counted(done.pictures, 'image')}\nwrote {self.out}"
        )
        for kind, text in done.findings:
            say(f"{kind}: {text}", stderr=kind != "note")
        if any(kind == "left out" for kind, _ in done.findings):
            sys.exit(PARTLY_IMPORTED)


@dataclass(frozen=True)
class DemosExport:
    """Export a recording to another format, leaving the recording unchanged."""

    data: _Data
    out: Path
    """The folder to make; it must not exist yet. For minari, its name must end with a version, such
    as drive-v0."""
    to: str
    """Format to write: minari, lerobot, csv, mcap, tub or an installed one."""
    dropped: bool = False
    """Write dropped steps too, marked as dropped; minari, csv and mcap only."""
    task: str = ""
    """Description of the task, for policies that follow language; lerobot only."""
    images: bool = False
    """Store images as they were recorded, instead of video; lerobot only."""

    def run(self) -> None:
        done = export_recording(
            self.data, self.out, self.to, dropped=self.dropped, task=self.task, images=self.images
        )
        say(
            f"wrote {self.out} ({done.format}): {counted(done.steps, 'step')} of "
            f"{counted(done.episodes, 'episode')}"
        )
        for kind, text in done.findings:
            say(f"{kind}: {text}")
        if done.format == "lerobot":
            say(f"load it with LeRobotDataset({self.out.name!r}, root={str(self.out)!r})")
        if done.format == "minari":
            say(
                f"load it with MINARI_DATASETS_PATH={self.out.absolute().parent} and "
                f"minari.load_dataset({self.out.name!r})"
            )
