"""Commands of `shapechanger demos` that list, edit, convert and share recordings."""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import tyro
from rich.table import Column, Table

from shapechanger import hub
from shapechanger.cli.console import counted, print_table, say
from shapechanger.cli.env_arguments import Public, RepoName, Revision
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
from shapechanger.demos.episodes.records import FRAMES, HEADER, STEPS
from shapechanger.demos.exchange import export_recording, import_recording
from shapechanger.demos.exchange.files import new_folder
from shapechanger.demos.report import distributions, recording_html
from shapechanger.errors import DemosError, HubError
from shapechanger.files import require_file, write_atomic
from shapechanger.reports.numbers import duration_text, shares_text

_Data = Annotated[
    Path,
    tyro.conf.Positional,
    tyro.conf.arg(metavar="DATA", help="Folder of the recording, or of one episode."),
]
_Episode = Annotated[
    Path, tyro.conf.Positional, tyro.conf.arg(metavar="EPISODE", help="Folder of the episode.")
]
_From = Annotated[int | None, tyro.conf.arg(name="from", metavar="STEP")]
_To = Annotated[int | None, tyro.conf.arg(name="to", metavar="STEP")]


@dataclass(frozen=True)
class DemosList:
    """List the episodes of a recording."""

    data: _Data

    def run(self) -> None:
        table = Table(
            Column("episode", overflow="fold"),  # A truncated name could not be typed.
            *("of", "when (UTC)", "steps", "length", "drivers", "marks", "outcome"),
            box=None,
            pad_edge=False,
        )
        found = _read_all(self.data)
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
        print_table(table)
        whole = [one for one in found.values() if isinstance(one, Episode)]
        say(_totals(len(found), whole))
        _say_broken(found)


@dataclass(frozen=True)
class DemosShow:
    """Summarise a recording in numbers, or as an HTML page with frames."""

    data: _Data
    out: Path | None = None
    """The page to write, such as page.html; it needs no other file."""

    def run(self) -> None:
        found = _read_all(self.data)
        episodes = [one for one in found.values() if isinstance(one, Episode)]
        if self.out is not None:
            require_file(self.out)
        say(_totals(len(episodes), episodes))
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
        broken = _say_broken(found)
        if self.out is not None:
            name = self.data.resolve().name
            write_atomic(self.out, recording_html(name, episodes, broken).encode())
            say(f"wrote {self.out}")


def _read_all(data: Path) -> dict[Path, Episode | DemosError]:
    """Return each episode of a recording, or why it cannot be read."""
    found: dict[Path, Episode | DemosError] = {}
    for path in episodes_of(data):
        try:
            found[path] = read_episode(path)
        except DemosError as error:
            found[path] = error
    return found


def _say_broken(found: dict[Path, Episode | DemosError]) -> list[str]:
    """Print and return why episodes cannot be read."""
    broken = [str(one) for one in found.values() if isinstance(one, DemosError)]
    for sentence in broken:
        say(sentence)
    return broken


def _totals(count: int, episodes: Sequence[Episode]) -> str:
    steps = sum(len(one.steps) for one in episodes)
    kept = sum(len(one.kept) for one in episodes)
    seconds = sum(one.seconds for one in episodes)
    return f"{counted(count, 'episode')}: {kept} of {steps} steps count, {duration_text(seconds)}"


@dataclass(frozen=True)
class _Steps:
    episode: _Episode
    first: _From = None
    """The first step of the range; the episode's first step if not given."""
    last: _To = None
    """The last step of the range; the episode's last step if not given."""

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


class DemosCut(_Steps):
    """Keep a range of steps of an episode and drop the rest."""

    def run(self) -> None:
        episode, first, last = self._range()
        ends = (episode.steps[0].index, first - 1), (last + 1, episode.steps[-1].index)
        _edit(episode.path, *(Drop(*span, "cut") for span in ends if span[0] <= span[1]))


class DemosBad(_Steps):
    """Drop steps of an episode, or all of them."""

    def run(self) -> None:
        episode, first, last = self._range()
        _edit(episode.path, Drop(first, last, "bad"))


class DemosGood(_Steps):
    """Restore dropped steps of an episode, or all of them."""

    def run(self) -> None:
        episode, first, last = self._range()
        _edit(episode.path, Keep(first, last))


@dataclass(frozen=True)
class DemosMark:
    """Mark a step of an episode."""

    episode: _Episode
    step: Annotated[int, tyro.conf.Positional, tyro.conf.arg(metavar="STEP")]
    """Number of the step."""
    text: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TEXT")] = ""
    """A few words."""

    def run(self) -> None:
        episode = episode_at(self.episode)
        edit(episode.path, EpisodeMark(self.step, self.text))
        say(f"marked step {self.step} of {episode.path}")


def _edit(path: Path, *edits: Drop | Keep) -> None:
    for one in edits:
        edit(path, one)
    episode = read_episode(path)
    count, seconds = len(episode.kept), episode.seconds
    say(f"{count} of {len(episode.steps)} steps of {path} count, {seconds:.1f} s")


@dataclass(frozen=True)
class DemosMerge:
    """Copy the episodes of several recordings into one; nothing is overwritten."""

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
                f"the episodes have {len(layouts)} different layouts; a policy learns from one: "
                "`shapechanger demos list` lists their robots"
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
    if parts were left out, and 2 if nothing could be imported.
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
    """Steps per second, if the format does not state them; computed from its times by default."""
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


_GIB: Final = 1 << 30
_MOST_HASHES: Final = 50


@dataclass(frozen=True)
class DemosPush:
    """Upload a recording to the Hugging Face Hub, with a card that describes it."""

    data: _Data
    repo: RepoName
    """Name of the repository, such as ada/drive; it is made if it does not exist."""
    public: Public = False

    def run(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            episodes = [read_episode(path) for path in episodes_of(self.data)]
            hashes: dict[str, str] = {}
            for episode in episodes:
                name = f"{hub.EPISODES}/{episode.path.resolve().name}"
                frames = {f"{FRAMES}/{step.frame}" for step in episode.steps if step.frame}
                for file in (HEADER, STEPS, *frames):  # Without `lost/`.
                    link = Path(folder) / name / file
                    link.parent.mkdir(parents=True, exist_ok=True)
                    link.symlink_to((episode.path / file).resolve())
                hashes[f"{name}/{STEPS}"] = hub.sha256_of(episode.path / STEPS)
            card = _recording_card(episodes, hashes, self.repo)
            address = hub.push(Path(folder), card, self.repo, "demonstrations", public=self.public)
        say(f"pushed {counted(len(episodes), 'episode')} of {self.data} to {address}")


@dataclass(frozen=True)
class DemosPull:
    """Download a recording from the Hugging Face Hub; nothing else of the repository is read."""

    repo: RepoName
    """Name of a repository that `demos push` has filled, such as ada/drive."""
    out: Path
    """The recording to make; it must not exist yet."""
    revision: Revision = ""
    max_gib: float = 16.0
    """Largest recording to download, GiB."""

    def run(self) -> None:
        if not 0.0 < self.max_gib < float("inf"):
            raise HubError(f"--max-gib must be above 0, got {self.max_gib}.")
        # After Ctrl-C, a download may still write while `place` is removed.
        with (
            new_folder(self.out) as folder,
            tempfile.TemporaryDirectory(dir=folder, ignore_cleanup_errors=True) as place,
        ):
            commit = hub.pull(
                self.repo,
                "demonstrations",
                Path(place),
                revision=self.revision,
                max_bytes=round(self.max_gib * _GIB),
            )
            episodes = [read_episode(path) for path in (Path(place) / hub.EPISODES).iterdir()]
            for episode in episodes:
                episode.path.rename(folder / episode.path.name)
        steps = sum(len(episode.steps) for episode in episodes)
        say(
            f"wrote {self.out}: {counted(len(episodes), 'episode')}, {counted(steps, 'step')}, "
            f"revision {commit}"
        )


def _recording_card(episodes: list[Episode], hashes: dict[str, str], repo: str) -> str:
    header = episodes[0].header
    drivers = Counter(str(step.driver) for one in episodes for step in one.kept)
    size = "none" if header.image_size is None else "{} x {}".format(*header.image_size)
    rows: dict[str, object] = {
        "recorded in": header.env or header.robot or header.body or "unknown",
        "episodes": len(episodes),
        "steps": sum(len(one.steps) for one in episodes),
        "duration": duration_text(sum(one.seconds for one in episodes)),
        "drivers": shares_text(dict(drivers.most_common())),
        "pictures": size,
        "steps per second": f"{header.control_hz:g}",
    }
    shown = list(hashes.items())[:_MOST_HASHES]
    rows |= {f"SHA-256 of {name}": digest for name, digest in shown}
    return hub.readme(
        repo,
        ["demonstrations"],
        "Demonstrations, recorded with Shapechanger.",
        rows,
        {
            "State": hub.features_text(header.state_layout or None, "none"),
            "Action": hub.features_text(header.action_layout),
        },
        header.source,
        f"shapechanger demos pull {repo} --out data",
    )
