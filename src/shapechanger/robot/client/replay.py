"""Replay of an episode on a robot, with a person at the terminal who arms and stops it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

from shapechanger.demos.episodes import Episode
from shapechanger.demos.statistics import gaps_s, is_same_rate, rate_jitter
from shapechanger.errors import DemosError, LinkError, RobotRefused
from shapechanger.layout import Layout
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.known_robots import recall
from shapechanger.robot.client.teleop import Terminal
from shapechanger.robot.link.messages import Welcome

_LOOK_S: Final = 0.5


def play_on_robot(episode: Episode, name: str, say: Callable[[str], None]) -> None:
    """Replay an episode on a robot after a person at this terminal has armed it.

    The robot's caps, reflexes and deadline apply as usual. Any key stops it, and so does any error.
    """
    known = recall(name)
    with (
        Terminal() as terminal,
        RobotClient.connect(known, role="person", frames=False) as robot,
    ):
        _require_fit(episode, robot.welcome)
        terminal.keys(0.0)  # Keys pressed before this line was shown are no consent.
        say(
            f"{episode.seconds:.1f} s of {episode.path.name}, replayed without looking: "
            f"{robot.welcome.robot} starts from its present place.\n"
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
            f"The time of {welcome.robot} moves only in steps (`serve --clock twin`), so no one "
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
            why = seen.stop_reason or f"{seen.holder or 'no one'} commands it now"
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
