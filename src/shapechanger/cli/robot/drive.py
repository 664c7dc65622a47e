"""`shapechanger robot drive`: a person drives from the terminal."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final

import tyro
from rich.live import Live
from rich.text import Text

from shapechanger.cli.console import plain_console
from shapechanger.errors import LinkError, RobotRefused

if TYPE_CHECKING:
    from shapechanger.layout import Layout
    from shapechanger.link.messages import Observation
    from shapechanger.remote.client import RobotClient
    from shapechanger.teleop.terminal import Terminal

__all__ = ["Drive"]

_HELP: Final = (
    "W A S D or arrows drive · E arms · Space stops everything · X disarms · + and - set the cap · "
    "P lets a waiting program drive · Q leaves"
)
_CAP_STEP: Final = 0.1
# s. A program that waits in its `reset` takes a robot that is free within a moment.
_TAKEN_WITHIN_S: Final = 2.0
# Observations in a row in which a key moves nothing, and the robot names no reason.
_UNMOVED_LOOKS: Final = 10
_BY_KEYS: Final = frozenset({"steering", "throttle"})


@dataclass(frozen=True)
class Drive:
    """Drive a robot with the keys of this terminal; a person comes before any program."""

    robot: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ROBOT")]
    """Name of a robot that is known here, see `remember`."""
    cap: float = 0.5
    """Largest steering and throttle to ask for, 0 to 1; + and - change it."""

    def run(self) -> None:
        """Drive until Q."""
        from shapechanger.layout import Layout
        from shapechanger.remote.client import RobotClient
        from shapechanger.remote.known import recall
        from shapechanger.teleop.terminal import Terminal

        if not 0.0 < self.cap <= 1.0:
            raise LinkError(f"The cap is above 0 and at most 1, got {self.cap}.")
        known = recall(self.robot)
        with (
            Terminal() as terminal,
            RobotClient.connect(known, role="person", frames=False) as robot,
        ):
            actions = Layout.from_json(robot.welcome.action_layout)
            if "throttle" not in actions:
                names = ", ".join(actions.names)
                raise LinkError(f"{self.robot} has no throttle to drive with, but {names}.")
            robot.take()
            state = Layout.from_json(robot.welcome.state_layout)
            _Driving(robot, actions, state, terminal, self.cap).run()


class _Driving:
    """Keys in, commands out, until Q."""

    def __init__(
        self,
        robot: RobotClient,
        actions: Layout,
        state: Layout,
        terminal: Terminal,
        cap: float,
    ) -> None:
        from shapechanger.teleop.keys import HeldKeys

        self._robot = robot
        self._actions = actions
        self._state = state
        self._terminal = terminal
        self._keys = HeldKeys()
        self._cap = cap
        self._note = ""
        self._unmoved = dict.fromkeys(_BY_KEYS, 0)

    def run(self) -> None:
        console = plain_console()
        console.print(_HELP)
        seq = 0
        with Live(console=console, refresh_per_second=10, transient=True) as live:
            self._robot.acknowledge()
            while True:
                seen = self._robot.observation(seq).message
                seq = seen.seq
                if not self._take_keys(1.0 / self._robot.welcome.control_hz):
                    return
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

    def _take_keys(self, wait_s: float) -> bool:
        """Do what the keys say; whether to go on."""
        until_s = time.monotonic() + wait_s
        while (left_s := until_s - time.monotonic()) > 0.0:
            for key in self._terminal.keys(left_s):
                if self._keys.press(key, time.monotonic()):
                    continue
                if key == "q":
                    return False
                self._act(key)
        return True

    def _act(self, key: str) -> None:
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
            try:
                self._robot.take()
                self._robot.arm()
            except RobotRefused as error:
                self._note = str(error)
        elif key == "p":
            self._keys.let_go()
            try:
                self._note = self._hand_over()
            except RobotRefused as error:
                self._note = str(error)

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
                return f"armed for {seen.holder}: Space still stops it, E takes it back"
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
        does = " ".join(
            f"{name} {value:+.2f}"
            for name, value in zip(self._actions.names, seen.action_applied, strict=True)
        )
        senses = " ".join(
            f"{feature.name} {value:.2f} {feature.unit}"
            for feature, value in zip(self._state, seen.state, strict=True)
            if not feature.name.endswith("/applied")
        )
        parts = [
            state,
            f"cap {self._cap:.1f}",
            does,
            senses,
            self._note or seen.stop_reason or remark,
        ]
        return Text(" · ".join(part for part in parts if part))
