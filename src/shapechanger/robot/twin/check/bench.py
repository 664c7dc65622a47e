"""Where a robot is checked: its twin or the pins of this machine, and how its outputs are seen."""

from __future__ import annotations

import math
import time
from contextlib import ExitStack, closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Self

from shapechanger.errors import RobotError
from shapechanger.robot.check.pins import Ask, BenchLamp, probed_pin
from shapechanger.robot.drivers.edges import EdgeInput
from shapechanger.robot.drivers.simulation import PwmChannel
from shapechanger.robot.guard.outputs import make_safe
from shapechanger.robot.hardware import Hardware
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.raspberry_pi import RealHardware
from shapechanger.robot.twin.hardware import connect
from shapechanger.robot.twin.robot import Operator, RunningRobot, run_robot
from shapechanger.robot.twin.start import BoardAt, start_board
from shapechanger.robot.twin.wiring import TwinWiring

# Longest low time of software PWM while a motor runs: two cycles at 50 Hz.
_PWM_S: Final = 0.04


class Watcher:
    """Measures the outputs, independently of the robot's programs; this one measures nothing."""

    def sees(self, lamp: BenchLamp) -> bool | None:
        """Return whether an LED is lit; None if that is not measured."""

    def moves(self) -> bool | None:
        """Return whether an output that propels is driven now; None if that is not measured."""

    def rest_ms(self, at_ns: int) -> float:
        """Return the time from a moment to the last propulsion after it, ms.

        It is infinite if the propulsion goes on, and NaN if it is not measured.
        """
        del at_ns
        return math.nan

    def close(self) -> None:
        """Stop watching."""


class BoardWatcher(Watcher):
    """Reads the levels of a twin, whose ledger has the times."""

    def __init__(self, board: BoardAt, wiring: TwinWiring) -> None:
        self._wiring = wiring
        self._operator = Operator(board.socket_path)
        self.close = self._operator.close

    def sees(self, lamp: BenchLamp) -> bool | None:
        """See `Watcher`."""
        levels = self._operator.levels()
        if lamp.pin is not None:
            return levels.duties.get(lamp.pin, 0.0) > 0.0
        if lamp.output is None:
            return None
        settings = lamp.output.settings
        channel = PwmChannel(*(settings[key] for key in ("bus", "address", "channel")))
        return channel in levels.channels and levels.channels[channel].us > 0.0

    def moves(self) -> bool:
        """See `Watcher`."""
        outputs = self._wiring.read(self._operator.levels(), time.monotonic_ns())
        return not all(outputs[name].at_rest for name in self._wiring.propelling)


class ProbeWatcher(Watcher):
    """Watches the pin of a motor through a wire to a free pin.

    Edges are stamped here when they arrive, about a millisecond late.

    Args:
        probe: Free BCM pin at the end of the wire.
        probed: BCM pin of the motor.
        hardware: The pins.
    """

    def __init__(self, probe: int, probed: int, hardware: Hardware) -> None:
        self._probed = probed
        self._edges: list[int] = []
        self._hardware = hardware
        self._input = EdgeInput(probe, "down", hardware.pin_factory(), self._changed)

    def sees(self, lamp: BenchLamp) -> bool | None:
        """See `Watcher`."""
        return self.moves() if lamp.pin == self._probed else None

    def moves(self) -> bool:
        """See `Watcher`."""
        last_ns = self._edges[-1] if self._edges else 0
        return bool(self._input.level) or time.monotonic_ns() - last_ns < _PWM_S * 1e9

    def rest_ms(self, at_ns: int) -> float:
        """See `Watcher`."""
        if self._input.level:
            return math.inf
        return max(0.0, (self._edges[-1] - at_ns) / 1e6) if self._edges else 0.0

    def close(self) -> None:
        """See `Watcher`."""
        self._input.close()
        self._hardware.close()

    def _changed(self, at_s: float, level: int) -> None:
        del at_s, level  # lgpio's clock is not stated.
        self._edges.append(time.monotonic_ns())


class Bench:
    """A robot to check, on its twin or on the pins of this machine, until `close`.

    Args:
        profile: The robot.
        twin: Whether on its twin.
        one_shot: Whether a twin has the one-shot of the enable line, if the profile has one.
        probe: Free BCM pin with a wire to the pin of the motor that drives forward; None without.
        arguments: Further arguments of `serve`.
        pilot: Module of the program that drives as a policy on board; see `Driver`.
        ask: Asks a person.

    Attributes:
        plan: The robot, for its guard.
        wiring: Wiring of a twin.
        restarts: How often the robot has restarted since it was served.
    """

    def __init__(
        self,
        profile: Profile,
        *,
        twin: bool = True,
        one_shot: bool = True,
        probe: int | None = None,
        arguments: tuple[str, ...] = (),
        pilot: str = "",
        ask: Ask = lambda _: None,
    ) -> None:
        if twin and probe is not None:
            raise RobotError("A twin needs no --probe: its ledger has every change of a pin.")
        self.profile = profile
        self.plan = profile.guard_plan()
        self.twin = twin
        self.pilot = pilot
        self.ask = ask
        self.restarts = 0
        self._one_shot_ms = float(self.plan.enable_hold_ms) if one_shot else None
        self.wiring = TwinWiring(self.plan, self._one_shot_ms)
        self._probe = None if probe is None else (probe, probed_pin(self.plan, probe))
        self._arguments = arguments
        self._board: BoardAt | None = None
        self._robot: RunningRobot | None = None
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        """Return the bench."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    def board(self) -> BoardAt:
        """Return the board of the twin; it outlives the robot's processes, as hardware does."""
        if self._board is None:
            folder = self._stack.enter_context(TemporaryDirectory(prefix="shapechanger-check-"))
            self._board = self._stack.enter_context(
                start_board(
                    self.plan,
                    clock="real",
                    folder=Path(folder),
                    camera=self.profile.camera,
                    one_shot_ms=self._one_shot_ms,
                )
            )
        return self._board

    def pins(self) -> Hardware:
        """Open the pins and buses."""
        return connect(self.board().socket_path) if self.twin else RealHardware()

    def watcher(self) -> Watcher:
        """Open a watcher of the outputs."""
        if self.twin:
            return BoardWatcher(self.board(), self.wiring)
        return Watcher() if self._probe is None else ProbeWatcher(*self._probe, RealHardware())

    def robot(self) -> RunningRobot:
        """Return the robot, served now if it is not."""
        if self._robot is None:
            folder = self.board().folder if self.twin else None
            robot = run_robot(
                self.profile, twin=self.twin, folder=folder, arguments=self._arguments
            )
            self._robot = self._stack.enter_context(robot)
        return self._robot

    def close(self) -> list[str]:
        """End everything, and put the pins of this machine at rest after any fault.

        Returns:
            Outputs that could not be put at rest.
        """
        was_served = self._robot is not None
        self._robot = self._board = None
        self.restarts = 0
        self._stack.close()
        if self.twin or not was_served:
            return []
        with closing(RealHardware()) as hardware:
            return make_safe(self.plan, hardware)
