"""`FingerTrack-v1`: follow a path with the fingertip."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import PathError
from shapechanger.finger.anatomy import LEAST_TENSION_N, MOMENT_ARMS, MOST_TENSION_N
from shapechanger.finger.env import FingerEnv
from shapechanger.finger.paths import FingertipPath, PathSource, as_path, circle, figure_eight, line
from shapechanger.finger.plant import CONTROL_DT
from shapechanger.finger.postures import angles_for, draw_posture, moving_torque
from shapechanger.finger.task import FingerSenses, features_of_senses, fingertip, place_features
from shapechanger.finger.tensions import tensions_for_torque
from shapechanger.finger.visuals import polyline
from shapechanger.layout import Element, Feature, Layout

_CHECK_HZ: Final = 50.0
# Longest duration for which a path is checked, s.
_LOOK_S: Final = 60.0
# Largest error of a reachable point, m: a sixth of the tolerance of the task.
_OFF_M: Final = 0.0005


def require_reachable(path: FingertipPath) -> NDArray[np.float64]:
    """Return a path's first angles, rad, (4,), if the nominal finger can follow its first 60 s.

    Raises:
        PathError: If a point is out of reach, or the tendons are too weak for the motion; the
            message names the time and what is missing.
    """
    length = min(path.duration_s, _LOOK_S)
    # 1.1 s at 50 Hz are 55.00000000000001 steps.
    steps = max(1, math.ceil(length * _CHECK_HZ - 1e-9))
    times = np.linspace(0.0, length, steps + 1)
    points = path.at(times)
    angles = _angles_along(points)
    if len(angles) < len(points):
        k = len(angles)
        place = "({:.1f}, {:.1f}, {:.1f})".format(*(1e3 * points[k]))
        raise PathError(
            f"The path leaves the finger's reach: at {times[k]:.2f} s the point {place} mm is out "
            "of reach. The knuckle is at (0, 0, 0); x points to the tip, y to the thumb, z to the "
            "back of the hand."
        )
    t, missing = _weakness(times, angles)
    if missing > 0.0:
        raise PathError(
            f"The tendons are too weak for the path: at {t:.2f} s a joint lacks "
            f"{missing * 1e3:.1f} mN·m. Make it slower."
        )
    return angles[0]


def _angles_along(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angles for the points up to the first one out of reach, rad, (n, 4)."""
    angles: list[NDArray[np.float64]] = []
    for point in points:
        near, off = angles_for(point, angles[-1] if angles else None)
        if off > _OFF_M:
            break
        angles.append(near)
    return np.array(angles)


def _weakness(times: NDArray[np.float64], angles: NDArray[np.float64]) -> tuple[float, float]:
    """Return when the tendons are too weak, s, and the missing torque, N·m; 0 if never."""
    speeds = np.asarray(np.gradient(angles, times, axis=0), np.float64)
    accelerations = np.asarray(np.gradient(speeds, times, axis=0), np.float64)
    for t, q, speed, acceleration in zip(times, angles, speeds, accelerations, strict=True):
        torque = moving_torque(q, speed, acceleration)
        given, is_enough = tensions_for_torque(MOMENT_ARMS, torque, LEAST_TENSION_N, MOST_TENSION_N)
        if not is_enough:
            return float(t), float(np.abs(torque - MOMENT_ARMS.T @ given).max())
    return 0.0, 0.0


# Ranges of random paths: size (radius, half a line, length of an eight), m, and speed, m/s.
_SIZE: Final = (0.003, 0.015)
_SPEED: Final = (0.01, 0.08)
_SLOWEST_HZ: Final = 0.1
_FASTEST_HZ: Final = 2.0
# Number of points at which a random path is checked.
_RANDOM_PATHS_LOOKS: Final = 32


def draw_path(rng: np.random.Generator) -> tuple[FingertipPath, NDArray[np.float64]]:
    """Sample a circle, figure eight or line in the finger's reach, and its first angles, rad."""
    while True:
        centre = fingertip(draw_posture(rng))
        size = rng.uniform(*_SIZE)
        hz = rng.uniform(*_SPEED) / (2.0 * math.pi * size)
        hz = min(max(hz, _SLOWEST_HZ), _FASTEST_HZ)
        normal = rng.standard_normal(3)
        normal /= np.linalg.norm(normal)
        kind = rng.integers(3)
        if kind == 2:
            path = line(tuple(centre - size * normal), tuple(centre + size * normal), hz)
        else:
            make = circle if kind == 0 else figure_eight
            path = make(size, tuple(centre), hz, tuple(normal))
        # Each reset draws a path, so the check is short; paths are smooth, so few points suffice.
        times = np.linspace(0.0, path.duration_s, _RANDOM_PATHS_LOOKS + 1)
        points = path.at(times)
        angles = _angles_along(points)
        if len(angles) == len(points) and _weakness(times, angles)[1] == 0.0:
            return path, angles[0]


PREVIEW_S: Final = (0.06, 0.12, 0.20)
"""Lookahead of the observation in addition to the end of the next step, s."""
RANDOM: Final = "random"
"""Value of `path` to draw a path at each reset."""

_TARGET: Final = Element("task", "target")
SETTLING_STEPS: Final = 25
"""Steps at the start that do not count for the error, 0.5 s: the fingertip has to gain speed."""
FOLLOWS_M: Final = 0.003
"""Largest root mean square of the error of a finger that follows its path, m."""
# Frames show at most this duration of a path, s, and a trail of one second.
_DRAWN_S: Final = 5.0
_DRAWN_POINTS: Final = 97
_TRAIL_STEPS: Final = 50
_LINE_M: Final = 0.0005
_TRAIL_M: Final = 0.0007
_PATH_COLOUR: Final = (0.10, 0.55, 0.25, 1.0)
_TRAIL_COLOUR: Final = (0.35, 0.20, 0.60, 1.0)
SEEN_S: Final = np.array([0.0, CONTROL_DT, *PREVIEW_S])
"""Times of the target and of the observed points, s from now."""


class FingerTrackEnv(FingerEnv):
    """Follow a point that moves along a known path.

    ## Observation space
    `Box(-inf, inf, (47,), float64)`: the numbers of `Finger-v1` with the point at the end of the
    next step as target; then the vectors from the fingertip to the points 0.06, 0.12 and 0.20 s
    from now.

    | Num   | Observation              | Min      | Max    | Unit  |
    | ----- | ------------------------ | -------- | ------ | ----- |
    | 0     | `MCP_flexion/angle`      | -0.3491  | 1.571  | rad   |
    | 1     | `MCP_abduction/angle`    | -0.3491  | 0.3491 | rad   |
    | 2     | `PIP_flexion/angle`      | 0        | 1.833  | rad   |
    | 3     | `DIP_flexion/angle`      | -0.08727 | 1.396  | rad   |
    | 4-7   | `*/velocity`             | -inf     | inf    | rad/s |
    | 8     | `FDP/tension`            | 0        | 25     | N     |
    | 9     | `FDS/tension`            | 0        | 25     | N     |
    | 10    | `EIP/tension`            | 0        | 7.056  | N     |
    | 11    | `EDC/tension`            | 0        | 25     | N     |
    | 12    | `LUM/tension`            | 0        | 6.48   | N     |
    | 13    | `DI/tension`             | 0        | 25     | N     |
    | 14    | `PI/tension`             | 0        | 25     | N     |
    | 15-21 | `*/length`               | -inf     | inf    | m     |
    | 22-28 | `*/command`              | -1       | 1      | 1     |
    | 29-31 | `fingertip/x` to `z`     | -inf     | inf    | m     |
    | 32-34 | `target/x` to `z`        | -inf     | inf    | m     |
    | 35-37 | `target/dx` to `dz`      | -inf     | inf    | m     |
    | 38-40 | `ahead_60ms/dx` to `dz`  | -inf     | inf    | m     |
    | 41-43 | `ahead_120ms/dx` to `dz` | -inf     | inf    | m     |
    | 44-46 | `ahead_200ms/dx` to `dz` | -inf     | inf    | m     |

    ## Reward
    As in `Finger-v1`, with the distance d of the true fingertip from the moving point, m, and
    dt = 0.02 s; `reward` replaces the weights 50, 1 and 0 of `FingertipReward`:

    ```text
    reward_nearness =  50 dt (0.5 / (1 + d / 0.020 m) + 0.5 / (1 + d / 0.002 m))
    reward_effort   =  -1 dt mean over the tendons of (tension / largest tension)²
    reward_change   =  -0 dt mean over the tendons of (change of the command)²
    ```

    ## Start
    At rest, with the fingertip at a random point of a closed path, or at the beginning of an open
    path.

    ## End
    Never terminated. Truncated after 250 steps, 5 s.

    ## Info
    `distance`, m, of the true fingertip from the point; `rms`, m, the root mean square of the
    distance from 0.5 s after the start, and infinite before; `is_success`, whether `rms` is below
    3 mm; `target`, m; `smoothness`, `reward_nearness`, `reward_effort` and `reward_change`;
    `diverged` if the simulation diverged.

    ## Versions
    v1: the first.

    Args:
        path: A path of `shapechanger.finger.paths`; its name, "circle", "figure-eight", "line" or
            "curve", optionally with settings; a function of time; a CSV file of t, x, y and z; or
            "random" to draw a path at each reset.
        **arguments: See the section Common arguments of this page.

    Raises:
        PathError: If `path` is not a path, or the nominal finger cannot follow it.
        UnknownName: If the name of a path is unknown, or as in `FingerEnv`.
    """

    _options = ("posture", "path")

    def __init__(self, *, path: PathSource = "circle", **arguments: Any) -> None:
        super().__init__(**arguments)
        self.path_is_random = path == RANDOM
        self._path: FingertipPath = as_path("circle" if self.path_is_random else path)
        self._begin = require_reachable(self._path)
        self._t = 0.0
        self._look()
        # Positions of the fingertip in the last second, m, for frames.
        self._trail = deque([self.plant.fingertip], _TRAIL_STEPS)
        self._squares, self._steps = 0.0, 0
        ahead = ("target", *(f"ahead_{round(1e3 * s)}ms" for s in PREVIEW_S))
        offsets = [
            Feature(f"{name}/d{axis}", "m", element=_TARGET) for name in ahead for axis in "xyz"
        ]
        features = [*features_of_senses(), *place_features("target", _TARGET), *offsets]
        self.observation_layout = Layout(tuple(features))
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, (len(features),), np.float64)

    @property
    def path(self) -> FingertipPath:
        """The present path."""
        return self._path

    def start_angles(self, t: float) -> NDArray[np.float64]:
        """Return the start angles, rad, (4,), of an episode that begins `t` s into the path."""
        return angles_for(self._path.at(t), self._begin)[0]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Start an episode.

        Args:
            seed: Seed of the env's random generator; None keeps the present generator.
            options: `path`, the path of this and later episodes; `posture`, four start angles, rad;
                by default the fingertip starts on the path.

        Raises:
            UnknownName: If the name of an option or path is unknown.
            PathError: If `path` is invalid, or the finger cannot follow it; the env keeps its path.
            FingerError: If the posture is malformed or out of range.
        """
        super().reset(seed=seed)
        given = (options or {}).get("path")
        if given is not None and not (isinstance(given, str) and given == RANDOM):
            path = as_path(given)
            self._path, self._begin = path, require_reachable(path)
            self.path_is_random = False
        elif given is not None or self.path_is_random:
            self.path_is_random = True
            self._path, self._begin = draw_path(self.np_random)
        # An open path is followed from its beginning.
        self._t = self.np_random.uniform(0.0, self._path.duration_s) if self._path.closed else 0.0
        senses = self._place({"posture": self.start_angles(self._t), **(options or {})})
        self._squares, self._steps = 0.0, 0
        self._look()
        self.plant.mark(self._target)
        self._trail.clear()
        self._trail.append(self.plant.fingertip)
        return self._observation(senses), self._info()

    def _advance(self) -> None:
        self._t += CONTROL_DT
        self._steps += 1
        self._look()
        if self._steps > SETTLING_STEPS:
            self._squares += self._distance**2
        self.plant.mark(self._target)
        self._trail.append(self.plant.fingertip)

    def _markers(self) -> list[dict[str, Any]]:
        """Return the path and the trail of the fingertip."""
        times = np.linspace(0.0, min(self._path.duration_s, _DRAWN_S), _DRAWN_POINTS)
        path = polyline(self._path.at(times), _LINE_M, _PATH_COLOUR)
        return path + polyline(np.array([*self._trail]), _TRAIL_M, _TRAIL_COLOUR)

    def _look(self) -> None:
        """Compute the present and coming points of the path."""
        self._target, *self._ahead = self._path.at(self._t + SEEN_S)

    def _observation(self, senses: FingerSenses) -> NDArray[np.float64]:
        offsets = (np.array(self._ahead) - senses.fingertip).ravel()
        return np.concatenate([senses.numbers(), self._ahead[0], offsets])

    def _info(self) -> dict[str, Any]:
        counted = self._steps - SETTLING_STEPS
        rms = math.sqrt(self._squares / counted) if counted > 0 else math.inf
        return {
            "is_success": rms < FOLLOWS_M,
            "distance": self._distance,
            "rms": rms,
            "target": self._target.copy(),
        }
