"""A whole robot on a twin in this process: its guard, its drivers, its pins and its world.

What a served robot does in a guard, a daemon and a board is done here by the same code in one call:
`step` hands a command to the guard and lets one control period go by. There is no link, no lease
and no deadline to miss; time moves only in steps, as with `--clock twin`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
import simplejpeg

from shapechanger.errors import RobotError
from shapechanger.link.messages import Observation, Welcome
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.observation import NumberedFrame, StateReader, build_observation
from shapechanger.robot.drivers.settings import number
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.guard.process import Guard
from shapechanger.robot.guard.wire import GuardState, Order
from shapechanger.robot.profile.profile import Profile
from shapechanger.twin.local import LocalBoard
from shapechanger.twin.pin_board import PinBoard
from shapechanger.twin.rig import Rig
from shapechanger.twin.wiring import Wiring
from shapechanger.worlds.world import World

__all__ = ["InProcessRobot"]

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
        self._wiring = Wiring(self._plan if wired_as is None else wired_as)
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
