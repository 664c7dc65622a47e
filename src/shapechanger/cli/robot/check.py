"""`shapechanger robot check`: check a robot's wires, and prove that it stops."""

from __future__ import annotations

import platform
import sys
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Final

import tyro
from rich.prompt import Confirm

from shapechanger.cli.console import plain_console, say
from shapechanger.cli.robot.calibrate import ask_for_wheels_up
from shapechanger.cli.robot.setup import require_port
from shapechanger.errors import RobotError
from shapechanger.robot.check.pins import check_jumper, lamps_of, plan_of_pins, require_pins
from shapechanger.robot.check.report import MARKS, facts, write_report
from shapechanger.robot.check.standing import StandingRobot
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.check.trial import Bench, CheckLevel, check_robot, require_level

_PILOT: Final = "shapechanger.vehicles.remote.full_throttle"
_CAP: Final = 0.2
_PORT: Final = 5000


@dataclass(frozen=True)
class RobotCheck:
    """Check a robot's computer and wires, and then, with its wheels off the ground, that it stops.

    The exit code is 1 if any finding is bad.
    """

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The robot's profile."""
    wiring: bool = False
    """Move no output: check the computer, the settings and the wires, and list the pins with their
    positions on the header."""
    leds: bool = False
    """Check a Raspberry Pi with LEDs instead of motors: light each LED, cause faults, and write a
    report."""
    faults: bool = False
    """Inject every fault into the robot's twin, and judge from the recorded levels of its pins."""
    twin: bool = False
    """Check the robot's twin, without any hardware; --faults always uses the twin."""
    port: int = _PORT
    """Port at which the robot will be served."""
    credentials: Path | None = None
    """Folder of the robot's key and certificate; by default the one that `robot init` made."""
    motors_off: bool = False
    """Confirm that the motors' supply is off, to also test the resistors that keep their drivers
    off."""
    wheels_up: bool = False
    """Confirm that the wheels are off the ground, instead of being asked."""
    jumper: tuple[int, int] | None = None
    """Two free BCM pins that a wire joins, to test first: an output and an input."""
    cap: float = _CAP
    """Largest throttle of the checks that drive, 0 to 1; faults are caused at full throttle."""
    yes: bool = False
    """With --leds: confirm that no motor is connected, and ask no questions."""
    probe: int | None = None
    """With --leds: a free BCM pin that a wire joins to the pin of the motor that drives forward, to
    measure when that motor stops."""
    trials: int = 1
    """With --faults: number of trials of each fault."""
    one_shot: bool = True
    """With --faults: simulate the one-shot of the enable line, if the profile has one."""
    report: Path | None = None
    """File of the report; by default leds-report.txt with --leds, and no file otherwise."""

    def run(self) -> None:
        profile = load_profile(find_profile(self.profile))
        level = self._level()
        on_twin = self.twin or self.faults
        # Identify the version and the machine, for a person who reads only the output.
        say(
            f"shapechanger {version('shapechanger')}, {profile.name} ({profile.body}), "
            f"{'twin' if on_twin else 'hardware'}, Python {platform.python_version()}, "
            f"{platform.platform()}"
        )

        interactive = sys.stdin.isatty() and not (self.yes or on_twin)
        bench = Bench(
            profile,
            twin=on_twin,
            one_shot=self.one_shot,
            probe=self.probe,
            # The client that drives during the faults is a program, not a person.
            arguments=("--arm-by-program",) if self.leds and not on_twin else (),
            pilot=_PILOT,
            ask=ask_person if interactive else lambda _: None,
        )
        require_level(level, bench)
        if not on_twin and not self.wiring:
            self._require_consent(profile, interactive=interactive)
        standing = StandingRobot(
            profile,
            port=0 if self.leds or on_twin else self.port,
            hardware=bench.pins,
            motors_off=self.motors_off or self.leds or on_twin,
            installed=not self.leds,
            on_twin=on_twin,
            credentials=self.credentials,
        )
        pins = plan_of_pins(profile)
        if self.wiring:
            say("\n".join(["", *pins]))
        head = [*facts(profile, twin=on_twin), *pins]
        report = self.report
        if self.leds:
            head += [f"LED          {lamp.place}: {lamp.name}" for lamp in lamps_of(profile)]
            report = report or Path("leds-report.txt")
        parts = check_robot(level, bench, standing, cap=self.cap, trials=self.trials)
        if not write_report(parts, say, report, head):
            sys.exit(1)

    def _level(self) -> CheckLevel:
        """Return the level of the check; refuse options without an effect, and invalid numbers."""
        options = {"wiring": self.wiring, "leds": self.leds, "faults": self.faults}
        asked = [level for level, chosen in options.items() if chosen]
        if len(asked) > 1:
            raise RobotError(f"Choose one of {' and '.join(f'--{level}' for level in asked)}.")
        level: Any = asked[0] if asked else "plain"
        pins = "cannot be combined with --twin, --wiring, --leds or --faults"
        drives_pins = level == "plain" and not self.twin
        has_supply = level in {"plain", "wiring"} and not self.twin
        for option, given, has, needs in (
            ("--yes", self.yes, self.leds, "needs --leds"),
            ("--probe", self.probe is not None, self.leds, "needs --leds"),
            ("--trials", self.trials != 1, self.faults, "needs --faults"),
            ("--no-one-shot", not self.one_shot, self.faults, "needs --faults"),
            ("--cap", self.cap != _CAP, level in {"plain", "leds"}, "needs a check that drives"),
            ("--wheels-up", self.wheels_up, drives_pins, pins),
            ("--jumper", self.jumper is not None, drives_pins, pins),
            ("--motors-off", self.motors_off, has_supply, pins.replace(" --wiring,", "")),
        ):
            if given and not has:
                raise RobotError(f"{option} {needs}.")
        require_port(self.port)
        if not 0.0 < self.cap <= 1.0:
            raise RobotError(f"--cap must be above 0 and at most 1, got {self.cap}.")
        if self.trials < 1:
            raise RobotError(f"--trials must be at least 1, got {self.trials}.")
        return level

    def _require_consent(self, profile: Profile, *, interactive: bool) -> None:
        if not self.leds and not self.wheels_up:
            ask_for_wheels_up()
        if self.jumper is not None:
            say(f"{MARKS['good']}  jumper: {check_jumper(*self.jumper, profile)}")
        require_pins(profile)
        if self.leds and not (interactive or self.yes):
            raise RobotError(
                "All outputs will be driven: replace the motors by LEDs, and confirm with --yes."
            )
        question = "All outputs will be driven. Is every motor taken off?"
        if self.leds and interactive and not ask_person(question):
            raise RobotError("No LED was lit.")


def ask_person(question: str) -> bool | None:
    """Ask until the answer is yes or no; return None if the input has ended."""
    with suppress(EOFError):
        return Confirm.ask(question, console=plain_console())
    return None
