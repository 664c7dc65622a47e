"""A whole robot on a twin in this process: its guard, its drivers, its pins and its world.

What a served robot does in a guard, a daemon and a board is done here by the same code in one call:
`step` hands a command to the guard and lets one control period go by. There is no link, no lease
and no deadline to miss; time moves only in steps, as with `--clock twin`.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
import simplejpeg

from shapechanger.errors import RobotError
from shapechanger.link.messages import Observation, Welcome
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.observation import NumberedFrame, StateReader, build_observation
from shapechanger.robot.drivers.dynamixel.settings import BusSettings
from shapechanger.robot.drivers.settings import number
from shapechanger.robot.guard.messages import GuardState, Order
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.guard.process import Guard
from shapechanger.robot.profile.profile import Profile
from shapechanger.twin import messages as wire
from shapechanger.twin.hardware import TwinBus, TwinServoPins
from shapechanger.twin.messages import EdgeListener
from shapechanger.twin.pin_board import Owner, PinBoard, chips_of
from shapechanger.twin.rig import Rig
from shapechanger.twin.sensors import Surroundings
from shapechanger.twin.servos.bus import LinePort
from shapechanger.twin.signals import NoLedger
from shapechanger.twin.timekeeper import START_NS
from shapechanger.twin.wiring import TwinWiring
from shapechanger.worlds.world import World

__all__ = ["InProcessRobot", "LocalBoard", "LocalClock", "LocalHardware", "LocalLink"]


class LocalLink:
    """The only process at a board, which is this one; see `BoardLink`.

    Args:
        pins: The board's pins and chips.
        input_levels: Levels of the pins that sensors drive, as they are now.
    """

    def __init__(self, pins: PinBoard, input_levels: dict[int, int]) -> None:
        self._pins = pins
        self._input_levels = input_levels
        self._owner = Owner(self, os.getpid())
        self.levels: dict[int, int] = {}
        self.on_edge: EdgeListener | None = None
        self.closed = False

    def post(self, **message: Any) -> None:
        """Change an output."""
        pin, t = message["pin"], message["t"]
        if message["op"] == "pin":
            self._pins.drive(self._owner, pin, message["duty"], message["hz"], t)
        else:
            self._pins.pulse(self._owner, pin, message["us"], message["hz"], t)

    def ask(self, **message: Any) -> wire.Message:
        """Claim a pin, or read and write the registers of a chip."""
        if message["op"] == "claim":
            return {"level": self._claim(message)}
        at = message["bus"], message["address"], message["register"]
        if message["op"] == "read":
            return {"data": self._pins.read_chip(*at, message["length"])}
        self._pins.write_chip(self._owner.pid, *at, message["data"], message["t"])
        return {}

    def drain(self) -> None:
        """Do nothing: edges come by `notice`."""

    def notice(self, pin: int, level: int, at_ns: int) -> None:
        """An input has changed."""
        if pin in self.levels:
            self.levels[pin] = level
            if self.on_edge is not None:
                self.on_edge(pin, level, at_ns)

    def _claim(self, message: wire.Message) -> int:
        pin, mode = message["pin"], message["mode"]
        level = self._pins.claim(
            self._owner, pin, mode, message["pull"], message["level"], message["t"]
        )
        return self._input_levels.get(pin, level) if mode == "input" else level


class LocalClock:
    """The board's time."""

    def __init__(self) -> None:
        self.time_ns = START_NS

    def now_ns(self) -> int:
        """The time in nanoseconds."""
        return self.time_ns

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Nobody can wait here: whoever advances the board would have to wait, too."""
        raise RobotError("The time of a board in one's own process moves only by `advance`.")

    async def sleep(self, seconds: float) -> int | None:
        """Nobody can wait here; see `wait`."""
        raise RobotError("The time of a board in one's own process moves only by `advance`.")


class LocalHardware:
    """Pins, buses and time of a board in this process; see `shapechanger.robot.hardware`."""

    def __init__(self, link: LocalLink, clock: LocalClock, rig: Rig | None = None) -> None:
        self._link = link
        self._clock = clock
        self._rig = rig
        self._pin_factory: Any = None

    @property
    def clock(self) -> LocalClock:
        """The board's time."""
        return self._clock

    def pin_factory(self) -> Any:
        """What gpiozero's devices take as `pin_factory`."""
        if self._pin_factory is None:
            from shapechanger.twin.hardware import (
                TwinPinFactory,  # gpiozero only where there are pins.
            )

            self._pin_factory = TwinPinFactory(self._link, self._clock)
        return self._pin_factory

    def i2c(self, bus: int) -> TwinBus:
        """An I2C bus by its number."""
        return TwinBus(self._link, self._clock, bus)

    def servo_pins(self) -> TwinServoPins:
        """Pins that send servo pulses."""
        return TwinServoPins(self._link, self._clock)

    def servo_port(self, settings: BusSettings) -> LinePort:
        """The port of the servos.

        Raises:
            RobotError: If the board has none there.
        """
        if self._rig is None:
            raise RobotError(f"There is no {settings.device} at this twin.")
        self._rig.require(settings.device)
        return LinePort(self._rig.line, settings.baud)

    def close(self) -> None:
        """Let go of the pins."""
        if self._pin_factory is not None:
            self._pin_factory.close()
            self._pin_factory = None
        self._link.closed = True


class LocalBoard:
    """A board with a world around it.

    Args:
        wiring: What is attached to its pins.
        world: Where the vehicle is.
        seed: Of the phase of software PWM.

    Attributes:
        pins: Its pins and chips.
        hardware: What a guard in this process drives.
        rig: The servos on a bus; None without any.
    """

    def __init__(self, wiring: TwinWiring, world: World, seed: int = 0) -> None:
        self._clock = LocalClock()
        self._surroundings = Surroundings(wiring, world, self._clock.time_ns)
        sensors = self._surroundings.sensors
        self.pins = PinBoard(wiring, chips_of(wiring.plan, world), NoLedger(), seed)
        self.pins.on_output = sensors.output_changed
        self._link = LocalLink(self.pins, sensors.levels)
        self.rig = self._surroundings.rig
        self.hardware = LocalHardware(self._link, self._clock, self.rig)

    @property
    def now_ns(self) -> int:
        """The time."""
        return self._clock.time_ns

    def advance(self, now_ns: int) -> None:
        """Let time, the world and the sensors go on."""
        self._clock.time_ns = now_ns
        for edge in self._surroundings.advance(now_ns, self.pins.levels):
            self._link.notice(edge.pin, edge.level, edge.t)


_log = logging.getLogger(__name__)

_SESSION: Final = 1
# Steps that the guard may take to arm, once all controllers listen.
_MOST_TRIES: Final = 10


class _Orders:
    """Orders from this process, and the newest state; see `Channel`."""

    def __init__(self) -> None:
        self.lost = False
        self.waiting: list[Order] = []
        self.state: GuardState | None = None
        self.refused = ""

    def filenos(self) -> list[int]:
        """There are none, and nobody waits for them."""
        return []

    def orders(self) -> tuple[list[Order], list[str]]:
        """All orders that were given since the last call."""
        orders, self.waiting = self.waiting, []
        return orders, []

    def send(self, state: GuardState) -> bool:
        """Keep the newest state."""
        self.state = state
        self.refused = state.refused or self.refused
        return True


class InProcessRobot:
    """A robot in a world, ready to be stepped.

    Args:
        profile: The robot. Its camera's driver is not used: pictures come from the world.
        world: Where it is.
        pictures: Whether observations have pictures.
        seed: Of the phase of software PWM.
        wired_as: What is really attached to its pins; None for what the profile says.

    Attributes:
        welcome: What the robot is, as it would tell a client.

    Raises:
        RobotError: If the world's vehicle cannot be wired as the profile says.
    """

    def __init__(
        self,
        profile: Profile,
        world: World,
        *,
        pictures: bool = True,
        seed: int = 0,
        wired_as: GuardPlan | None = None,
    ) -> None:
        self._profile = profile
        self._plan = profile.guard_plan()
        self._wiring = TwinWiring(self._plan if wired_as is None else wired_as)
        self._world = world
        self._seed = seed
        camera = profile.camera if pictures else None
        self._camera = camera
        state_layout, action_layout = profile.state_layout(), profile.action_layout()
        self._reader = StateReader(state_layout, action_layout)
        self._tick_ns = round(1e9 / self._plan.tick_hz)
        self._period_ns = round(1e9 / profile.control_hz)
        self.welcome = Welcome(
            robot=profile.name,
            body=profile.body,
            action_layout=action_layout.to_json(),
            state_layout=state_layout.to_json(),
            image_size=None if camera is None else camera.size,
            control_hz=profile.control_hz,
            deadline_ms=profile.limits.deadline_ms,
            max_observation_age_ms=profile.max_observation_age_ms,
            reward=profile.reward_weights(),
            reset=profile.reset_routine(),
            arming="anyone",
            clock="twin",
            session=_SESSION,
        )
        self._guard: Guard | None = None
        self._pictured = 0  # It counts through all starts: each picture is told from any before.
        self._start()

    @property
    def now_ns(self) -> int:
        """The robot's time."""
        return self._board.now_ns

    def start(self, place: Callable[[], object] | None = None) -> Observation:
        """Switch the robot off and on again, arm it, and put it at a start.

        Args:
            place: Puts the vehicle there, before and after it is armed; None to leave it.

        Returns:
            What it sees there.

        Raises:
            RobotError: If it does not arm, and why.
        """
        if place is not None:
            place()  # So that a vehicle which drove does not roll on while it is switched on.
        self._start()
        self._arm()
        if place is not None:
            place()
            self._advance(self._period_ns)  # As a served robot, which says nothing sooner.
        return self._observe()

    def step(self, values: Sequence[float]) -> tuple[Observation, bool]:
        """Act for one control period.

        Args:
            values: One number for each action.

        Returns:
            What the robot senses at the end of it, and whether it bumped into something meanwhile.
        """
        bumps = self._state.bumps
        self._command_ns = self._board.now_ns
        self._seq += 1
        self._orders.waiting.append(
            Order(
                kind="command",
                session=_SESSION,
                seq=self._seq,
                issued_ns=self._command_ns,
                ttl_ms=self._profile.limits.deadline_ms,
                frame_ns=self._board.now_ns,
                values=tuple(values),
            )
        )
        self._advance(self._period_ns)
        return self._observe(), self._state.bumps > bumps

    def arm(self) -> None:
        """Arm the robot, as a person does who has looked after what stopped it.

        Raises:
            RobotError: If it does not arm, and why.
        """
        self._orders.refused = refused = ""  # What was refused before says nothing of this.
        for _ in range(_MOST_TRIES):
            now_ns = self._board.now_ns
            self._orders.waiting.append(Order(kind="arm", issued_ns=now_ns, person=True))
            self._advance(self._tick_ns)
            refused = self.refused
            if self._state.armed and not refused:
                return
        raise RobotError(f"The robot does not arm: {refused or self._state.stop_reason}")

    @property
    def rig(self) -> Rig | None:
        """The servos on a bus since the last start; None without any."""
        return self._board.rig

    @property
    def pins(self) -> PinBoard:
        """The pins and chips since the last start."""
        return self._board.pins

    @property
    def refused(self) -> str:
        """Why the guard refused the newest command, in words; empty when it did not."""
        refused, self._orders.refused = self._orders.refused, ""
        return refused

    def close(self) -> None:
        """Put the outputs to rest and let go of the pins."""
        if self._guard is not None:
            self._guard.close()
            self._board.hardware.close()
            self._guard = None

    @property
    def _state(self) -> GuardState:
        if self._orders.state is None:
            raise RobotError("The guard has said nothing yet.")
        return self._orders.state

    def _start(self) -> None:
        self.close()
        self._board = LocalBoard(self._wiring, self._world, self._seed)
        self._orders = _Orders()
        self._guard = Guard(self._plan, self._board.hardware, self._orders, _log)
        self._seq = 0
        self._observed = 0
        self._command_ns: int | None = None
        self._advance(self._period_ns)

    def _advance(self, ns: int) -> None:
        """Let time go by, with a round of the guard at each of its ticks."""
        guard, board = self._guard, self._board
        if guard is None:
            raise RobotError("The robot was closed.")
        end_ns = board.now_ns + ns
        while board.now_ns < end_ns:
            now_ns = min(board.now_ns + self._tick_ns, end_ns)
            board.advance(now_ns)
            guard.round(now_ns)

    def _arm(self) -> None:
        """Arm the robot, once its speed controllers have seen neutral for as long as they want."""
        settings = (output.settings for output in self._plan.outputs)
        patience_s = max((number(one, "arm_s") for one in settings if "arm_s" in one), default=0.0)
        self._advance(round(patience_s * 1e9))
        self.arm()

    def _observe(self) -> Observation:
        self._observed += 1
        newest = None
        if self._camera is not None:
            self._pictured += 1
            quality = self._camera.jpeg_quality
            jpeg = simplejpeg.encode_jpeg(
                np.ascontiguousarray(self._world.picture()), quality, "RGB", "444"
            )
            newest = NumberedFrame(self._pictured, Frame(jpeg, self._board.now_ns))
        return build_observation(
            seq=self._observed,
            now_ns=self._board.now_ns,
            reader=self._reader,
            state=self._state,
            newest=newest,
            frame_sent=self._pictured - 1,
            lease=_SESSION,
            command_ns=self._command_ns,
            holder=None,
            mine=True,
        )
