"""`shapechanger robot selftest`: shows that a robot stops, on its twin or with its wheels up."""

from __future__ import annotations

import math
import platform
import sys
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.table import Table

from shapechanger.cli.console import plain_console
from shapechanger.errors import RobotError

if TYPE_CHECKING:
    from shapechanger.cli.robot.trial.faults import Fault
    from shapechanger.cli.robot.trial.trial import Trial, TrialResult
    from shapechanger.robot.profile.profile import Profile

__all__ = ["Selftest"]

# How often a trial is made again in which the robot stood before the fault: it says nothing.
_MORE_TRIES = 2
_MARKS = {"good": "good", "bad": "BAD", "unknown": "?"}


@dataclass(frozen=True)
class Selftest:
    """Show that a robot stops: with real faults on its twin, or with its wheels off the ground."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The robot's profile."""
    twin: bool = False
    """Break the twin of this robot in every way, and let the ledger of its pins be the judge."""
    trials: int = 1
    """With --twin: how often each fault is tried."""
    one_shot: bool = True
    """With --twin: whether the one-shot of the enable line is fitted, where the profile has one."""
    wheels_up: bool = False
    """Without --twin: the wheels are off the ground, so do not ask."""
    cap: float = 0.2
    """Without --twin: largest throttle, 0 to 1."""
    jumper: tuple[int, int] | None = None
    """Without --twin: two free BCM pins joined by a wire, an output and an input, to try first."""

    def run(self) -> None:
        """Try it, print what came out, and exit with 1 if something is bad."""
        from shapechanger.robot.profile.load import find_profile, load_profile

        profile = load_profile(find_profile(self.profile))
        # So that what is printed says by itself what it is about.
        plain_console().print(
            f"shapechanger {version('shapechanger')}, {profile.name} ({profile.body}), "
            f"{'twin' if self.twin else 'hardware'}, Python {platform.python_version()}, "
            f"{platform.platform()}",
            soft_wrap=True,
        )
        good = self._on_twin(profile) if self.twin else self._on_hardware(profile)
        if not good:
            sys.exit(1)

    def _on_twin(self, profile: Profile) -> bool:
        from shapechanger.cli.robot.trial.faults import FAULTS
        from shapechanger.cli.robot.trial.trial import Trial, has

        if self.trials < 1:
            raise RobotError(f"At least one trial is needed, got {self.trials}.")
        if not any(action.propels for action in profile.actions):
            raise RobotError(f"Nothing of {profile.name} propels, so there is nothing to stop.")
        console = plain_console()
        table = Table("fault", "at rest after", "promised", "", box=None, pad_edge=False)
        good = True
        with Trial(profile, one_shot=self.one_shot) as trial:
            for fault in FAULTS.values():
                if not has(profile, fault.needs):
                    table.add_row(fault.name, "", "", f"this robot has no {fault.needs}")
                    continue
                with console.status(fault.name):
                    results = [_tried(trial, fault) for _ in range(self.trials)]
                kept = all(result.kept for result in results)
                good = good and kept
                limit = f"{results[0].limit_ms:.0f} ms"
                table.add_row(fault.name, _times(results), limit, "good" if kept else "BAD")
        console.print(table)
        return good

    def _on_hardware(self, profile: Profile) -> bool:
        from shapechanger.cli.robot.checks import check_robot
        from shapechanger.cli.robot.jumper import check_jumper
        from shapechanger.cli.robot.wheels import ask_for_wheels_up
        from shapechanger.twin.running import run_robot

        if not 0.0 < self.cap <= 1.0:
            raise RobotError(f"The cap is above 0 and at most 1, got {self.cap}.")
        console = plain_console()
        if not self.wheels_up:
            ask_for_wheels_up()
        good = True
        if self.jumper is not None:
            sentence = check_jumper(*self.jumper, profile.guard_plan())
            console.print(f"good  jumper: {sentence}")
        with run_robot(profile, twin=False) as robot:
            for check in check_robot(robot, profile, self.cap):
                good = good and check.level != "bad"
                console.print(
                    f"{_MARKS[check.level]:4}  {check.name}: {check.sentence}", soft_wrap=True
                )
        return good


def _tried(trial: Trial, fault: Fault) -> TrialResult:
    """A trial; made again where the robot stood before its fault, as on a busy machine."""
    result = trial.run(fault)
    for _ in range(_MORE_TRIES):
        if result.drove or result.unauthorised:
            break
        result = trial.run(fault)
    return result


def _times(results: list[TrialResult]) -> str:
    """The times of some trials, in words."""
    times = sorted(result.stopped_ms for result in results)
    if not all(result.drove for result in results):
        return "it never drove"
    if math.isinf(times[-1]):
        return "NEVER"
    middle = times[len(times) // 2]
    return f"{middle:.0f} ms, at most {times[-1]:.0f} ms" if len(times) > 1 else f"{middle:.0f} ms"
