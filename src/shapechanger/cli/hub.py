"""`shapechanger policies push | pull` and `demos push | pull`: the Hugging Face Hub."""

from __future__ import annotations

import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import tyro

from shapechanger import hub
from shapechanger.cli.console import counted, say
from shapechanger.demos.episodes import Episode, episodes_of, read_episode
from shapechanger.demos.episodes.files import FRAMES, HEADER, STEPS
from shapechanger.demos.exchange.files import new_folder
from shapechanger.errors import HubError, StudyError
from shapechanger.files import require_file, write_atomic
from shapechanger.layout import Layout
from shapechanger.policy import kind_of, load_policy
from shapechanger.reports.numbers import duration_text, shares_text

_MAX_POLICY_BYTES: Final = 256 << 20  # As for the files of policies.
_GIB: Final = 1 << 30
_MOST_HASHES: Final = 50
_Repo = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="REPO")]


@dataclass(frozen=True)
class PushPolicy:
    """Upload a policy to the Hugging Face Hub, with a card that describes it."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """A policy, or a clone."""
    repo: _Repo
    """Name of the repository, such as ada/ant; it is made if it does not exist."""
    public: bool = False
    """Let everybody read a new repository; it is private, if not given."""

    def run(self) -> None:
        """Check the policy, upload it, and print its address."""
        card = _policy_card(self.file, self.repo)
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / hub.POLICY).symlink_to(self.file.resolve())
            address = hub.push(Path(folder), card, self.repo, "policy", public=self.public)
        say(f"pushed {self.file} to {address}")


@dataclass(frozen=True)
class PullPolicy:
    """Download a policy from the Hugging Face Hub; nothing else of the repository is read."""

    repo: _Repo
    """Name of a repository that `policies push` has filled, such as ada/ant."""
    out: Path
    """The file to write, such as ant.safetensors; it must not exist yet."""
    revision: str = ""
    """Commit, branch or tag; the newest commit if not given."""

    def run(self) -> None:
        """Download the policy, check it, and print its revision."""
        if self.out.exists():
            raise HubError(f"{self.out} exists already: choose another name, or move it away.")
        with tempfile.TemporaryDirectory() as folder:
            commit = hub.pull(
                self.repo,
                "policy",
                Path(folder),
                revision=self.revision,
                max_bytes=_MAX_POLICY_BYTES,
            )
            path = Path(folder) / hub.POLICY
            try:
                described = _described_policy(path)
            except StudyError as error:
                raise HubError(
                    str(error).replace(str(path), f"{path.name} of {self.repo}")
                ) from error
            require_file(self.out)
            write_atomic(self.out, path.read_bytes())
        say(f"wrote {self.out}: {described['env']}, revision {commit}")


@dataclass(frozen=True)
class PushDemonstrations:
    """Upload a recording to the Hugging Face Hub, with a card that describes it."""

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """A recording, or one episode of it."""
    repo: _Repo
    """Name of the repository, such as ada/drive; it is made if it does not exist."""
    public: bool = False
    """Let everybody read a new repository; it is private, if not given."""

    def run(self) -> None:
        """Check the episodes, upload them, and print their address."""
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
class PullDemonstrations:
    """Download a recording from the Hugging Face Hub; nothing else of the repository is read."""

    repo: _Repo
    """Name of a repository that `demos push` has filled, such as ada/drive."""
    out: Path
    """The recording to make; it must not exist yet."""
    revision: str = ""
    """Commit, branch or tag; the newest commit if not given."""
    max_gib: float = 16.0
    """Largest recording to download, GiB."""

    def run(self) -> None:
        """Download and check the episodes, and print their revision."""
        if not 0.0 < self.max_gib < float("inf"):
            raise HubError(f"--max-gib is more than 0, got {self.max_gib}.")
        with (
            new_folder(self.out) as folder,
            tempfile.TemporaryDirectory(dir=folder) as place,
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


def _described_policy(file: Path) -> dict[str, Any]:
    """Load a policy, which checks its hash, and return its card."""
    card = load_policy(file).card
    if kind_of(file) == "clone":
        return {
            "env": card.data.get("env", "recorded"),
            "learner": "cloning",
            "steps": card.steps,
            "seed": ", ".join(map(str, card.seeds)),
            "version": card.version,
            "command": card.command,
            "observation": _features(card.state_layout, f"picture ({card.eyes})"),
            "action": _features(card.action_layout, "steering, throttle"),
        }
    return {
        "env": card.env,
        "learner": card.learner,
        "steps": card.steps,
        "seed": card.seed,
        "version": card.version,
        "command": card.command,
        "observation": _features(card.observation),
        "action": _features(card.action),
    }


def _features(layout: Layout | None, more: str = "") -> str:
    """Return the features of a layout with their units, in Markdown; `more` stands in for none."""
    if layout is None:
        return more
    return f"{layout.size} numbers: " + ", ".join(f"`{feature}`" for feature in layout)


def _policy_card(file: Path, repo: str) -> str:
    """Return the README of a policy."""
    about = _described_policy(file)
    rows = {name: about[name] for name in ("env", "learner", "steps", "seed", "version")}
    rows["SHA-256"] = hub.sha256_of(file)
    return _card(
        repo,
        ["reinforcement-learning"],
        f"A policy of Shapechanger for `{about['env']}`.",
        rows,
        {"Observation": about["observation"], "Action": about["action"]},
        str(about["command"]),
        f"shapechanger policies pull {repo} --out policy.safetensors\n"
        "shapechanger policies play policy.safetensors",
    )


def _recording_card(episodes: list[Episode], hashes: dict[str, str], repo: str) -> str:
    """Return the README of a recording."""
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
    state = Layout.from_json(header.state_layout) if header.state_layout else None
    action = Layout.from_json(header.action_layout)
    return _card(
        repo,
        ["demonstrations"],
        "Demonstrations, recorded with Shapechanger.",
        rows,
        {"State": _features(state, "none"), "Action": _features(action)},
        header.source,
        f"shapechanger demos pull {repo} --out data",
    )


def _card(
    repo: str,
    tags: list[str],
    lead: str,
    rows: dict[str, object],
    layouts: dict[str, str],
    command: str,
    usage: str,
) -> str:
    """Return a README of the Hub, whose head is YAML."""
    table = "\n".join(f"| {name} | {_cell(value)} |" for name, value in rows.items())
    parts = [
        "---\nlibrary_name: shapechanger\ntags:\n"
        + "".join(f"- {tag}\n" for tag in ("shapechanger", "robotics", *tags))
        + "---",
        f"# {repo}",
        lead,
        f"| | |\n| --- | --- |\n{table}",
    ]
    parts += [f"**{name}**: {features}" for name, features in layouts.items()]
    if command:
        indented = "\n".join(f"    {line}" for line in command.splitlines())
        parts.append(f"Made by\n\n{indented}")
    indented = "\n".join(f"    {line}" for line in usage.splitlines())
    parts.append(f"Use it\n\n{indented}")
    return "\n\n".join(parts) + "\n"


def _cell(value: object) -> str:
    """Return a value as a cell of a Markdown table."""
    return " ".join(str(value).replace("|", "\\|").split())
