"""`shapechanger demos replay`: replay an episode as a video, in an env or on a robot."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, cast

import numpy as np
import tyro
from numpy.typing import NDArray

from shapechanger.cli.console import say
from shapechanger.cli.demos.recordings import episode_at
from shapechanger.cli.env_arguments import env_ref, opened
from shapechanger.contract.env_ref import EnvRef
from shapechanger.demos.episodes import Episode, Step
from shapechanger.demos.jpeg import blank, decode_picture, overlay
from shapechanger.demos.statistics import gaps_s, is_same_rate, rate_jitter
from shapechanger.errors import DemosError, LinkError, RobotRefused
from shapechanger.layout import Layout
from shapechanger.robot.client.known_robots import recall
from shapechanger.robot.client.teleop import Terminal
from shapechanger.robot.link.messages import Welcome

if TYPE_CHECKING:
    from shapechanger.demos.recording import EncodedObservation
    from shapechanger.robot.client.client import RobotClient


@dataclass(frozen=True)
class Replay:
    """Replay an episode as a video, in an env or on a robot."""

    episode: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EPISODE")]
    """Folder of the episode."""
    film: Path | None = None
    """A film to write, such as out.mp4, with the actions drawn in."""
    env: str = ""
    """Id of an env to play the actions in, from the recorded seed; differences are reported."""
    robot: str = ""
    """Name of a robot to play the actions on, see `robot remember`; a person at this terminal
    arms it, and any key stops it."""

    def run(self) -> None:
        """Replay the episode."""
        asked = [bool(self.film), bool(self.env), bool(self.robot)]
        if sum(asked) != 1:
            raise DemosError("An episode is played with one of --film, --env and --robot.")
        episode = episode_at(self.episode)
        if not episode.kept:
            raise DemosError(f"No step of {episode.path} counts: `shapechanger demos good` it.")
        if self.film is not None:
            film(episode, self.film)
        elif self.env:
            _play_in_env(episode, self.env)
        else:
            _play_on_robot(episode, self.robot)


def _play_in_env(episode: Episode, env_id: str) -> None:
    """Replay an episode in an env from the recorded seed and report differences.

    The applied actions are replayed where they are known, because the frames follow from them; the
    expert's intended actions may differ.
    """
    from shapechanger.demos.recording import ObservationEncoder

    header = episode.header
    kept = episode.kept
    apart = _Apart()
    ref = env_ref(env_id)  # With the recorded arguments if it is the recorded env.
    kwargs = header.env_kwargs if ref.id == header.env else {}
    with opened(EnvRef(ref.id, {**kwargs, **ref.kwargs}), max_episode_steps=-1) as env:
        encoder = ObservationEncoder(env, 95)
        recorded = Layout.from_json(header.action_layout)
        if [(f.name, f.unit, f.shape) for f in encoder.action_layout] != [
            (f.name, f.unit, f.shape) for f in recorded
        ]:
            raise DemosError(
                f"{env_id} moves {', '.join(encoder.action_layout.names)}, and {episode.path.name} "
                f"was recorded with {', '.join(recorded.names)}."
            )
        states = encoder.state_layout
        compares = states is not None and states.to_json() == header.state_layout
        observation, info = env.reset(
            seed=header.seed, options=cast("Any", header.notes.get("reset_options"))
        )
        played, ended = 0, ""
        for step in kept:
            apart.look(episode, step, encoder.encode(observation, info), states=compares)
            values = step.action if step.applied is None else step.applied
            observation, reward, terminated, truncated, info = env.step(
                np.array(values, np.float32)
            )
            played += 1
            apart.earn(step, float(reward))
            if terminated or truncated:
                ended = "; the episode ended there" if played < len(kept) else ""
                break
    say(f"played {played} of {len(kept)} steps in {env_id}{ended}")
    for line in _caveats(episode):
        say(line)
    for line in apart.lines(states if compares else None):
        say(line)


def _caveats(episode: Episode) -> list[str]:
    """Return reasons why a replay cannot be identical."""
    caveats: list[str] = []
    if episode.header.seed is None:
        caveats.append("it was recorded without a seed, so it starts elsewhere")
    kept = episode.kept
    if kept[0].index != 0 or kept[-1].index - kept[0].index != len(kept) - 1:
        caveats.append("dropped steps were not played, so later steps start elsewhere")
    if any(step.applied is None for step in kept):
        caveats.append("applied actions are unknown, so the decided ones were played")
    return caveats


class _Apart:
    """Differences between a replay and its recording."""

    def __init__(self) -> None:
        self._states: list[NDArray[np.float64]] = []
        self._pictures: list[float] = []
        self._rewards: list[tuple[float, float]] = []

    def look(self, episode: Episode, step: Step, seen: EncodedObservation, *, states: bool) -> None:
        """Compare the observation before a step with the recorded one."""
        if states:
            self._states.append(np.abs(np.array(seen.state) - np.array(step.state)))
        jpeg = episode.jpeg(step)
        if jpeg is None or seen.jpeg is None:
            return
        old, new = decode_picture(jpeg, step.frame), decode_picture(seen.jpeg, "the env's picture")
        if old.shape == new.shape:
            self._pictures.append(float(np.abs(old.astype(float) - new).mean()))

    def earn(self, step: Step, reward: float) -> None:
        """Compare the reward of a step with the recorded one."""
        if step.reward is not None:
            self._rewards.append((step.reward, reward))

    def lines(self, layout: Layout | None) -> list[str]:
        """Describe the differences, one per line."""
        lines: list[str] = []
        if self._pictures and not any(self._pictures):
            lines.append("the pictures are the same in every step")
        elif self._pictures:
            lines.append(
                f"pictures differ by {np.mean(self._pictures):.1f} of 255 on average, "
                f"{self._pictures[-1]:.1f} at the end"
            )
        if layout is not None and self._states:
            gaps = np.array(self._states)
            if not np.nanmax(gaps, initial=0.0):
                lines.append("the state is the same in every step")
            for name, place in layout.slices.items():
                of_one = gaps[:, place]
                if np.nanmax(of_one, initial=0.0):
                    lines.append(
                        f"{layout[name]} differs by {np.nanmean(of_one):.3g} on average, "
                        f"{np.nanmax(of_one):.3g} at most"
                    )
        if self._rewards:
            then, now = np.sum(self._rewards, axis=0)
            lines.append(f"return {then:.2f} when recorded, {now:.2f} now")
        return lines or ["nothing to compare"]


_WITHOUT_CAMERA: Final = (480, 40)


def film(episode: Episode, path: Path) -> None:
    """Write the kept steps of an episode as a video.

    Args:
        episode: The episode.
        path: The file.

    Raises:
        OutputError: If it cannot be written.
        DemosError: If a frame is damaged.
        MissingExtra: If the encoder is not installed.
    """
    from shapechanger.cli.pictures import require_film, write_film

    require_film(path)
    layout = Layout.from_json(episode.header.action_layout)
    frames: list[NDArray[Any]] = []
    size = None
    for step in episode.kept:
        jpeg = episode.jpeg(step)
        picture = (
            blank(_WITHOUT_CAMERA)
            if jpeg is None
            else decode_picture(jpeg, f"{episode.path}/frames/{step.frame}")
        )
        frame = overlay(picture, step, layout)
        size = size or frame.shape
        if frame.shape == size:  # A video has one frame size; other frames are skipped.
            frames.append(frame)
    write_film(frames, path, episode.header.control_hz)
    left = len(episode.kept) - len(frames)
    rest = f"; {left} pictures of another size are left out" if left else ""
    say(f"wrote {path}: {len(frames)} steps, {len(frames) / episode.header.control_hz:.1f} s{rest}")


_LOOK_S: Final = 0.5


def _play_on_robot(episode: Episode, name: str) -> None:
    """Replay an episode on a robot after a person at this terminal has armed it.

    The robot's caps, reflexes and deadline apply as usual. Any key stops it, and so does any error.
    """
    from shapechanger.robot.client.client import RobotClient

    known = recall(name)
    with (
        Terminal() as terminal,
        RobotClient.connect(known, role="person", frames=False) as robot,
    ):
        _require_fit(episode, robot.welcome)
        terminal.keys(0.0)  # Keys pressed before this line was shown are no consent.
        say(
            f"{episode.seconds:.1f} s of {episode.path.name}, replayed without looking: "
            f"{robot.welcome.robot} starts from where it stands now.\n"
            "E arms it and starts · any other key cancels; during the replay, any key stops it."
        )
        if not _agreed(robot, terminal):
            say("cancelled; nothing was played")
            return
        try:
            robot.take()
            robot.arm()
            ended = _play(robot, terminal, episode)
        finally:
            if robot.alive:
                robot.disarm()
                robot.release()
        say(ended)


def _require_fit(episode: Episode, welcome: Welcome) -> None:
    """Refuse a robot that does not fit the recording."""
    recorded = Layout.from_json(episode.header.action_layout)
    moved = Layout.from_json(welcome.action_layout)
    if [_range(f) for f in recorded] != [_range(f) for f in moved]:
        raise DemosError(
            f"{welcome.robot} takes {_told(moved)}, and {episode.path.name} was recorded with "
            f"{_told(recorded)}."
        )
    rate, own = episode.header.control_hz, welcome.control_hz
    if not is_same_rate(rate, own, rate_jitter(gaps_s(episode), rate)):
        raise DemosError(
            f"{welcome.robot} takes {own:g} commands a second, and {episode.path.name} has "
            f"{rate:g} steps a second."
        )
    if welcome.clock == "twin":
        raise DemosError(
            f"The time of {welcome.robot} moves only in steps (`serve --clock twin`), so nobody "
            "could stop it in time: serve it with `--clock real`."
        )


def _agreed(robot: RobotClient, terminal: Terminal) -> bool:
    """Return whether the person confirms with E; any other key declines."""
    while True:
        robot.acknowledge()  # Keeps the link alive meanwhile.
        keys = terminal.keys(_LOOK_S)
        if keys:
            return keys == ["e"]


def _play(robot: RobotClient, terminal: Terminal, episode: Episode) -> str:
    """Send step after step until the end or a key press, and describe the outcome."""
    period_s = 1.0 / robot.welcome.control_hz
    steps = episode.kept
    seen = robot.ask().message
    due_s = time.monotonic()
    for number, step in enumerate(steps):
        if terminal.keys(max(0.0, due_s - time.monotonic())):
            robot.emergency_stop("A person pressed a key.")
            return f"stopped by a key after {number} of {len(steps)} steps: emergency stop"
        if not (seen.mine and seen.armed):
            why = seen.stop_reason or f"{seen.holder or 'nobody'} commands it now"
            return f"stopped after {number} of {len(steps)} steps: {why}"
        # The applied actions include the caps at that time; the current caps apply on top.
        robot.command(step.action if step.applied is None else step.applied, answers=seen.seq)
        try:
            seen = robot.observation(seen.seq).message
        except RobotRefused:
            raise
        except LinkError as error:
            raise LinkError(f"After {number} of {len(steps)} steps: {error}") from error
        # Late steps are not caught up.
        due_s = max(due_s + period_s, time.monotonic())
    terminal.keys(max(0.0, due_s - time.monotonic()))  # The last command gets a full period, too.
    return f"played {len(steps)} steps"


def _range(feature: object) -> tuple[object, ...]:
    return tuple(getattr(feature, name) for name in ("name", "unit", "shape", "low", "high"))


def _told(layout: Layout) -> str:
    return ", ".join(f"{f} from {f.low:g} to {f.high:g}" for f in layout)
