"""Waypoints, the action that all vehicles share, and their conversion to and from steering.

Waypoint policies see the frames of all vehicles warped to one virtual camera.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, NamedTuple, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.pages import Page
from shapechanger.contract.world import STANDING_MPS, STANDING_RADPS
from shapechanger.errors import DemosError, ShapechangerError, SpaceMismatch, StudyError, WorldError
from shapechanger.layout import Element, Feature, Layout
from shapechanger.vehicles.cameras.rectify import (
    CANONICAL_SIZE,
    HALF_WIDTH_RAD,
    CameraGeometry,
    Rectifier,
)

if TYPE_CHECKING:
    from shapechanger.demos.dataset import Dataset

AHEAD_M: Final = 0.8
"""Distance of the waypoint, m: the look-ahead distance of a car at 1.8 m/s."""

WIDEST_RAD: Final = 1.0
"""Bearing of the waypoint at an action of -1 or 1, rad."""

LEAST_THROTTLE: Final = 0.25
"""Least throttle, in size, that overcomes the friction at rest of all vehicles."""

_SLOWEST_MPS: Final = 0.3  # Below this, a measured speed hardly predicts the next turn.
_AT_LOCK: Final = 0.99  # Steering from which a command counts as full.
# Constants of `fit_response`: largest change of a constant steering, lag of the turn, s, jitter of
# the steps' times, s, and smallest share of the turning that the steering must explain.
_CHANGE, _LAG_S, _JITTER_S, _EXPLAINED = 0.1, 0.1, 0.02, 0.5
_ROUNDING: Final = 1e-9
# Constants of `measure_response`: duration of the drive, s, and steps between random commands. The
# first half of the steps after a new command is ignored, because the motion is still changing.
_SECONDS, _HOLD = 5.0, 6
_MOTION: Final = ("steering/applied", "speed", "yaw_rate")


@dataclass(frozen=True, slots=True)
class SteeringResponse:
    """How fast a vehicle turns when it steers.

    rate of turn to the right = steering * (per_metre * speed + per_second). Wheels turn a vehicle
    faster when it rolls faster; tracks turn it even at rest.

    Raises:
        StudyError: If the vehicle does not turn, or a number is negative.
    """

    per_metre: float  # Turn for each metre at full steering, rad/m.
    per_second: float  # Turn for each second at full steering, rad/s.

    def __post_init__(self) -> None:
        if not (min(self.per_metre, self.per_second) >= 0.0 < self.per_metre + self.per_second):
            raise StudyError(
                "A vehicle must turn to the right when it steers to the right: the turn was "
                f"{self.per_metre:.2f} rad/m and {self.per_second:.2f} rad/s."
            )


def measure_response(env: gym.Env[Any, Any], speed_at: int, yaw_rate_at: int) -> SteeringResponse:
    """Measure how a vehicle turns, from 5 s of its motion at random steering and throttle.

    `speed_at` and `yaw_rate_at` are the indices of the speed, m/s, and of the rate of turn, rad/s,
    positive to the left, in the observed numbers. The env is reset.
    """
    from scipy.optimize import nnls  # Not installed on robots, which do not measure themselves.

    rng = np.random.default_rng(0)
    env.reset(seed=0)
    command = np.zeros(2, np.float32)
    turning: list[tuple[float, float]] = []
    rates: list[float] = []
    step = -1  # Number of steps since the last reset.
    for _ in range(round(_SECONDS * env.metadata["render_fps"])):
        step += 1
        if step % _HOLD == 0:
            command = np.array((rng.uniform(-0.5, 0.5), rng.uniform(0.4, 0.8)), np.float32)
        seen, _, terminated, truncated, _ = env.step(command)
        if step % _HOLD >= _HOLD // 2:
            numbers = _numbers(seen)
            turning.append((float(command[0] * numbers[speed_at]), float(command[0])))
            rates.append(-float(numbers[yaw_rate_at]))
        if terminated or truncated:
            env.reset()
            step = -1
    per_metre, per_second = nnls(np.array(turning), np.array(rates))[0]
    return SteeringResponse(float(per_metre), float(per_second))


def fit_response(
    steering: NDArray[np.floating],
    speed: NDArray[np.floating],
    yaw_rate: NDArray[np.floating],
    times_s: NDArray[np.floating],
) -> SteeringResponse:
    """Fit how a vehicle turns to one or more drives, or raise a StudyError.

    Arguments have the shape (n,): applied steering, -1 to 1, positive to the right; speed along the
    heading, m/s; rate of turn, rad/s, positive to the left; and time since the start of the
    episode, s. An episode begins where the time does not increase. The turn lags behind the
    steering, so a step counts only if all values are finite and the steering has not changed for
    0.1 s, without a gap.
    """
    from scipy.optimize import nnls

    rows = np.stack((steering * speed, steering, -yaw_rate), axis=1).astype(np.float64)
    steady = np.isfinite(rows).all(axis=1) & _is_steady(steering, times_s)
    turning, rates = rows[steady, :2], rows[steady, 2]
    numbers, error = nnls(turning, rates) if len(rates) else (np.zeros(2), 0.0)
    explained = 1.0 - error**2 / max(float(rates @ rates), _ROUNDING)
    if not numbers.any() or explained < _EXPLAINED:
        raise StudyError(
            f"In this drive, steering explains {max(0.0, explained):.0%} of how the vehicle turns, "
            f"but it must explain {_EXPLAINED:.0%}: drive curves to both sides."
        )
    return SteeringResponse(float(numbers[0]), float(numbers[1]))


def _is_steady(steering: NDArray[np.floating], times_s: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Return the mask of steps at which the steering has been constant for the lag of the turn."""
    passed_s = np.diff(times_s)
    usual_s = float(np.median(passed_s)) if len(passed_s) else 0.0
    jitter_s = min(0.5 * usual_s, _JITTER_S)
    whole = (passed_s > 0.0) & (passed_s <= max(_LAG_S + jitter_s, 1.5 * usual_s))
    stretch = np.concatenate(([0], np.cumsum(~whole)))  # Number of gaps before each step.
    _, begins = np.unique(stretch, return_index=True)
    steady = times_s - times_s[begins][stretch] >= _LAG_S - jitter_s
    for steps in range(1, len(steering)):
        recent = times_s[steps:] - times_s[:-steps] <= _LAG_S + jitter_s
        recent &= stretch[steps:] == stretch[:-steps]
        if not recent.any():
            break
        steady[steps:] &= ~recent | (np.abs(steering[steps:] - steering[:-steps]) < _CHANGE)
    return steady


_COLUMNS, _ROWS = CANONICAL_SIZE

_FRAME: Final = Feature(
    "camera/canonical", "1", 0.0, 255.0, Element("camera", "front"), (_ROWS, _COLUMNS, 3)
)
OBSERVATION_LAYOUT: Final = Layout((_FRAME,))
"""Layout of a rectified frame."""

ACTION_LAYOUT: Final = Layout(
    (
        Feature("waypoint/bearing", "1", -1.0, 1.0, gain=WIDEST_RAD, gain_unit="rad"),
        Feature("waypoint/speed", "1", -1.0, 1.0),
    )
)
"""Layout of a waypoint."""


def command(
    action: NDArray[np.float32], response: SteeringResponse, speed: float, *, on_the_spot: bool
) -> NDArray[np.float32]:
    """Return the steering and throttle that lead a vehicle to a waypoint `AHEAD_M` ahead.

    Pure pursuit: the circle through a point at the distance L and the bearing b has the curvature
    2 sin(b) / L (R. C. Coulter, CMU-RI-TR-92-01, 1992). The action, bearing and speed, is clipped
    to -1 to 1. `speed` is the speed along the heading, m/s. `on_the_spot` is for a vehicle with
    tracks, whose throttle is lowered, down to `LEAST_THROTTLE`, to keep tracks from saturating.
    """
    values = np.asarray(action, np.float64)
    if values.shape != (2,) or not np.isfinite(values).all():
        raise SpaceMismatch(
            f"A waypoint must be two finite numbers, bearing and speed, got {values.tolist()}."
        )
    bearing, share = np.clip(values, -1.0, 1.0).tolist()
    fast = max(speed, _SLOWEST_MPS)
    rate = 2.0 * math.sin(bearing * WIDEST_RAD) / AHEAD_M * fast
    steering = rate / (response.per_metre * fast + response.per_second)
    steering = max(-1.0, min(1.0, steering))
    throttle = max(LEAST_THROTTLE, 0.5 * (share + 1.0))
    if on_the_spot:
        throttle = min(throttle, max(LEAST_THROTTLE, 1.0 - abs(steering)))
    return np.array((steering, throttle), np.float32)


def _numbers(seen: Any) -> NDArray[np.float32]:
    return cast("Any", seen)["state"] if isinstance(seen, dict) else seen


class WaypointView(Page, gym.Env[Any, NDArray[np.float32]]):
    """A vehicle, simulated or on the network, with rectified images and waypoints as actions.

    `response` is the vehicle's response to steering, or None before it was measured.

    ## Action space
    `Box(-1, 1, (2,), float32)`: the bearing of a point 0.8 m ahead, 1 for 1 rad to the right; and
    the speed, 1 for full throttle and -1 for the least. An action lasts one control period, 1/20 s.

    | Num | Action             | Min | Max | Unit |
    | --- | ------------------ | --- | --- | ---- |
    | 0   | `waypoint/bearing` | -1  | 1   | 1    |
    | 1   | `waypoint/speed`   | -1  | 1   | 1    |

    ## Observation space
    `Box(0, 255, (48, 80, 3), uint8)`, the rectified frame, RGB:

    | Num     | Observation        | Min | Max | Unit |
    | ------- | ------------------ | --- | --- | ---- |
    | 0-11519 | `camera/canonical` | 0   | 255 | 1    |
    """

    response: SteeringResponse | None
    _env: Any

    def _see(
        self,
        env: Any,
        robot: str,
        camera: tuple[float | None, float | None, tuple[int, int] | None],
        sensors: Sequence[str],
        error: type[ShapechangerError],
        *,
        turns_on_the_spot: bool,
    ) -> None:
        """Wrap another env, whose actions are steering and throttle, or raise an `error`.

        `camera` is the pitch and vertical field of view, degrees, and the size of frames, each None
        if unknown. `sensors` are the names of required measurements, "speed" first.
        """
        pitch, fovy, size = camera
        slices = env.observation_layout.slices
        if size is None:
            raise error(f"{robot} has no camera, which a policy with waypoints needs.")
        if pitch is None or fovy is None:
            raise error(
                f"{robot}: [camera] does not state pitch_deg and fovy_deg, which waypoints need: "
                "`shapechanger robot camera` measures them."
            )
        if missing := " and ".join(name for name in sensors if name not in slices):
            raise error(
                f"{robot} has no sensor of {missing}, which waypoints need: add it to the profile, "
                "leave out sensed in a simulation, or give response=(RAD_PER_M, RAD_PER_S)."
            )
        try:
            self._rectifier = Rectifier(CameraGeometry(pitch, fovy), size)
        except WorldError as reason:
            raise error(f"{robot}: {reason}") from reason
        pixels = slices["camera/image"].stop if "camera/image" in slices else 0
        self._env, self._turns_on_the_spot = env, turns_on_the_spot
        self._motion_at = tuple(slices[name].start - pixels for name in sensors)
        self._speed = 0.0
        self.render_mode, self.metadata = env.render_mode, env.metadata
        self.observation_space = gym.spaces.Box(0, 255, (_ROWS, _COLUMNS, 3), np.uint8)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_layout, self.action_layout = OBSERVATION_LAYOUT, ACTION_LAYOUT

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.uint8], dict[str, Any]]:
        """Start an episode of the wrapped env."""
        gym.Env.reset(self, seed=seed)  # Sets `np_random`.
        seen, info = self._env.reset(seed=seed, options=options)
        return self._rectified(seen), info

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.uint8], float, bool, bool, dict[str, Any]]:
        """Drive towards a waypoint for one control period.

        Raises:
            SpaceMismatch: If the action is not two finite numbers.
            ResetNeeded: If `reset` was never called, or the link was lost.
        """
        if self.response is None:
            raise gym.error.ResetNeeded("Call reset() before the first step.")
        steering = command(action, self.response, self._speed, on_the_spot=self._turns_on_the_spot)
        seen, reward, terminated, truncated, info = self._env.step(steering)
        return self._rectified(seen), reward, terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the newest frame as the camera took it; see the wrapped env."""
        return self._env.render()

    def close(self) -> None:
        """Release the renderer or the robot."""
        self._env.close()

    def _rectified(self, seen: Any) -> NDArray[np.uint8]:
        self._speed = float(np.nan_to_num(_numbers(seen)[self._motion_at[0]]))
        image = cast("Any", seen)["image"] if isinstance(seen, dict) else self._env.world.picture()
        return self._rectifier(image)


class WaypointLabels(NamedTuple):
    """Waypoints that a driver's commands lead to."""

    actions: NDArray[np.float32]  # Bearing and speed, each from -1 to 1, shape (n, 2).
    # Whether a command determines a waypoint, shape (n,): False if the vehicle drives backward,
    # stands still without a command to drive, or did not measure its speed.
    usable: NDArray[np.bool_]
    # Whether the bearing is only a lower bound, shape (n,): at full steering, or beyond the widest
    # bearing.
    at_limit: NDArray[np.bool_]


def waypoints_of(
    commands: NDArray[np.floating], response: SteeringResponse, speed: NDArray[np.floating]
) -> WaypointLabels:
    """Return the waypoints of steering and throttle, (n, 2), by the inverse of `command`.

    The steering determines the circle on which the vehicle drives. The waypoint is the point of the
    circle at the distance `AHEAD_M`. At full steering, or if tracks turn on the spot, several
    bearings have the same command, and the narrowest is returned. The throttle determines the
    speed; `command` raises throttles below `LEAST_THROTTLE`, such as brakes, to `LEAST_THROTTLE`.
    `speed` is the speed along the heading, m/s, (n,), NaN if it was not measured.
    """
    values = np.clip(np.asarray(commands, np.float64), -1.0, 1.0)
    steering, throttle = values.T
    fast = np.maximum(speed, _SLOWEST_MPS)
    turn = steering * (response.per_metre * fast + response.per_second)
    sine = 0.5 * AHEAD_M * turn / fast
    widest = math.sin(WIDEST_RAD)
    bearing = np.arcsin(np.clip(sine, -widest, widest)) / WIDEST_RAD
    moves = np.abs(speed) >= STANDING_MPS
    turns = np.abs(steering) * response.per_second >= STANDING_RADPS
    # Commands that drive backward have no waypoint. At rest, throttle or turning tracks are needed.
    usable = np.where(
        moves, speed > 0.0, (throttle >= LEAST_THROTTLE) | ((throttle >= 0.0) & turns)
    )
    return WaypointLabels(
        np.stack((bearing, np.clip(2.0 * throttle - 1.0, -1.0, 1.0)), axis=1).astype(np.float32),
        usable & np.isfinite(values).all(axis=1) & np.isfinite(speed),
        (np.abs(steering) >= _AT_LOCK) | (np.abs(sine) >= widest),
    )


class WaypointDemonstrations(NamedTuple):
    """Demonstrations with waypoints as actions."""

    data: Dataset
    kept: NDArray[np.bool_]  # Mask of the given steps that were converted, shape (n,).
    response: SteeringResponse
    notes: tuple[str, ...]  # Sentences that summarise the conversion.


def as_waypoints(data: Dataset, response: SteeringResponse | None = None) -> WaypointDemonstrations:
    """Convert demonstrations of steering and throttle, with rectified images, to waypoints.

    Steps that do not determine a waypoint are left out; see `waypoints_of`. Without a `response`,
    it is fitted to the recorded motion. Raises a DemosError if no step can be converted.
    """
    names = data.action_layout.names
    if names != ("steering", "throttle"):
        raise DemosError(
            f"Waypoints need steering and throttle, but these demonstrations have the actions "
            f"{', '.join(names)}: omit --waypoints."
        )
    if data.pictures is None:
        raise DemosError("These demonstrations have no images, but waypoint training needs images.")
    layout, states = data.state_layout, data.states
    columns: dict[str, NDArray[np.float64]] = {}
    if layout is not None and states is not None:
        columns = {n: states[:, layout.slices[n].start].astype(np.float64) for n in layout.names}
    source = "as given"
    if response is None:
        response, source = _fitted(columns, data.times_s), "fitted to the recorded motion"
    speed = columns.get("speed")
    if speed is None and response.per_second > 0.0:
        raise DemosError(
            f"The vehicle turns {response.per_second:g} rad for each second, so waypoints depend "
            "on its speed, but the recording has no speed: record with a sensor of speed."
        )
    if speed is None:
        # With wheels, the circle does not depend on the speed, and throttle above 0 drives forward.
        speed = np.where(data.actions[:, 1] > 0.0, 1.0, np.nan)
    labels = waypoints_of(data.actions, response, speed)
    kept = labels.usable
    if not kept.any():
        raise DemosError("In no step of these demonstrations does the vehicle drive forward.")
    outside = np.abs(labels.actions[kept, 0]) * WIDEST_RAD > HALF_WIDTH_RAD
    notes = (
        f"The vehicle turns {response.per_metre:.2f} rad for each metre and "
        f"{response.per_second:.2f} for each second at full steering, {source}.",
        f"{np.mean(~kept):.1%} of the steps are left out: the vehicle stands still, drives "
        "backward, or did not measure its speed.",
        f"{np.mean(outside):.1%} of the waypoints are outside the image, which ends "
        f"{math.degrees(HALF_WIDTH_RAD):.0f} degrees to each side; "
        f"{np.mean(labels.at_limit[kept]):.1%} are at the limit of the steering, so the driver may "
        "have intended a wider bearing.",
    )
    converted = dataclasses.replace(
        data.part(kept),
        states=None,
        actions=labels.actions[kept],
        action_layout=ACTION_LAYOUT,
        state_layout=None,
    )
    return WaypointDemonstrations(converted, kept, response, notes)


def _fitted(
    columns: dict[str, NDArray[np.float64]], times_s: NDArray[np.floating]
) -> SteeringResponse:
    """Fit the response to the recorded motion, (n,) keyed by name."""
    missing = [name for name in _MOTION if name not in columns]
    why = f"How the vehicle turns is unknown, because the recording lacks {', '.join(missing)}"
    if not missing:
        steering, speed, yaw_rate = (columns[name] for name in _MOTION)
        try:
            return fit_response(steering, speed, yaw_rate, times_s)
        except StudyError as error:
            why = str(error).rstrip(".")
    raise DemosError(
        f"{why}: give --response RAD_PER_M RAD_PER_S, the `response` of RemoteWaypoint-v1 after "
        "its first reset."
    )
