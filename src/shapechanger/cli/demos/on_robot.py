"""The actions of an episode on a robot, with a person at the terminal who can stop it."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Final

from shapechanger.cli.console import plain_console
from shapechanger.errors import DemosError, LinkError, RobotRefused
from shapechanger.layout import Layout

if TYPE_CHECKING:
    from shapechanger.demos.episodes import Episode
    from shapechanger.link.messages import Welcome
    from shapechanger.remote.client import RobotClient
    from shapechanger.teleop.terminal import Terminal

__all__ = ["play_on_robot"]

_SAME_RATE: Final = 0.01
_LOOK_S: Final = 0.5


def play_on_robot(episode: Episode, name: str) -> None:
    """Play an episode on a robot, once a person at this terminal has armed it.

    The robot's own caps, reflexes and deadline hold as for anybody who drives it. Any key stops it,
    and so does everything that goes wrong.

    Raises:
        DemosError: If the robot moves something else, or at another rate.
        LinkError: If it cannot be reached, or is lost.
        NoTerminal: If there is no terminal for a person to stop it from.
    """
    from shapechanger.remote.client import RobotClient
    from shapechanger.remote.known_robots import recall
    from shapechanger.teleop.terminal import Terminal

    known = recall(name)
    console = plain_console()
    with (
        Terminal() as terminal,
        RobotClient.connect(known, role="person", frames=False) as robot,
    ):
        _require_fit(episode, robot.welcome)
        console.print(
            f"{episode.seconds:.1f} s of {episode.path.name}, blindly: nobody looks where "
            f"{robot.welcome.robot} drives. It begins where it stands now.\n"
            "E arms it and begins · any other key leaves; while it plays, any key stops it.",
            soft_wrap=True,
        )
        if not _agreed(robot, terminal):
            console.print("left; nothing was played")
            return
        try:
            robot.take()
            robot.arm()
            ended = _play(robot, terminal, episode)
        finally:
            if robot.alive:
                robot.disarm()
                robot.release()
        console.print(ended, soft_wrap=True)


def _require_fit(episode: Episode, welcome: Welcome) -> None:
    """Refuse a robot that would do something else than was recorded.

    Raises:
        DemosError: If it moves other things, in other units or ranges, or at another rate.
    """
    recorded = Layout.from_json(episode.header.action_layout)
    moved = Layout.from_json(welcome.action_layout)
    if [_range(f) for f in recorded] != [_range(f) for f in moved]:
        raise DemosError(
            f"{welcome.robot} takes {_told(moved)}, and {episode.path.name} was recorded with "
            f"{_told(recorded)}."
        )
    rate, own = episode.header.control_hz, welcome.control_hz
    if abs(rate / own - 1.0) > _SAME_RATE:
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
    """Whether the person presses E, and nothing else."""
    while True:
        robot.acknowledge()  # So that the link is not lost while somebody thinks.
        keys = terminal.keys(_LOOK_S)
        if keys:
            return keys == ["e"]


def _play(robot: RobotClient, terminal: Terminal, episode: Episode) -> str:
    """Command step after step until the end or a key; what came of it, in words."""
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
        # What it did then is what the recording shows; it has the caps of then, and gets its own.
        robot.command(step.action if step.applied is None else step.applied, answers=seen.seq)
        try:
            seen = robot.observation(seen.seq).message
        except RobotRefused:
            raise
        except LinkError as error:
            raise LinkError(f"After {number} of {len(steps)} steps: {error}") from error
        # It never hurries to catch up: what is late stays late.
        due_s = max(due_s + period_s, time.monotonic())
    terminal.keys(max(0.0, due_s - time.monotonic()))  # The last command has its period, too.
    return f"played {len(steps)} steps"


def _range(feature: object) -> tuple[object, ...]:
    return tuple(getattr(feature, name) for name in ("name", "unit", "shape", "low", "high"))


def _told(layout: Layout) -> str:
    return ", ".join(f"{f} from {f.low:g} to {f.high:g}" for f in layout)
