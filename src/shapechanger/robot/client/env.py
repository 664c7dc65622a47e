"""Gymnasium env of a vehicle or another robot on the network."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from typing import Any, Final, Literal

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.drive_reward import DriveReward
from shapechanger.errors import LinkError, RenderError, RobotRefused, StaleObservation, UnknownName
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.connection import Received
from shapechanger.robot.client.known_robots import known_names, recall
from shapechanger.robot.client.observations import RobotSpaces, View
from shapechanger.robot.client.operator import Preparation, Takeover, interruption
from shapechanger.robot.link.messages import Observation, Pace, Role, Welcome

OnReset = Literal["operator", "person", "routine"] | Callable[[int | None], object]
"""How the robot is returned to its start; see `RemoteVehicleEnv`."""

LATE: Final = 0.5
"""Longest delay of a step that meets its deadline, as a fraction of the control period."""

_WAYS_TO_RESET: Final = ("operator", "person", "routine")
_LOCKSTEP_S: Final = 10.0  # Time limit of a step in lockstep, where a robot waits for the env.
_NS_PER_S: Final = 1e9
# Features of the state that may measure each quantity of the reward; the first measured one counts.
_QUANTITIES: Final = {"speed": ("speed",), "collision": ("collision", "bump"), "stall": ("stall",)}


class RemoteVehicleEnv(gym.Env[Any, NDArray[np.float32]]):
    """Env of a robot on the network, such as a car, a boat or a finger.

    ## Action space
    `Box(float32)`, one number for each action of the robot, in the order of `action_layout`.
    One-sided actions, such as tendons, are in [0, 1]. For vehicles -1 steers left and +1 drives
    forward. (In ROS positive is left.) For the profile `car`:

    | Num | Action     | Min | Max | Unit |
    | --- | ---------- | --- | --- | ---- |
    | 0   | `steering` | -1  | 1   | 1    |
    | 1   | `throttle` | -1  | 1   | 1    |

    ## Observation space
    The camera's image, RGB, `uint8`, shape (height, width, 3), (120, 160, 3) by default; with
    `state=True` a Dict of `image` and `state`; the state alone for a robot without a camera. The
    state is `float32`: the quantities that the robot's sensors measure, then the applied actions.
    `observation_layout` describes it. For the profile `car`, which ships without sensors:

    | Num | Observation        | Min | Max | Unit |
    | --- | ------------------ | --- | --- | ---- |
    | 0   | `steering/applied` | -1  | 1   | 1    |
    | 1   | `throttle/applied` | -1  | 1   | 1    |

    ## Reward
    The sum of the terms of `DriveReward`, for the speed v along the heading, m/s, and the time dt
    between two states, s. The profile sets the weights, 1, -10 and -1 by default; `reward` replaces
    them. Terms of quantities that are not measured are left out. `info["reward_sources"]` names the
    source of `speed`, `collision` and `stall`: a sensor, "estimated" or "absent".

    ```text
    reward_velocity  =   1 dt v
    reward_collision = -10 if there is a new collision
    reward_stall     =  -1 dt while the robot pushes without moving
    ```

    ## Start
    `reset` takes control, waits until the robot is armed (see `on_reset`), and runs the profile's
    reset routine with `on_reset="routine"`. The first observation is captured after that.

    ## End
    Terminated by a collision, unless the reward is set otherwise. Truncated when the link is lost,
    at an emergency stop, when the robot is disarmed and when another client takes control;
    `info["truncated_because"]` is the reason. After a lost link the observation is the last one,
    and the next `reset` connects again. With `interventions=True` a person may take control within
    an episode. The program's actions then have no effect, and are shown as suggestions, until the
    person gives control back and arms the robot.

    ## Info
    `action_applied`: applied outputs; `stop_reason`: why they differ from the action; `refused`:
    why the robot refused the command of this step; `events`: the robot's events, as sentences;
    `latency`: delays, s, see `latencies`; `frame_age`, s; `frame_repeated`: whether the image is
    the previous one; `deadline_missed`: number of steps in this episode that ended more than half a
    period late, 0 in lockstep; `armed`, `emergency`; `absent`: features of the state without
    a measurement, which have the middle of their range; `captured_ns` and `decided_ns`: capture
    time of the frame, and arrival time of the applied command, ns of the robot's clock;
    `intervene_action`: command of a person who has control instead of the program; after a step
    `reward_terms`, whose terms are also keys of `info`.

    ## Versions
    v1: the first.

    Args:
        robot: Name of a known robot, or its address, HOST or HOST:PORT.
        key: The robot's key, for an address.
        fingerprint: SHA-256 of its certificate, for an address; "insecure" for no encryption.
        size: Width and height of the images, pixels, such as (128, 128), the size of this project's
            original release of 2017; see `resize_picture`. None for the camera's size.
        state: Whether observations have the state in addition to the image.
        image: Whether observations have an image; by default, if the robot has a camera.
        pace: "realtime": a step lasts one control period of the robot; "lockstep": the robot waits
            for each command and answers one period later.
        reward: Weights that replace the profile's, keyed by name.
        on_reset: "operator": a person puts the robot back and arms it; if anyone may arm it, the
            env arms it at once. "person": only a person arms it. "routine": the reset routine of
            the profile. A function is called with the seed.
        on_waiting: Called with a sentence that describes what a reset waits for; None for a warning
            in the log of `shapechanger.robot.client.operator`.
        reset_timeout_s: Time limit of a reset, s.
        timeout_s: Silence of the robot after which the link is lost, s.
        interventions: Whether a person may take control and give it back within an episode.
        role: Whether a person or a program drives.
        name: Display name of the client.
        render_mode: "rgb_array" makes `render` return the newest frame at the camera's size.

    Attributes:
        action_layout: Layout of an action.
        observation_layout: Layout of an observation; an image is the one block `camera/image`.
        record_clock: Source of the times in `info`, "real" or "twin".

    Raises:
        UnknownName: If a robot, a weight or a way to reset is unknown.
        LinkError: If the robot cannot be reached, or is not trusted.
        RobotRefused: If the robot refuses the client, or its time moves in steps and the pace is
            "realtime".
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012  # Gymnasium's.

    def __init__(
        self,
        robot: str,
        *,
        key: str = "",
        fingerprint: str = "",
        size: Sequence[int] | None = (160, 120),
        state: bool = False,
        image: bool | None = None,
        pace: Pace = "realtime",
        reward: Mapping[str, float] | None = None,
        on_reset: OnReset = "operator",
        on_waiting: Callable[[str], object] | None = None,
        reset_timeout_s: float = 60.0,
        timeout_s: float = 2.0,
        interventions: bool = False,
        role: Role = "program",
        name: str = "",
        render_mode: str | None = None,
    ) -> None:
        self._arguments = {n: v for n, v in locals().items() if n not in ("self", "__class__")}
        if not callable(on_reset) and on_reset not in _WAYS_TO_RESET:
            raise UnknownName("way to reset", on_reset, _WAYS_TO_RESET)
        is_address = "." in robot or ":" in robot or robot == "localhost"
        known_as = "" if is_address and robot not in known_names() else robot
        self._prepare = partial(Preparation, reset_timeout_s, on_waiting, known_as)
        self._open = partial(
            RobotClient.connect,
            recall(robot) if known_as else robot,
            key=key,
            fingerprint=fingerprint,
            role=role,
            name=name,
            pace=pace,
            frames=image is not False or render_mode == "rgb_array",
            timeout_s=timeout_s,
        )
        self._pace: Pace = pace
        self._role: Role = role
        self._interventions = interventions
        self._on_reset = on_reset
        self.render_mode = render_mode
        with ExitStack() as opened:
            self._client = self._connect()
            opened.callback(self._client.close)
            welcome = self._client.welcome
            wide, high = size or welcome.image_size or (160, 120)
            self._spaces = RobotSpaces(welcome, (int(wide), int(high)), image, state)
            self._reward = DriveReward.from_weights({**welcome.reward, **(reward or {})})
            if pace == "realtime" and welcome.clock == "twin":
                raise RobotRefused(
                    f"The time of {welcome.robot} moves only in steps (`serve --clock twin`), so "
                    "commands would expire before they act: pass pace='lockstep'."
                )
            opened.pop_all()
        self.observation_space = self._spaces.observation_space
        self.action_space = self._spaces.action_space
        self.observation_layout = self._spaces.observation_layout
        self.action_layout = self._spaces.action_layout
        self.record_clock = welcome.clock
        self.metadata = {**self.metadata, "render_fps": welcome.control_hz}
        longest_s = welcome.max_observation_age_ms / 1e3
        self._patience_s = _LOCKSTEP_S if pace == "lockstep" else longest_s
        self._period_s = 1.0 / welcome.control_hz
        self._last: Received | None = None
        self._has_stepped = False

    @property
    def welcome(self) -> Welcome:
        """Description of the robot."""
        return self._client.welcome

    @property
    def newest_jpeg(self) -> bytes | None:
        """JPEG of the newest observation's frame, as the robot sent it; None without a frame."""
        return None if self._last is None or not self._spaces.has_image else self._last.jpeg

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Bring the robot to the start, and return the first observation.

        Args:
            seed: Passed to `on_reset` if that is a function; a robot has no seed.
            options: Unused.

        Raises:
            RobotRefused: If the robot was not armed in time, or refuses the client.
            LinkError: If the robot cannot be reached in time.
        """
        super().reset(seed=seed)
        ready = self._prepare()
        if not self._client.alive:
            self._client = ready.connect(self._connect)
            self._spaces.reconnect()
        robot = self._client
        if self._on_reset == "routine" and not robot.welcome.reset:  # Before the robot moves.
            raise RobotRefused(
                f"The profile of {robot.welcome.robot} has no reset routine: add [[reset]] tables "
                "to it, or let its operator put it back with on_reset='operator'."
            )
        ready.take(robot)
        # An armed robot must not be carried, and the last command must not stay in force. Arming
        # the robot again confirms that it is at the start.
        if self._on_reset != "routine" and self._has_stepped:
            ready.disarm(robot)
        if callable(self._on_reset):
            self._on_reset(seed)
        ready.arm(robot, self._role, by_person=self._on_reset == "person")
        if self._on_reset == "routine":
            ready.play(robot)
        self._last = received = ready.first(robot, self._spaces)
        view = self._spaces.view(received)
        self._touches = False
        self._reward_of(received.message, received.message)  # Contacts at the start do not count.
        self._takeover = Takeover(allowed=self._interventions)
        self._missed, self._has_stepped = 0, False
        robot.events()  # Drop events from before the episode.
        return view.observation, self._info(received, view)

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Send a command in answer to the last observation, and wait for the next one.

        Raises:
            SpaceMismatch: If the action does not fit the robot.
            ResetNeeded: If the link was lost, or `reset` was never called.
        """
        last, robot = self._last, self._client
        if last is None:
            raise gym.error.ResetNeeded(
                "Call reset() before the first step, and after a lost link."
            )
        values = self._spaces.values(action)
        if not self._has_stepped:
            self._ends, self._has_stepped = time.monotonic() + self._period_s, True
        sent_at = time.monotonic()
        try:
            seq = self._takeover.act(robot, values, last.message)
            received = self._next(robot, last, sent_at)
            view = self._spaces.view(received)
        except LinkError as failure:
            self._last = None
            view = self._spaces.view(last)
            terms = dict.fromkeys(self._reward_of(last.message, last.message)[0], 0.0)
            info = self._info(last, view, truncated_because=str(failure), reward_terms=terms)
            info |= terms | {"events": (), "refused": "", "latency": {}, "frame_repeated": True}
            return view.observation, 0.0, False, True, info
        begins, late = next_tick(self._ends, self._period_s, received.received_at, time.monotonic())
        self._ends = begins + self._period_s
        self._missed += late and self._pace == "realtime"
        events = robot.events()
        bumped = any(event.name == "bump" for event in events)
        terms, terminated = self._reward_of(last.message, received.message, bumped)
        is_lent = self._takeover.goes_on(received.message)
        because = "" if is_lent else interruption(received.message)
        info = self._info(received, view, truncated_because=because, reward_terms=terms) | terms
        info["events"] = tuple(event.text for event in events)
        info["refused"] = robot.refusal(seq)
        info["latency"] = latencies(last.message, seq, sent_at, received, self.welcome.clock)
        self._last = received
        truncated = not terminated and bool(because)
        return view.observation, sum(terms.values()), terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the newest frame, shape (height, width, 3); None without a render mode.

        Raises:
            RenderError: If the robot has sent no frame.
        """
        if self.render_mode is None:
            return None
        newest = self._client.newest
        if newest is not None:
            self._spaces.shows(newest)
        if self._spaces.picture is None:
            raise RenderError(f"{self.welcome.robot} has sent no image. Does it have a camera?")
        return self._spaces.picture.copy()

    def close(self) -> None:
        """Stop the robot, give control back, and end the connection."""
        if self._client.alive:
            self._client.release()
        self._client.close()
        self._last = None

    def __getstate__(self) -> dict[str, Any]:
        """Return the arguments, because a connection cannot be copied."""
        return {"arguments": self._arguments, "spec": self.spec}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Open a new connection."""
        type(self).__init__(self, **state["arguments"])
        self.spec = state["spec"]

    def _connect(self) -> RobotClient:
        client = self._open()
        # An env that is dropped without `close` must not keep control.
        weakref.finalize(self, client.abandon)
        return client

    def _next(self, robot: RobotClient, last: Received, sent_at: float) -> Received:
        """Wait for the end of the control period and for a new observation; return the newest."""
        if self._pace == "lockstep":
            return robot.observation(last.message.seq, self._patience_s)
        limit_s = max(0.0, self._ends - time.monotonic()) + self._patience_s
        found = robot.observation(last.message.seq, limit_s)
        while found.received_at <= sent_at:  # It was sent before the command.
            found = robot.observation(found.message.seq, limit_s)
        while (left_s := self._ends - time.monotonic()) > 0.0:
            robot.acknowledge()
            with suppress(StaleObservation):
                found = robot.observation(found.message.seq, left_s)
        return found

    def _reward_of(
        self, before: Observation, seen: Observation, bumped: bool = False
    ) -> tuple[dict[str, float], bool]:
        """Return the terms of a step's reward, and whether the episode ends."""
        speed, touches, stall = (
            self._spaces.quantity(seen, *names)[0] for names in _QUANTITIES.values()
        )
        hits = bool(touches) or bumped
        collided = None if touches is None else hits and not self._touches
        self._touches = hits
        dt_s = max(0, seen.state_ns - before.state_ns) / _NS_PER_S
        stalled = None if stall is None else bool(stall)
        terms = self._reward.terms(speed, collided, stalled, dt_s)
        return terms, self._reward.ends(collided)

    def _info(self, received: Received, view: View, **facts: Any) -> dict[str, Any]:
        message = received.message
        info = facts | {
            "action_applied": np.array(message.action_applied, np.float32),
            "stop_reason": message.stop_reason,
            "armed": message.armed,
            "emergency": message.emergency,
            "absent": view.absent,
            "reward_sources": {
                name: self._spaces.quantity(message, *names)[1]
                for name, names in _QUANTITIES.items()
            },
            "deadline_missed": self._missed,
            "captured_ns": message.captured_ns,
            "decided_ns": message.command_ns,
        }
        if self._role == "program" and (by_person := self._takeover.action(message)):
            info["intervene_action"] = np.array(by_person, np.float32)
        if self._spaces.has_image:
            on_robot_s = (message.sent_ns - message.captured_ns) / _NS_PER_S
            info["frame_age"] = on_robot_s + time.monotonic() - received.received_at
            info["frame_repeated"] = not view.fresh
        return info


def next_tick(end: float, period_s: float, arrived_at: float, now: float) -> tuple[float, bool]:
    """Return the time at which the next step begins, and whether this one missed its deadline.

    If this machine delays a step a little, the next one is shorter, so that the mean rate holds.
    If the robot's observation came after the end of the period, the next period starts at its
    arrival, because no two clocks are equally fast. A missed deadline also starts a new period,
    because two commands in quick succession are worse than a late one.
    """
    missed = now - end > LATE * period_s
    return now if missed else max(end, arrived_at), missed


def latencies(
    answered: Observation,
    seq: int,
    sent_at: float,
    received: Received,
    clock: Literal["real", "twin"] = "real",
) -> dict[str, float]:
    """Return the measurable delays of a step, s.

    The command `seq` was sent at `sent_at`, s, in answer to `answered`, and `received` followed.

    Returns:
        `capture_to_send` is the time from the capture of the frame to its sending, by the robot's
            clock. If the robot acted on this command, there are also `round_trip`: there and back,
            without the time on the robot, on real clocks only; `observation_age_at_action`: from
            the capture of the answered frame to the command's arrival; `command_to_pin`: from the
            command's arrival to the outputs.
    """
    seen = received.message
    known = {"capture_to_send": (seen.sent_ns - seen.captured_ns) / _NS_PER_S}
    if seen.applied_seq != seq or not seen.mine or seen.command_ns is None:
        return known
    known["observation_age_at_action"] = (seen.command_ns - answered.captured_ns) / _NS_PER_S
    if clock == "real":
        on_robot_s = (seen.sent_ns - seen.command_ns) / _NS_PER_S
        known["round_trip"] = received.received_at - sent_at - on_robot_s
    if seen.applied_ns is not None:
        known["command_to_pin"] = (seen.applied_ns - seen.command_ns) / _NS_PER_S
    return known
