"""A fixed control rate, on a clock that is handed in."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Literal

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.remote.operator import Preparation, Takeover
from shapechanger.errors import LinkError, RenderError, RobotRefused, UnknownName
from shapechanger.layout import Layout
from shapechanger.link.messages import Observation, Pace, Role, Welcome
from shapechanger.remote.client import RobotClient
from shapechanger.remote.inbox import Received
from shapechanger.remote.known_robots import KnownRobot, known_names, recall
from shapechanger.remote.observations import BUMP, RobotSpaces, StepScorer, View
from shapechanger.tasks.drive import DriveReward

__all__ = ["LATE", "OnReset", "RemoteVehicleEnv", "Schedule", "frame_age_s", "latencies"]

LATE: Final = 0.5
"""By how much of a period a step may end late without having missed its deadline."""


class Schedule:
    """Ticks of equal distance, in step with the robot.

    A step that ends a little late because this machine is slow is made up for by a shorter one, so
    that the mean rate holds. Where the robot's observation came after the tick, the ticks go on
    from there: two clocks are never equally fast, and the one who waits follows the other. A step
    that misses its deadline is not made up for either, because two commands in quick succession are
    worse than one that was late.

    Args:
        period_s: Time from tick to tick, s.
        clock: The time, s; never runs backwards.
    """

    def __init__(self, period_s: float, clock: Callable[[], float]) -> None:
        self._period_s = period_s
        self._clock = clock
        self._tick = clock()

    def start(self) -> None:
        """Let the first step begin now."""
        self._tick = self._clock()

    @property
    def left_s(self) -> float:
        """Time until the step should end, s; below zero when it is late."""
        return self._tick + self._period_s - self._clock()

    def advance(self, arrived_at: float) -> bool:
        """End a step and begin the next.

        Args:
            arrived_at: When the observation came that ends it, s.

        Returns:
            Whether it missed its deadline.
        """
        end = self._tick + self._period_s
        now = self._clock()
        missed = now - end > LATE * self._period_s
        self._tick = now if missed else max(end, arrived_at)
        return missed


_NS_PER_S: Final = 1e9


def latencies(
    answered: Observation,
    seq: int,
    sent_at: float,
    received: Received,
    clock: Literal["real", "twin"] = "real",
) -> dict[str, float]:
    """What can be said about the delays of a step, s; what cannot be measured is left out.

    Args:
        answered: The observation that the command was decided on.
        seq: Number of the command.
        sent_at: When it was sent, s of this machine's clock.
        received: The observation after it.
        clock: The robot's clock; a twin's seconds are not ours, so nothing is said of both.

    Returns:
        `capture_to_send`: from the picture to its departure, by the robot's clock. If the robot
        acted on this very command, also `round_trip`: on the way there and back, without the time
        that the robot had it; `observation_age_at_action`: how old the picture was that the command
        answers when the command arrived; `command_to_pin`: from its arrival to the outputs.
    """
    seen = received.message
    known = {"capture_to_send": (seen.sent_ns - seen.captured_ns) / _NS_PER_S}
    if seen.applied_seq != seq or not seen.mine:
        return known
    if seen.command_ns is not None:
        on_robot = (seen.sent_ns - seen.command_ns) / _NS_PER_S
        if clock == "real":
            known["round_trip"] = received.received_at - sent_at - on_robot
        known["observation_age_at_action"] = (seen.command_ns - answered.captured_ns) / _NS_PER_S
    if seen.command_ns is not None and seen.applied_ns is not None:
        known["command_to_pin"] = (seen.applied_ns - seen.command_ns) / _NS_PER_S
    return known


def frame_age_s(received: Received, now: float) -> float:
    """How old the picture of an observation is, s, without its time on the way.

    Args:
        received: The observation.
        now: This machine's clock, s.
    """
    seen = received.message
    return (seen.sent_ns - seen.captured_ns) / _NS_PER_S + now - received.received_at


OnReset = Literal["operator", "person", "routine"] | Callable[[int | None], object]
"""Who brings the robot to the start."""

_WAYS_TO_RESET: Final = ("operator", "person", "routine")
# s. How long a robot that waits for us, and so never hurries, may take for a step.
_LOCKSTEP_S: Final = 10.0


class RemoteVehicleEnv(gym.Env[Any, NDArray[np.float32]]):
    """Drive a car, a boat, a tank, a cat or a finger that is somewhere else.

    ## Action space
    One number for each action of the robot, in the order of `action_layout`: for vehicles
    `[steering, throttle]` in [-1, 1], where -1 steers left and +1 drives forward. (In ROS it is the
    other way round: left is positive.) Actions of one side, such as tendons, are in [0, 1].

    ## Observation space
    The camera's picture, RGB, `uint8`, shape (height, width, 3), (120, 160, 3) by default; with
    `state=True` a Dict of `image` and `state`; the state alone for a robot without a camera. What
    the numbers of the state are is in `observation_layout`.

    ## Reward
    The sum of `info["reward_terms"]`, each of which is in `info` itself too, see `DriveReward`:
    metres forward, collisions, seconds of being stuck. `info["reward_sources"]` says of `speed`,
    `collision` and `stall` which sensor it comes from, or "estimated", or "absent"; the term of
    what is absent is left out.

    ## Start
    `reset` waits until the robot is armed by its operator, or runs the routine of its profile. The
    first observation is of the time after that.

    ## End
    Terminated by a collision, unless the reward says otherwise. Truncated when the link is lost, at
    an emergency stop, when the robot is disarmed and when somebody else takes it;
    `info["truncated_because"]` says why. After a lost link the observation is the last one, and
    the next `reset` connects again. With `interventions=True` a person may take the robot without
    ending the episode: the program's actions are then only shown to them, and when they give it
    back and arm it, the program drives on.

    ## Info
    `action_applied` and `stop_reason`: what the robot does, and why it is not what it was told;
    `refused`: why it refused the command of this step; `events`: what happened, in sentences;
    `latency`, s, see `latencies`; `frame_age`, s, and `frame_repeated`; `deadline_missed`: steps of
    this episode that ended half a period late or more; `armed`, `emergency`; `absent`: numbers of
    the state that nothing measures now, which are the middle of their range; `captured_ns` and
    `decided_ns`: when the picture was taken and when the command behind what the robot does
    arrived there, ns of the robot's clock; `intervene_action`: what a person commands in place of
    the program, and only while one does.

    Args:
        robot: Name of a robot that is remembered, or its address as HOST or HOST:PORT.
        key: The robot's key, for an address.
        fingerprint: SHA-256 of its certificate, for an address; "insecure" for no encryption.
        size: Width and height of the pictures, (128, 128) as in 2017; see `picture.resized`.
        state: Whether observations have the state besides the picture.
        image: Whether they have a picture; None for when the robot has a camera.
        pace: "realtime": a step lasts one control period of the robot; "lockstep": the robot waits
            for each command and answers one period later.
        reward: Weights that replace those of the robot's profile, by name.
        on_reset: "operator": a person puts the robot back and arms it; where anyone may, it is
            armed at once. "person": a person arms it in any case. "routine": the commands of the
            profile. Or what to call with the seed.
        on_waiting: Is told in a sentence what a reset waits for; None for a warning in the log of
            `shapechanger.envs.remote.operator` once it waits for 2 s.
        reset_timeout_s: How long a reset may wait, s.
        max_observation_age_s: How long a step may wait for an observation, s; None for as long as
            the robot takes an answer to one.
        timeout_s: How long the robot may be silent until the link is lost, s.
        interventions: Whether a person may take the robot and give it back within an episode.
        role: Who drives.
        name: Who connects, for people to read.
        render_mode: "rgb_array" for `render` to give the robot's newest picture at its own size.

    Raises:
        UnknownName: If no robot of this name is known, or no weight or way to reset.
        LinkError: If the robot cannot be reached, or is not trusted.
        RobotRefused: If it does not want us, or its time moves in steps and the pace is "realtime".
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012  # Gymnasium's.

    def __init__(
        self,
        robot: str,
        *,
        key: str = "",
        fingerprint: str = "",
        size: Sequence[int] = (160, 120),
        state: bool = False,
        image: bool | None = None,
        pace: Pace = "realtime",
        reward: Mapping[str, float] | None = None,
        on_reset: OnReset = "operator",
        on_waiting: Callable[[str], object] | None = None,
        reset_timeout_s: float = 60.0,
        max_observation_age_s: float | None = None,
        timeout_s: float = 2.0,
        interventions: bool = False,
        role: Role = "program",
        name: str = "",
        render_mode: str | None = None,
    ) -> None:
        self._arguments = {n: v for n, v in locals().items() if n not in ("self", "__class__")}
        if not callable(on_reset) and on_reset not in _WAYS_TO_RESET:
            raise UnknownName("way to reset", on_reset, _WAYS_TO_RESET)
        self._robot = _found(robot)
        self._key, self._fingerprint = key, fingerprint
        self._pace: Pace = pace
        self._role: Role = role
        self._name = name
        self._takeover = Takeover(allowed=interventions)
        self._on_reset = on_reset
        self._on_waiting = on_waiting
        self._reset_timeout_s = reset_timeout_s
        self._timeout_s = timeout_s
        self.render_mode = render_mode
        self._clock = time.monotonic
        self._frames = image is not False or render_mode == "rgb_array"
        self._client = self._connect()
        try:
            welcome = self._client.welcome
            wide, high = size
            self._senses = RobotSpaces(welcome, (int(wide), int(high)), image, state)
            weights = DriveReward.from_weights({**welcome.reward, **(reward or {})})
            self._judge = StepScorer(self._senses, weights)
            if pace == "realtime" and welcome.clock == "twin":
                raise RobotRefused(
                    f"The time of {welcome.robot} moves only in steps (`serve --clock twin`), so "
                    "its commands would be old before they act: pass pace='lockstep'."
                )
        except BaseException:
            self._client.close()
            raise
        self.observation_space = self._senses.observation_space
        self.action_space = self._senses.action_space
        self.metadata = {**self.metadata, "render_fps": welcome.control_hz}
        longest_s = welcome.max_observation_age_ms / 1e3
        self._patience_s = max_observation_age_s or longest_s
        if pace == "lockstep":
            self._patience_s = _LOCKSTEP_S
        self._schedule = Schedule(1.0 / welcome.control_hz, self._clock)
        self._last: Received | None = None
        self._last_view: View | None = None
        self._missed = 0
        self._has_stepped = False

    @property
    def welcome(self) -> Welcome:
        """What the robot says it is."""
        return self._client.welcome

    @property
    def newest_jpeg(self) -> bytes | None:
        """The picture in the newest observation, as the robot sent it; None without one."""
        return None if self._last is None or not self._senses.has_image else self._last.jpeg

    @property
    def record_clock(self) -> Literal["real", "twin"]:
        """Where the nanoseconds in `info` come from."""
        return self.welcome.clock

    @property
    def action_layout(self) -> Layout:
        """What the numbers of an action mean."""
        return self._senses.action_layout

    @property
    def observation_layout(self) -> Layout:
        """What the numbers of an observation mean; a picture is the one block `camera/image`."""
        return self._senses.observation_layout

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Bring the robot to the start, and see what it sees there.

        Args:
            seed: Goes to `on_reset`, where that is a function; a robot has no seed.
            options: None are known.

        Raises:
            RobotRefused: If the robot was not armed in time, or does not want us.
            LinkError: If the robot cannot be reached in time.
        """
        super().reset(seed=seed)
        called = self._robot.name if isinstance(self._robot, KnownRobot) else ""
        ready = Preparation(self._reset_timeout_s, self._on_waiting, self._clock, called)
        if not self._client.alive:
            self._client = ready.connect(self._connect)
        robot = self._client
        if self._on_reset == "routine":
            ready.require_routine(robot)
        ready.take(robot)
        # A hand that puts it back must not hold an armed robot, nor the last command act on; and
        # whoever arms it then says by that that it is at the start.
        if self._on_reset != "routine" and self._has_stepped:
            ready.disarm(robot)
        if callable(self._on_reset):
            self._on_reset(seed)
        ready.arm(robot, self._role, by_person=self._on_reset == "person")
        if self._on_reset == "routine":
            ready.play(robot)
        received = ready.first(robot, self._senses.rest, self._is_after)
        view = self._senses.view(received)
        self._last, self._last_view = received, view
        self._judge.start(received.message)
        self._takeover.start()
        self._missed, self._has_stepped = 0, False
        robot.events()  # What happened before is not of this episode.
        return view.observation, self._info(received, view)

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Act on the newest observation, and see what comes of it.

        Raises:
            SpaceMismatch: If the action does not fit the robot.
            ResetNeeded: If the link was lost, or `reset` was never called.
        """
        last, robot = self._last, self._client
        if last is None:
            raise gym.error.ResetNeeded(
                "Call reset() before the first step, and after a lost link."
            )
        values = self._senses.values(action)
        if not self._has_stepped:
            self._schedule.start()
            self._has_stepped = True
        sent_at = self._clock()
        try:
            seq = self._takeover.act(robot, values, last.message)
            received = self._next(robot, last, sent_at)
            view = self._senses.view(received)
        except LinkError as failure:
            return self._cut(last, str(failure))
        late = self._schedule.advance(received.received_at)
        self._missed += late and self._pace == "realtime"
        events = robot.events()
        bumped = any(event.name == BUMP for event in events)
        terminated, terms = self._judge.judge(last.message, received.message, bumped)
        info = self._info(received, view)
        info |= terms
        info["reward_terms"] = terms
        info["events"] = tuple(event.text for event in events)
        info["refused"] = robot.refusal(seq)
        clock = robot.welcome.clock
        info["latency"] = latencies(last.message, seq, sent_at, received, clock)
        is_lent = self._takeover.goes_on(received.message)
        info["truncated_because"] = "" if is_lent else _interruption(received.message)
        self._last, self._last_view = received, view
        truncated = not terminated and bool(info["truncated_because"])
        return view.observation, sum(terms.values()), terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The robot's newest picture, shape (height, width, 3); None without a render mode.

        Raises:
            RenderError: If there is none.
        """
        if self.render_mode is None:
            return None
        newest = self._client.newest
        if newest is not None:
            self._senses.shows(newest)
        if self._senses.picture is None:
            raise RenderError(f"{self.welcome.robot} has sent no picture: has it a camera?")
        return self._senses.picture.copy()

    def close(self) -> None:
        """Stop the robot and give it back."""
        if self._client.alive:
            self._client.release()
        self._client.close()
        self._last = None

    def __getstate__(self) -> dict[str, Any]:
        """The arguments: a connection cannot be copied."""
        return {"arguments": self._arguments, "spec": self.spec}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Connect anew."""
        type(self).__init__(self, **state["arguments"])
        self.spec = state["spec"]

    def _connect(self) -> RobotClient:
        client = RobotClient.connect(
            self._robot,
            key=self._key,
            fingerprint=self._fingerprint,
            role=self._role,
            name=self._name,
            pace=self._pace,
            frames=self._frames,
            timeout_s=self._timeout_s,
        )
        # An env that is dropped without being closed must not keep the robot from others.
        weakref.finalize(self, client.abandon)
        return client

    def _is_after(self, received: Received, now_ns: int) -> bool:
        """Whether an observation was made, picture and all, after a time of the robot."""
        message = received.message
        if message.state_ns <= now_ns:
            return False
        if not self._senses.has_image:
            return True
        return message.captured_ns > now_ns and self._senses.shows(received)

    def _next(self, robot: RobotClient, last: Received, sent_at: float) -> Received:
        """The newest observation at the end of the control period, and in any case a new one."""
        if self._pace == "lockstep":
            return robot.observation(last.message.seq, self._patience_s)
        left_s = max(0.0, self._schedule.left_s)
        found = robot.observation(last.message.seq, left_s + self._patience_s)
        while found.received_at <= sent_at:  # It was on its way already.
            found = robot.observation(found.message.seq, left_s + self._patience_s)
        while (left_s := self._schedule.left_s) > 0.0:
            robot.acknowledge()
            newer = robot.newer(found.message.seq, left_s)
            found = newer or found
        return found

    def _cut(self, last: Received, because: str) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """The end of an episode of which nothing more is known."""
        view = self._senses.view(last)
        info = self._info(last, view)
        terms = dict.fromkeys(self._judge.judge(last.message, last.message, False)[1], 0.0)
        info |= terms
        info |= {
            "reward_terms": terms,
            "events": (),
            "refused": "",
            "latency": {},
            "truncated_because": because,
            "frame_repeated": True,
        }
        self._last = None
        return view.observation, 0.0, False, True, info

    def _info(self, received: Received, view: View) -> dict[str, Any]:
        message = received.message
        info: dict[str, Any] = {
            "action_applied": np.array(message.action_applied, np.float32),
            "stop_reason": message.stop_reason,
            "armed": message.armed,
            "emergency": message.emergency,
            "absent": view.absent,
            "reward_sources": self._judge.sources(message),
            "deadline_missed": self._missed,
            "captured_ns": message.captured_ns,
            "decided_ns": message.command_ns,
        }
        by_person = self._takeover.action(message) if self._role == "program" else None
        if by_person is not None:
            info["intervene_action"] = np.array(by_person, np.float32)
        if self._senses.has_image:
            info["frame_age"] = frame_age_s(received, self._clock())
            info["frame_repeated"] = not view.fresh
        return info


def _found(robot: str) -> KnownRobot | str:
    """The robot that is remembered under a name, or an address."""
    if robot in known_names():
        return recall(robot)
    if "." in robot or ":" in robot or robot == "localhost":
        return robot
    raise UnknownName("known robot", robot, known_names())


def _interruption(message: Observation) -> str:
    """Why an episode cannot go on, in words; empty when it can."""
    why = f": {message.stop_reason}" if message.stop_reason else "."
    if not message.mine:
        return f"{message.holder or 'Nobody'} commands the robot now{why}"
    if message.emergency:
        return f"Emergency stop{why}"
    if not message.armed:
        return f"The robot was disarmed{why}"
    return ""
