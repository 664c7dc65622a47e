"""Driving with the keys of a terminal: keys in, commands out, and a line that says what happens."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Final

from rich.live import Live
from rich.text import Text

from shapechanger.cli.console import plain_console
from shapechanger.errors import LinkError, RobotRefused
from shapechanger.layout import Layout
from shapechanger.remote.client import RobotClient
from shapechanger.teleop.keys import DIRECTIONS, HeldKeys
from shapechanger.teleop.terminal import Terminal

if TYPE_CHECKING:
    from shapechanger.cli.robot.piloting import Pilot
    from shapechanger.link.messages import Observation

__all__ = ["Driving"]

_HELP: Final = (
    "W A S D or arrows drive · E arms · Space stops everything · X disarms · + and - set the cap · "
    "P lets a waiting program drive · R records · M marks · U undoes 5 s · Q leaves"
)
_CAP_STEP: Final = 0.1
# s. A program that waits in its `reset` takes a robot that is free within a moment.
_TAKEN_WITHIN_S: Final = 2.0
# Observations in a row in which a key moves nothing, and the robot names no reason.
_UNMOVED_LOOKS: Final = 10
_BY_KEYS: Final = frozenset({"steering", "throttle"})


class Driving:
    """One person at one terminal.

    Args:
        robot: The robot, connected to as a person.
        terminal: Where the keys come from.
        cap: Largest steering and throttle to ask for, 0 to 1.
        pilot: What drives when the person lets it; None for whatever program waits.

    Raises:
        LinkError: If the robot has no throttle.
    """

    def __init__(
        self, robot: RobotClient, terminal: Terminal, cap: float, pilot: Pilot | None = None
    ) -> None:
        actions = Layout.from_json(robot.welcome.action_layout)
        if "throttle" not in actions:
            names = ", ".join(actions.names)
            raise LinkError(f"{robot.welcome.robot} has no throttle to drive with, but {names}.")
        self._robot = robot
        self._actions = actions
        self._state = Layout.from_json(robot.welcome.state_layout)
        self._terminal = terminal
        self._keys = HeldKeys()
        self._cap = cap
        self._pilot = pilot
        self._note = ""
        self._unmoved = dict.fromkeys(_BY_KEYS, 0)

    def run(self) -> None:
        """Drive until Q.

        Raises:
            LinkError: If the link is lost, or the pilot's is.
        """
        console = plain_console()
        console.print(_HELP)
        seq = 0
        with Live(console=console, refresh_per_second=10, transient=True) as live:
            self._robot.acknowledge()
            while True:
                seen = self._robot.observation(seq).message
                seq = seen.seq
                if not self._take_keys(1.0 / self._robot.welcome.control_hz, seen):
                    return
                if self._pilot is not None:
                    self._pilot.require_well()
                now_s = time.monotonic()
                values = [
                    # What no key moves stays where it is, which need not be 0.
                    self._keys.value(name, now_s) if name in _BY_KEYS else held / self._cap
                    for name, held in zip(self._actions.names, seen.action_applied, strict=True)
                ]
                if seen.mine and seen.armed:
                    self._robot.command(values, answers=seq, scale=self._cap)
                else:
                    self._robot.acknowledge()
                live.update(self._line(seen, self._unanswered(values, seen)))

    def _take_keys(self, wait_s: float, seen: Observation) -> bool:
        """Do what the keys say; whether to go on."""
        until_s = time.monotonic() + wait_s
        while (left_s := until_s - time.monotonic()) > 0.0:
            for key in self._terminal.keys(left_s):
                if key == "q":
                    return False
                try:
                    self._act(key, seen)
                except RobotRefused as error:
                    self._note = str(error)
        return True

    def _act(self, key: str, seen: Observation) -> None:
        """Do what one key says.

        Raises:
            RobotRefused: If the robot says no.
        """
        if key in DIRECTIONS:
            # A hand on the keys is what takes the robot from a policy: there is no time to think.
            if not seen.mine and seen.holder_role == "program":
                self._robot.take()
            self._keys.press(key, time.monotonic())
            return
        self._note = ""
        if key == "space":
            self._keys.let_go()
            self._robot.emergency_stop("A person pressed Space.")
        elif key == "x":
            self._keys.let_go()
            self._robot.disarm()
        elif key in {"+", "="}:
            self._cap = min(1.0, self._cap + _CAP_STEP)
        elif key == "-":
            self._cap = max(_CAP_STEP, self._cap - _CAP_STEP)
        elif key == "e":
            self._keys.let_go()
            self._robot.take()
            self._robot.arm()
        elif key == "p":
            self._keys.let_go()
            self._note = self._hand_over()
        elif key in {"r", "m", "u"}:
            self._record(key)

    def _record(self, key: str) -> None:
        """What R, M and U do with the robot's recorder.

        Raises:
            RobotRefused: If the robot cannot.
        """
        state = self._robot.recorder
        if key == "r":
            self._robot.record(on=state is None or not state.recording)
        elif key == "m":
            self._robot.mark()
        else:
            self._robot.undo()

    def _hand_over(self) -> str:
        """Give the robot to a program that waits for it, and arm it for that; what came of it.

        Raises:
            RobotRefused: If the robot does not arm.
        """
        self._robot.release()
        until_s = time.monotonic() + _TAKEN_WITHIN_S
        while time.monotonic() < until_s:
            seen = self._robot.ask().message
            if seen.holder and not seen.mine:
                self._robot.arm()
                if self._pilot is not None:  # Which says itself what it does.
                    return ""
                return f"armed for {seen.holder}: any direction takes over, Space stops"
        return "no program waits: start one, and press P while its reset waits"

    def _unanswered(self, values: list[float], seen: Observation) -> str:
        """Which key moves nothing though nothing is said against it, as below a threshold."""
        quiet = seen.mine and seen.armed and not seen.stop_reason
        for name, asked, does in zip(self._actions.names, values, seen.action_applied, strict=True):
            if name in _BY_KEYS:
                is_unmoved = quiet and asked != 0.0 and does == 0.0
                self._unmoved[name] = self._unmoved[name] + 1 if is_unmoved else 0
                if self._unmoved[name] >= _UNMOVED_LOOKS:
                    return f"a {name} of {self._cap:.1f} moves nothing here: raise the cap with +"
        return ""

    def _line(self, seen: Observation, remark: str) -> Text:
        """The state of the robot in a line, with a remark on it."""
        if seen.emergency:
            state = "EMERGENCY STOP"
        elif not seen.mine:
            armed = "armed, " if seen.armed else ""
            state = f"{armed}commanded by {seen.holder or 'nobody'}"
        else:
            state = "armed" if seen.armed else "not armed"
        senses = " ".join(
            f"{feature.name} {value:.2f} {feature.unit}"
            for feature, value in zip(self._state, seen.state, strict=True)
            if not feature.name.endswith("/applied")
        )
        parts = [
            state,
            f"cap {self._cap:.1f}",
            self._recording(),
            self._values(seen.action_applied),
            f"{seen.suggested_by} wants {self._values(seen.suggested)}" if seen.suggested else "",
            senses,
            self._note or seen.stop_reason or remark or ("" if seen.mine else self._pilot_says()),
        ]
        return Text(" · ".join(part for part in parts if part))

    def _values(self, values: tuple[float, ...]) -> str:
        named = zip(self._actions.names, values, strict=False)
        return " ".join(f"{name} {value:+.2f}" for name, value in named)

    def _recording(self) -> str:
        state = self._robot.recorder
        if state is None or not (state.recording or state.text):
            return ""
        if not state.recording:
            return state.text
        return f"recording {state.seconds:.0f} s, {state.steps - state.dropped} steps"

    def _pilot_says(self) -> str:
        return "" if self._pilot is None else self._pilot.note
