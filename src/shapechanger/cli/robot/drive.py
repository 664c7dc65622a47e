"""`shapechanger robot drive`: drive a robot, or supervise a policy."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rich.live import Live
from rich.text import Text

from shapechanger.cli.console import plain_console, say
from shapechanger.cli.robot.remote import RobotName
from shapechanger.demos.cloning.clone import load_clone
from shapechanger.errors import LinkError, RobotRefused
from shapechanger.layout import Layout
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.known_robots import can_open, open_console, recall
from shapechanger.robot.client.recordings import begin_recording, end_recording, fetch_episode
from shapechanger.robot.client.teleop import DIRECTIONS, FIRST_HOLD_S, STOPS, HeldKeys, Terminal
from shapechanger.robot.link.messages import Observation
from shapechanger.vehicles.remote.pilot import PolicyDriver, require_fit

_LOOK_EVERY_S: Final = 0.2


@dataclass(frozen=True)
class RobotDrive:
    """Drive a robot in its web console, or with the keys of this terminal.

    People take precedence over programs. With --policy, a policy drives once a person permits it,
    and the person can take over at any time; the corrections can be learned from.
    """

    robot: RobotName
    cap: float = 0.5
    """Largest steering and throttle that the keys command, 0 to 1; + and - change it."""
    terminal: bool = False
    """Drive with the keys of this terminal, even where a browser could show the console."""
    policy: Path | None = None
    """A policy that drives when you permit it, such as one that `demos train` has written."""
    record: Path | None = None
    """Record on the robot, and download the recording to this folder at the end."""

    def run(self) -> None:
        if not 0.0 < self.cap <= 1.0:
            raise LinkError(f"--cap must be above 0 and at most 1, got {self.cap}.")
        known = recall(self.robot)
        pilot = None
        if self.policy is not None:
            policy = load_clone(self.policy)
            with RobotClient.connect(known, frames=False) as there:
                require_fit(policy.card, there.welcome, measures=True)
            pilot = PolicyDriver(policy, self.policy.stem, known)
        uses_keys = self.terminal or not can_open()
        with contextlib.ExitStack() as stack:
            terminal = stack.enter_context(Terminal()) if uses_keys else None
            robot = stack.enter_context(RobotClient.connect(known, role="person", frames=False))
            driving = None
            if terminal is not None:
                driving = Driving(robot, terminal, self.cap, pilot)
                robot.take()
            else:
                address = open_console(known)
                say(
                    f"The console of {known.name} is at {address}, and opens in your browser, "
                    "which warns of its certificate once. --terminal drives with the keys of this "
                    "terminal."
                )
                if pilot is None and self.record is None:
                    return
            if self.record is not None:
                stack.enter_context(recorded_to(self.record, robot, known.name))
            if pilot is not None:
                stack.enter_context(pilot)
            if driving is not None:
                driving.run()
            else:
                say("Ctrl-C ends this.")
                _stay(robot, pilot)


@contextlib.contextmanager
def recorded_to(data: Path, robot: RobotClient, name: str) -> Generator[None]:
    """Record on the robot within a block, then fetch the episodes; or print how, after an error."""
    before = begin_recording(robot)
    try:
        yield
        for episode in end_recording(robot, before):
            fetch_episode(robot, episode.id, data)
            say(f"recorded {episode.kept} steps in {data / episode.id}")
    except BaseException:
        say(
            f"The recording is on the robot: `shapechanger robot fetch {name} --out {data}` "
            "downloads it.",
            stderr=True,
        )
        raise


def _stay(robot: RobotClient, pilot: PolicyDriver | None) -> None:
    """Print the policy's state until Ctrl-C, until the policy fails, or until the link ends."""
    said = ""
    try:
        while robot.alive:
            robot.ping()
            if pilot is not None:
                pilot.require_well()
                if pilot.note != said:
                    said = pilot.note
                    say(said)
            time.sleep(_LOOK_EVERY_S)
    except KeyboardInterrupt:
        say("Ended.")


_HELP: Final = (
    "W A S D or arrows drive · E arms · Space and Escape stop everything · X disarms · "
    "+ and - set the cap · P lets a waiting program drive · R records · M marks · U undoes 5 s · "
    "Q quits"
)
_CAP_STEP: Final = 0.1
# Time within which a program that waits in `reset` takes control of a free robot, s.
_TAKEN_WITHIN_S: Final = 2.0
# Number of consecutive observations without an effect of a key after which a hint is shown.
_UNMOVED_LOOKS: Final = 10
# Keys that act only once while they are held, because they may make the robot move.
_ONCE: Final = frozenset({"e", "p"})
_BY_KEYS: Final = frozenset({"steering", "throttle"})


class Driving:
    """Terminal session of a person who drives, and may let `pilot` or a waiting program drive."""

    def __init__(
        self, robot: RobotClient, terminal: Terminal, cap: float, pilot: PolicyDriver | None = None
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
        self._pressed = ("", -math.inf)  # The newest key and its time, s.
        self._cap = cap
        self._pilot = pilot
        self._note = ""
        self._unmoved = dict.fromkeys(_BY_KEYS, 0)

    def run(self) -> None:
        console = plain_console()
        self._terminal.keys(0.0)  # Discard keys that were pressed before the help was shown.
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
                    # Actions without keys keep their value, which may differ from 0.
                    self._keys.value(name, now_s) if name in _BY_KEYS else held / self._cap
                    for name, held in zip(self._actions.names, seen.action_applied, strict=True)
                ]
                if seen.mine and seen.armed:
                    self._robot.command(values, answers=seq, scale=self._cap)
                else:
                    self._robot.acknowledge()
                live.update(self._line(seen, self._unanswered(values, seen)))

    def _take_keys(self, wait_s: float, seen: Observation) -> bool:
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
        now_s = time.monotonic()
        before, before_s = self._pressed
        self._pressed = (key, now_s)
        if key in _ONCE and key == before and now_s - before_s < FIRST_HOLD_S:
            return  # The terminal repeats a held key.
        if key in DIRECTIONS:
            # A driving key takes control from a program at once.
            if not seen.mine and seen.holder_role == "program":
                self._robot.take()
            self._keys.press(key, now_s)
            return
        self._note = ""
        if key in STOPS:
            self._stop(key)
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
        elif key == "r":
            state = self._robot.recorder
            self._robot.record(on=state is None or not state.recording)
        elif key == "m":
            self._robot.mark()
        elif key == "u":
            self._robot.undo()

    def _stop(self, key: str) -> None:
        self._keys.let_go()
        self._robot.emergency_stop(f"A person pressed {key.capitalize()}.")

    def _hand_over(self) -> str:
        """Hand the robot to a waiting program, arm it, and describe the outcome."""
        self._robot.release()
        until_s = time.monotonic() + _TAKEN_WITHIN_S
        while time.monotonic() < until_s:
            for key in self._terminal.keys(0.0):
                self._pressed = (key, time.monotonic())
                if key in STOPS:
                    self._stop(key)
                    return ""
            seen = self._robot.ask().message
            if seen.holder and not seen.mine:
                self._robot.arm()
                if self._pilot is not None:  # The policy reports its own state.
                    return ""
                return f"armed for {seen.holder}: any driving key takes over, Space stops"
        return "no program waits: start one, and press P while its reset waits"

    def _unanswered(self, values: list[float], seen: Observation) -> str:
        """Return a hint if a key has no effect, for example with a value below a threshold."""
        quiet = seen.mine and seen.armed and not seen.stop_reason
        for name, asked, does in zip(self._actions.names, values, seen.action_applied, strict=True):
            if name in _BY_KEYS:
                is_unmoved = quiet and asked != 0.0 and does == 0.0
                self._unmoved[name] = self._unmoved[name] + 1 if is_unmoved else 0
                if self._unmoved[name] >= _UNMOVED_LOOKS:
                    return f"a {name} of {self._cap:.1f} moves nothing here: raise the cap with +"
        return ""

    def _line(self, seen: Observation, remark: str) -> Text:
        if seen.emergency:
            state = "EMERGENCY STOP"
        elif not seen.mine:
            armed = "armed, " if seen.armed else ""
            state = f"{armed}commanded by {seen.holder or 'no one'}"
        else:
            state = "armed" if seen.armed else "not armed"
        senses = " ".join(
            f"{feature.name} {value:.2f} {feature.unit}"
            for feature, value in zip(self._state, seen.state, strict=True)
            if not feature.name.endswith("/applied")
        )
        recorder, recording = self._robot.recorder, ""
        if recorder is not None:
            recording = recorder.text
            if recorder.recording:
                steps = recorder.steps - recorder.dropped
                recording = f"recording {recorder.seconds:.0f} s, {steps} steps"
        pilot_note = "" if self._pilot is None else self._pilot.note
        parts = [
            state,
            f"cap {self._cap:.1f}",
            recording,
            self._values(seen.action_applied),
            f"{seen.suggested_by} chose {self._values(seen.suggested)}" if seen.suggested else "",
            senses,
            self._note or seen.stop_reason or remark or ("" if seen.mine else pilot_note),
        ]
        return Text(" · ".join(part for part in parts if part))

    def _values(self, values: tuple[float, ...]) -> str:
        named = zip(self._actions.names, values, strict=False)
        return " ".join(f"{name} {value:+.2f}" for name, value in named)
