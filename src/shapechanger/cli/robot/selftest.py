"""`shapechanger robot selftest`: prove that a robot stops, on its twin or with its wheels up."""

from __future__ import annotations

import math
import platform
import sys
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.table import Table

from shapechanger.cli.console import plain_console, say
from shapechanger.cli.robot.calibrate import ask_for_wheels_up
from shapechanger.cli.robot.checks import check_jumper, check_robot
from shapechanger.cli.robot.setup import require_pins
from shapechanger.errors import RobotError
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile

if TYPE_CHECKING:
    from shapechanger.cli.robot.faults import Fault
    from shapechanger.cli.robot.trial import Trial, TrialResult

# Retries of a trial in which the robot was not moving before the fault.
_MORE_TRIES = 2
_MARKS = {"good": "good", "bad": "BAD", "unknown": "?"}


@dataclass(frozen=True)
class Selftest:
    """Prove that a robot stops, with faults on its twin or with its wheels off the ground."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The robot's profile."""
    twin: bool = False
    """Inject every fault into the robot's twin, and judge by the ledger of its pins."""
    trials: int = 1
    """With --twin: trials of each fault."""
    one_shot: bool = True
    """With --twin: whether the one-shot of the enable line is fitted, where the profile has one."""
    wheels_up: bool = False
    """Without --twin: the wheels are off the ground, so do not ask."""
    cap: float = 0.2
    """Without --twin: largest throttle, 0 to 1."""
    jumper: tuple[int, int] | None = None
    """Without --twin: two free BCM pins joined by a wire, an output and an input, to try first."""
    leds: bool = False
    """Test a bench of one Pi with LEDs in place of motors, light each of them, and write a report
    to send."""
    yes: bool = False
    """With --leds: no motor is connected, and nobody is there to answer, so ask nothing."""
    probe: int | None = None
    """With --leds: a free BCM pin, joined by a wire to the pin of the motor that drives forward,
    which measures when it stops."""
    report: Path | None = None
    """With --leds: file of the report; leds-report.txt if not given."""

    def run(self) -> None:
        """Run the tests, print the results, and exit with 1 on a failure."""
        profile = load_profile(find_profile(self.profile))
        self._refuse_contradictions()
        # Makes the output self-contained.
        say(
            f"shapechanger {version('shapechanger')}, {profile.name} ({profile.body}), "
            f"{'twin' if self.twin else 'hardware'}, Python {platform.python_version()}, "
            f"{platform.platform()}"
        )
        if self.leds:
            good = self._on_leds(profile)
        else:
            good = self._on_twin(profile) if self.twin else self._on_hardware(profile)
        if not good:
            sys.exit(1)

    def _refuse_contradictions(self) -> None:
        """Refuse options that would have no effect, and numbers that mean nothing."""
        on_twin = self.twin and not self.leds
        on_hardware = not (self.twin or self.leds)
        for option, given, needs, has in (
            ("--yes", self.yes, "needs --leds", self.leds),
            ("--probe", self.probe is not None, "needs --leds", self.leds),
            ("--report", self.report is not None, "needs --leds", self.leds),
            ("--trials", self.trials != 1, "needs --twin, without --leds", on_twin),
            ("--no-one-shot", not self.one_shot, "needs --twin, without --leds", on_twin),
            (
                "--jumper",
                self.jumper is not None,
                "goes with neither --twin nor --leds",
                on_hardware,
            ),
            ("--wheels-up", self.wheels_up, "goes with neither --twin nor --leds", on_hardware),
        ):
            if given and not has:
                raise RobotError(f"{option} {needs}.")
        if not 0.0 < self.cap <= 1.0:
            raise RobotError(f"The cap is above 0 and at most 1, got {self.cap}.")

    def _on_leds(self, profile: Profile) -> bool:
        from shapechanger.cli.robot.leds import Bench, ask_nobody, ask_person
        from shapechanger.cli.robot.leds_report import run_leds

        plan = profile.guard_plan()
        asks = sys.stdin.isatty() and not (self.yes or self.twin)
        ask = ask_person if asks else ask_nobody
        if self.twin and self.probe is not None:
            raise RobotError("A twin needs no --probe: its ledger has every change of a pin.")
        bench = Bench(profile, twin=self.twin, probe=self.probe, ask=ask, cap=self.cap)
        if not self.twin:
            require_pins(plan)
            if not (asks or self.yes):
                raise RobotError(
                    "All outputs will be driven: put LEDs in place of the motors, and say so with "
                    "--yes."
                )
            if asks and not ask_person("All outputs will be driven. Is every motor taken off?"):
                raise RobotError("Nothing was lit.")
        report = self.report or Path("leds-report.txt")
        return run_leds(bench, profile, report, twin=self.twin)

    def _on_twin(self, profile: Profile) -> bool:
        from shapechanger.cli.robot.faults import FAULTS
        from shapechanger.cli.robot.trial import Trial, has

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
        from shapechanger.twin.robot import run_robot

        if not self.wheels_up:
            ask_for_wheels_up()
        good = True
        if self.jumper is not None:
            sentence = check_jumper(*self.jumper, profile.guard_plan())
            say(f"good  jumper: {sentence}")
        with run_robot(profile, twin=False) as robot:
            for check in check_robot(robot, profile, self.cap):
                good = good and check.level != "bad"
                say(f"{_MARKS[check.level]:4}  {check.name}: {check.sentence}")
        return good


def _tried(trial: Trial, fault: Fault) -> TrialResult:
    """Run a trial, and repeat it if the robot was not moving before the fault."""
    result = trial.run(fault)
    for _ in range(_MORE_TRIES):
        if result.drove or result.unauthorised:
            break
        result = trial.run(fault)
    return result


def _times(results: list[TrialResult]) -> str:
    """Summarise the stopping times of some trials."""
    times = sorted(result.stopped_ms for result in results)
    if not all(result.drove for result in results):
        return "it never drove"
    if math.isinf(times[-1]):
        return "NEVER"
    middle = times[len(times) // 2]
    return f"{middle:.0f} ms, at most {times[-1]:.0f} ms" if len(times) > 1 else f"{middle:.0f} ms"
