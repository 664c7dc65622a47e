"""`FingerTrack-v1`: follow a path with the fingertip."""

from __future__ import annotations

import math
from typing import Any, Final

import gymnasium as gym
import numpy as np
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from shapechanger.envs.finger.env import FingerEnv
from shapechanger.envs.finger.inverse import angles_for
from shapechanger.envs.finger.plant import CONTROL_DT
from shapechanger.envs.finger.random_paths import draw_path
from shapechanger.envs.finger.reachable import require_reachable
from shapechanger.layout import Element, Feature, Layout
from shapechanger.tasks.finger import FingerSenses, place_features
from shapechanger.tasks.paths import Path, PathSource, as_path

__all__ = ["PREVIEW_S", "RANDOM", "FingerTrackEnv"]

PREVIEW_S: Final = (0.06, 0.12, 0.20)
"""How far ahead the observation sees besides the end of the next step, s."""
RANDOM: Final = "random"
"""What to give for a path to have another one at each reset."""

_TARGET: Final = Element("task", "target")
# What the fingertip takes to come from rest to the path's speed is not counted, s.
_SETTLES_S: Final = 0.5
_TOLERANCE_M: Final = 0.003
_SEEN_S: Final = np.array([0.0, CONTROL_DT, *PREVIEW_S])


class FingerTrackEnv(FingerEnv):
    """Follow a path that is given beforehand, as a point that moves along it.

    ## Action space
    As `Finger-v1`: `Box(-1, 1, (7,), float32)`.

    ## Observation space
    `Box(-inf, inf, (47,), float64)`: what the finger senses (32) as in `Finger-v1`; where the point
    will be at the end of the step (3) and how far that is from the fingertip (3), m; and how far
    from the fingertip it will be 0.06, 0.12 and 0.20 s from now (9), m.

    ## Reward
    As `Finger-v1`, with the moving point as target.

    ## Start
    At rest, with the fingertip at a point of the path; where a closed path begins is drawn.

    ## End
    Never terminated; truncated after 250 steps, 5 s.

    ## Info
    `distance`, m, of the true fingertip from the point; `rms`, m, the root mean square of it since
    0.5 s after the start; `is_success`, whether that is below 3 mm; `target`, m;
    `reward_nearness` and `reward_effort`; `diverged` where MuJoCo found a bad number.

    Args:
        path: A path of `shapechanger.tasks.paths`; its name, "circle", "figure-eight", "line" or
            "curve", also with settings; a function of time; a CSV file of t, x, y and z; or
            "random" for another one at each reset.
        **arguments: Those of `FingerEnv`.

    Raises:
        PathError: If it is no path, or the nominal finger cannot follow it; the message says where
            and by how much.
        UnknownName: If there is no such path, or as `FingerEnv`.
    """

    _options = ("posture", "path")

    def __init__(self, *, path: PathSource = "circle", **arguments: Any) -> None:
        super().__init__(**arguments)
        EzPickle.__init__(self, path=path, **arguments)
        self._is_random = path == RANDOM
        self._path: Path = as_path("circle" if self._is_random else path)
        self._begin = require_reachable(self._path)
        self._t = 0.0
        self._look()
        self._squares = 0.0
        self._counted = 0
        self._steps = 0
        ahead = [
            Feature(f"ahead_{round(1e3 * s)}ms/d{axis}", "m", element=_TARGET)
            for s in PREVIEW_S
            for axis in "xyz"
        ]
        features = [
            *self._sense_features(),
            *place_features("target", _TARGET),
            *(Feature(f"target/d{axis}", "m", element=_TARGET) for axis in "xyz"),
            *ahead,
        ]
        self.observation_layout = Layout(tuple(features))
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, (len(features),), np.float64)

    @property
    def path(self) -> Path:
        """The path that is followed now."""
        return self._path

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Start an episode.

        Args:
            seed: Seed of all randomness from here on; None goes on with the present state.
            options: `path`, another path from here on; `posture`, four angles, rad, to start at in
                place of those at the path.

        Raises:
            UnknownName: If there is no such option or path.
            PathError: If it is no path, or the finger cannot follow it; the present one stays.
            FingerError: If the posture is none.
        """
        super().reset(seed=seed)
        given = (options or {}).get("path")
        if given is not None and not (isinstance(given, str) and given == RANDOM):
            path = as_path(given)
            self._path, self._begin = path, require_reachable(path)
            self._is_random = False
        elif given is not None or self._is_random:
            self._is_random = True
            self._path, self._begin = draw_path(self.np_random)
        # A path that ends is followed from its beginning.
        self._t = self.np_random.uniform(0.0, self._path.duration_s) if self._path.closed else 0.0
        start, _ = angles_for(self._path.at(self._t), self._begin)
        senses = self._place({"posture": start, **(options or {})})
        self._squares, self._counted, self._steps = 0.0, 0, 0
        self._look()
        self.plant.mark(self._points[0])
        distance = float(np.linalg.norm(self.plant.fingertip - self._points[0]))
        return self._observation(senses), self._info(distance)

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Act for one step.

        Raises:
            BadAction: If the action is none; nothing has moved then.
            ResetNeeded: If `reset` was never called.
        """
        senses = self._act(action)
        self._t += CONTROL_DT
        self._steps += 1
        self._look()
        point = self._points[0]
        distance, terms = self._terms(point)
        if self._steps * CONTROL_DT > _SETTLES_S:
            self._squares += distance**2
            self._counted += 1
        self.plant.mark(point)
        info = self._info(distance) | terms
        if self.plant.diverged:
            info["diverged"] = True
        return self._observation(senses), sum(terms.values()), False, False, info

    def _look(self) -> None:
        """Where the path is now, and where it will be."""
        self._points = self._path.at(self._t + _SEEN_S)

    def _observation(self, senses: FingerSenses) -> NDArray[np.float64]:
        offsets = (self._points[1:] - senses.fingertip).ravel()
        return np.concatenate([senses.numbers(), self._points[1], offsets])

    def _info(self, distance: float) -> dict[str, Any]:
        rms = math.sqrt(self._squares / self._counted) if self._counted else math.inf
        return {
            "is_success": rms < _TOLERANCE_M,
            "distance": distance,
            "rms": rms,
            "target": self._points[0].copy(),
        }
