"""A complete robot in this process: guard, drivers, pins and world.

The guard and the drivers are the same as in a served robot. `step` sends the guard a command and
advances one control period. There is no link, no control lease and no deadline to miss; time
advances only in steps, the same as with `--clock twin`.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from inspect import signature
from types import SimpleNamespace
from typing import Any, Final, cast

import msgspec
import numpy as np
import simplejpeg

from shapechanger.contract.plan import GuardPlan
from shapechanger.contract.world import World
from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.client import Client
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.guard.channel import DaemonChannel, GuardState, Order
from shapechanger.robot.guard.process import Guard
from shapechanger.robot.link.card import card_of
from shapechanger.robot.link.messages import Command, Observation, Welcome
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.board import START_NS
from shapechanger.robot.twin.hardware import SteadyClock, TwinHardware
from shapechanger.robot.twin.ledger import TwinWiring
from shapechanger.robot.twin.pin_board import PinBoard
from shapechanger.robot.twin.rpc import BoardClient

# Number of ticks within which the guard must arm, once all speed controllers are ready.
_MAX_ARM_TICKS: Final = 10


class _Clock(SteadyClock):
    """Clock of a board in this process; its `wait` calls `wait_until` of the board."""

    def __init__(self, board: LocalBoard) -> None:
        self._board = board

    def now_ns(self) -> int:
        return self._board.t

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        return self._board.wait_until(until_ns)


class LocalBoard(BoardClient):
    """A board with its world in this process, whose time only `advance` advances."""

    clock = "twin"

    def __init__(self, wiring: TwinWiring, world: World, seed: int = 0) -> None:
        self.t = START_NS  # Time, ns.
        self.pid = os.getpid()
        self.pins = PinBoard(wiring, world, None, seed, lambda: self.t)
        self.levels: dict[int, int] = {}
        self.watchers: dict[int, Callable[[int, int], None]] = {}
        self.while_held_up: Callable[[], object] = lambda: None
        self.hardware = TwinHardware(self, _Clock(self))
        self._closed = False

    @property
    def closed(self) -> bool:
        return self._closed

    def advance(self, now_ns: int) -> None:
        self.t = now_ns
        for t, pin, level in self.pins.advance(now_ns):
            if pin in self.levels:
                self.levels[pin] = level
                if pin in self.watchers:
                    self.watchers[pin](level, t)

    def wait_until(self, until_ns: int) -> bool:
        raise RobotError("The time of a board in this process advances only by `advance`.")

    def pass_ns(self, ns: int) -> None:
        self.advance(self.t + ns)

    def post(self, function: str, *arguments: Any) -> None:
        self.ask(None, function, *arguments)

    def ask(self, kind: Any, function: str, *arguments: Any) -> Any:
        called = getattr(self.pins, function)
        takes_caller = "caller" in signature(called).parameters
        return called(self, *arguments) if takes_caller else called(*arguments)

    def close(self) -> None:
        self._closed = True


class _Orders:
    """Orders to the guard, and the newest state of the guard; see `DaemonChannel`."""

    lost = False

    def __init__(self) -> None:
        self.waiting: list[Order] = []
        self.state = cast("GuardState", None)  # Set at the guard's first tick.
        self.refused = ""

    def filenos(self) -> list[int]:
        return []

    def orders(self) -> tuple[list[Order], list[str]]:
        orders, self.waiting = self.waiting, []
        return orders, []

    def send(self, state: GuardState) -> bool:
        self.state = state
        self.refused = state.refused or self.refused
        return True


class InProcessRobot:
    """A robot in a world, advanced step by step."""

    def __init__(
        self,
        profile: Profile,
        world: World,
        *,
        pictures: bool = True,
        wired_as: GuardPlan | None = None,
    ) -> None:
        self._deadline_ms = profile.limits.deadline_ms
        self._plan = profile.guard_plan()
        self._wiring = TwinWiring(self._plan if wired_as is None else wired_as)
        self._world = world
        self._camera = profile.camera if pictures else None
        self._tick_ns = round(1e9 / self._plan.tick_hz)
        self._period_ns = round(1e9 / profile.control_hz)
        card = card_of(profile, arming="anyone", clock="twin", pictures=pictures)
        self.welcome = Welcome(**msgspec.structs.asdict(card), session=1)
        self._guard: Guard | None = None
        # The hub numbers the images, and is kept through all starts.
        clock = cast("SteadyClock", SimpleNamespace(now_ns=lambda: self.now_ns))
        self._hub = SessionHub(DaemonPlan(card=card), clock, self._send)
        self._client = Client(1)
        self._hub.take(self._client)
        self._start()

    @property
    def now_ns(self) -> int:
        return self._board.t

    @property
    def pins(self) -> PinBoard:
        """Pins, chips and servos, since the last start."""
        return self._board.pins

    def start(self, place: Callable[[], object] | None = None) -> Observation:
        """Restart and arm the robot; `place` places the vehicle before and after arming."""
        if place is not None:
            place()  # Otherwise a moving vehicle would roll on while the robot starts.
        self._start()
        # Speed controllers must have seen neutral for long enough.
        settings = (output.settings for output in self._plan.outputs)
        self._advance(round(max((one.get("arm_s", 0.0) for one in settings), default=0.0) * 1e9))
        self.arm()
        if place is not None:
            place()
            # Like a served robot, send the first observation after one period.
            self._advance(self._period_ns)
        return self._observe()

    def step(self, values: Sequence[float]) -> tuple[Observation, bool]:
        """Advance one control period with a command; return the observation and if it bumped."""
        bumps = self._orders.state.bumps
        self._seq += 1
        command = Command(seq=self._seq, answers=0, values=tuple(values), ttl_ms=self._deadline_ms)
        self._hub.command(self._client, command)
        self._advance(self._period_ns)
        return self._observe(), self._orders.state.bumps > bumps

    def arm(self) -> None:
        """Arm the robot, as a person does after a stop; raise RobotError if it does not arm."""
        orders = self._orders
        refused, orders.refused = "", ""  # Discard the refusals of earlier orders.
        seen = orders.state.emergencies
        for _ in range(_MAX_ARM_TICKS):
            orders.waiting.append(Order("arm", issued_ns=self.now_ns, emergency=seen, person=True))
            self._advance(self._tick_ns)
            refused, orders.refused = orders.refused, ""
            if orders.state.armed and not refused:
                return
        raise RobotError(f"The robot does not arm: {refused or orders.state.stop_reason}")

    def close(self) -> None:
        if self._guard is not None:
            self._guard.close()
            self._board.hardware.close()
            self._guard = None

    def _start(self) -> None:
        self.close()
        self._board = LocalBoard(self._wiring, self._world)
        self._orders = _Orders()
        channel = cast("DaemonChannel", self._orders)
        self._guard = Guard(self._plan, self._board.hardware, channel, logging.getLogger(__name__))
        self._seq = self._observed = 0
        self._advance(self._period_ns)

    def _send(self, order: Order) -> None:
        # The guard requires the time of a frame, also if this robot renders no image.
        self._orders.waiting.append(msgspec.structs.replace(order, frame_ns=self.now_ns))

    def _advance(self, ns: int) -> None:
        assert self._guard is not None
        end_ns = self.now_ns + ns
        while self.now_ns < end_ns:
            self._board.advance(min(self.now_ns + self._tick_ns, end_ns))
            self._guard.round(self.now_ns)

    def _observe(self) -> Observation:
        self._observed += 1
        if self._camera is not None:
            image = np.ascontiguousarray(self._world.picture())
            jpeg = simplejpeg.encode_jpeg(image, self._camera.jpeg_quality, "RGB", "444")
            self._hub.on_frame(Frame(jpeg, self.now_ns))
        self._hub.on_state(self._orders.state)
        return self._hub.observation(self._client, self._observed, self._hub.frame_seq - 1)
