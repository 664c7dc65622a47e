"""Records on the robot while something is done with it, and brings it here afterwards."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING, Final

from shapechanger.cli.console import plain_console

if TYPE_CHECKING:
    from shapechanger.link.messages import EpisodeSummary
    from shapechanger.remote.client import RobotClient

__all__ = ["recorded"]

# s. A memory card may take so long for the last steps.
_CLOSED_WITHIN_S: Final = 10.0
_LOOK_EVERY_S: Final = 0.1


@contextlib.contextmanager
def recorded(robot: RobotClient, name: str, data: Path | None) -> Generator[None]:
    """Record on the robot until the end of the block.

    What was recorded stays on the robot, whatever happens here; where the block fails it is said
    how to bring it.

    Args:
        robot: The robot, connected to as a person.
        name: What it is known as here.
        data: Where to bring it; None for not to record.

    Raises:
        RobotRefused: If the robot does not record.
        DemosError: If what came is damaged.
        OutputError: If it cannot be written here.
    """
    if data is None:
        yield
        return
    from shapechanger.cli.robot.fetching import episodes_there, fetch_episode

    before = {episode.id for episode in episodes_there(robot, ())}
    robot.record(on=True)
    try:
        yield
        state = robot.recorder
        if state is not None and state.recording:
            robot.record(on=False)
        console = plain_console()
        for episode in _closed(robot, before):
            fetch_episode(robot, episode.id, data)
            console.print(f"recorded {episode.kept} steps in {data / episode.id}", soft_wrap=True)
    except BaseException:
        plain_console(stderr=True).print(
            f"What was recorded is on the robot: `shapechanger robot fetch {name} --out {data}` "
            "brings it.",
            soft_wrap=True,
        )
        raise


def _closed(robot: RobotClient, before: set[str]) -> list[EpisodeSummary]:
    """The new episodes, once the robot has written their last steps, or does not in time."""
    from shapechanger.cli.robot.fetching import episodes_there

    until_s = time.monotonic() + _CLOSED_WITHIN_S
    while True:
        new = [episode for episode in episodes_there(robot, ()) if episode.id not in before]
        if all(episode.closed for episode in new) or time.monotonic() > until_s:
            return new
        time.sleep(_LOOK_EVERY_S)
