"""`shapechanger hub push | pull`: share policies and recordings on the Hugging Face Hub."""

from __future__ import annotations

import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro

from shapechanger import hub
from shapechanger.cli.console import counted, say
from shapechanger.cli.policies import POLICY_FILES, origin_of
from shapechanger.demos.episodes import Episode, episodes_of, read_episode
from shapechanger.demos.episodes.records import FRAMES, HEADER, STEPS
from shapechanger.demos.exchange.files import new_folder
from shapechanger.errors import HubError, PolicyError
from shapechanger.files import require_file, write_atomic
from shapechanger.policy import MAX_BYTES, STEERING, load_policy
from shapechanger.reports.numbers import duration_text, shares_text

_Repo = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="REPO")]
_GIB: Final = 1 << 30
_MOST_HASHES: Final = 50


@dataclass(frozen=True)
class HubPush:
    """Upload a policy or a recording to the Hugging Face Hub, with a card that describes it."""

    path: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="PATH")]
    """The file of a policy or clone, or the folder of a recording or of one episode."""
    repo: _Repo
    """Name of the repository, such as ada/ant; it is made if it does not exist."""
    public: bool = False
    """Make a new repository public; it is private if not given."""

    def run(self) -> None:
        _refuse_onnx(self.path)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            if self.path.suffix in POLICY_FILES:
                card = _policy_card(self.path, self.repo)
                (folder / hub.POLICY).symlink_to(self.path.resolve())
                address = hub.push(folder, card, self.repo, "policy", public=self.public)
                say(f"pushed {self.path} to {address}")
                return
            episodes = [read_episode(path) for path in episodes_of(self.path)]
            hashes: dict[str, str] = {}  # SHA-256 of the steps of each episode.
            for episode in episodes:
                name = f"{hub.EPISODES}/{episode.path.resolve().name}"
                frames = {f"{FRAMES}/{step.frame}" for step in episode.steps if step.frame}
                for file in (HEADER, STEPS, *frames):  # `lost/` is not uploaded.
                    link = folder / name / file
                    link.parent.mkdir(parents=True, exist_ok=True)
                    link.symlink_to((episode.path / file).resolve())
                hashes[f"{name}/{STEPS}"] = hub.sha256_of(episode.path / STEPS)
            card = _recording_card(episodes, hashes, self.repo)
            address = hub.push(folder, card, self.repo, "demonstrations", public=self.public)
            say(f"pushed {counted(len(episodes), 'episode')} of {self.path} to {address}")


@dataclass(frozen=True)
class HubPull:
    """Download a policy or a recording, and no other files, from the Hugging Face Hub."""

    repo: _Repo
    """Name of a repository that `hub push` has filled, such as ada/ant."""
    out: Path
    """For a policy the file to write, which ends in .safetensors; otherwise the recording to make.
    It must not exist yet."""
    revision: str = ""
    """Commit, branch or tag; the newest commit if not given."""
    max_gib: float = 16.0
    """Largest recording to download, GiB."""

    def run(self) -> None:
        if not 0.0 < self.max_gib < float("inf"):
            raise HubError(f"--max-gib must be above 0, got {self.max_gib}.")
        _refuse_onnx(self.out)
        if self.out.suffix in POLICY_FILES:
            self._pull_policy()
        else:
            self._pull_recording()

    def _pull_policy(self) -> None:
        if self.out.exists():
            raise HubError(f"{self.out} exists already: choose another name, or move it away.")
        # After Ctrl-C, a download may still write while the folder is removed.
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            commit = hub.pull(
                self.repo, "policy", Path(folder), revision=self.revision, max_bytes=MAX_BYTES
            )
            path = Path(folder) / hub.POLICY
            try:
                env = origin_of(load_policy(path).card)["env"]
            except PolicyError as error:
                raise HubError(
                    str(error).replace(str(path), f"{path.name} of {self.repo}")
                ) from error
            require_file(self.out)
            write_atomic(self.out, path.read_bytes())
        say(f"wrote {self.out}: {env}, revision {commit}")

    def _pull_recording(self) -> None:
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


def _refuse_onnx(path: Path) -> None:
    if path.suffix == ".onnx":
        raise HubError(
            f"{path} would be ONNX, and a repository holds the .safetensors file of a policy, from "
            "which `shapechanger policies export` writes ONNX."
        )


def _policy_card(file: Path, repo: str) -> str:
    card = load_policy(file).card
    rows: dict[str, object] = {**origin_of(card), "SHA-256": hub.sha256_of(file)}
    seen = "" if card.clone is None else f"image ({card.clone.eyes})"
    return hub.readme(
        repo,
        ["reinforcement-learning"],
        f"A policy of Shapechanger for `{rows['env']}`.",
        rows,
        {
            "Observation": hub.features_text(card.observation, seen),
            "Action": hub.features_text(card.action, ", ".join(STEERING)),
        },
        card.command,
        f"shapechanger hub pull {repo} --out policy.safetensors\n"
        "shapechanger play policy.safetensors",
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
        f"shapechanger hub pull {repo} --out data",
    )
