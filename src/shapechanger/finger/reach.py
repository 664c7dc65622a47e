"""`Finger-v1`: bring the fingertip to a point and keep it there."""

from __future__ import annotations

from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import RETURN, SUCCESS
from shapechanger.errors import FingerError
from shapechanger.finger.env import SMOOTHNESS, FingerEnv
from shapechanger.finger.parameters import as_numbers
from shapechanger.finger.postures import draw_posture
from shapechanger.finger.task import FingerSenses, features_of_senses, fingertip, place_features
from shapechanger.layout import Element, Feature, Layout

_TARGET: Final = Element("task", "target")
TOLERANCE_M: Final = 0.005
"""Distance from the target within which the fingertip must stay, m."""
HELD_STEPS: Final = 10
"""Number of consecutive steps for which the fingertip must stay there: 0.2 s."""


class FingerReachEnv(FingerEnv):
    """Bring the fingertip to a random point that the nominal finger can reach, and keep it there.

    The finger has four joints, and seven tendons that only pull: flexors, extensors and the small
    muscles of the hand; `shapechanger.finger.anatomy` has its numbers and their sources. Tendons
    pull several joints at once, so a posture needs most tendons together.

    ## Observation space
    `Box(-inf, inf, (38,), float64)`: angles and velocities of the joints; tensions, lengths
    relative to the straight finger, and newest commands of the tendons; the fingertip computed from
    the angles; the target; and the vector from the fingertip to the target. Positions are in the
    finger's frame: x to the tip of the straight finger, y to the thumb, z to the back of the hand.

    | Num   | Observation           | Min      | Max    | Unit  |
    | ----- | --------------------- | -------- | ------ | ----- |
    | 0     | `MCP_flexion/angle`   | -0.3491  | 1.571  | rad   |
    | 1     | `MCP_abduction/angle` | -0.3491  | 0.3491 | rad   |
    | 2     | `PIP_flexion/angle`   | 0        | 1.833  | rad   |
    | 3     | `DIP_flexion/angle`   | -0.08727 | 1.396  | rad   |
    | 4-7   | `*/velocity`          | -inf     | inf    | rad/s |
    | 8     | `FDP/tension`         | 0        | 25     | N     |
    | 9     | `FDS/tension`         | 0        | 25     | N     |
    | 10    | `EIP/tension`         | 0        | 7.056  | N     |
    | 11    | `EDC/tension`         | 0        | 25     | N     |
    | 12    | `LUM/tension`         | 0        | 6.48   | N     |
    | 13    | `DI/tension`          | 0        | 25     | N     |
    | 14    | `PI/tension`          | 0        | 25     | N     |
    | 15-21 | `*/length`            | -inf     | inf    | m     |
    | 22-28 | `*/command`           | -1       | 1      | 1     |
    | 29-31 | `fingertip/x` to `z`  | -inf     | inf    | m     |
    | 32-34 | `target/x` to `z`     | -inf     | inf    | m     |
    | 35-37 | `target/dx` to `dz`   | -inf     | inf    | m     |

    With `goal=True` a Dict of `observation` (32, as above without the target), `achieved_goal` (3)
    and `desired_goal` (3), for learners with hindsight.

    ## Reward
    The sum of three terms, with the distance d of the true fingertip from the target, m, and
    dt = 0.02 s; `reward` replaces the weights 50, 1 and 0 of `FingertipReward`:

    ```text
    reward_nearness =  50 dt (0.5 / (1 + d / 0.020 m) + 0.5 / (1 + d / 0.002 m))
    reward_effort   =  -1 dt mean over the tendons of (tension / largest tension)²
    reward_change   =  -0 dt mean over the tendons of (change of the command)²
    ```

    With `goal=True` the reward is -1 if the measured fingertip is farther than 5 mm from the
    target, and otherwise 0, like `compute_reward`.

    ## Start
    At rest, within 0.1 rad of the posture of a hand at rest, all tendons just taut. The target is
    the fingertip of a random posture that the nominal finger can hold, each joint at least a tenth
    of its range away from its limits. A weaker finger of a gap may not reach all targets.

    ## End
    Never terminated. Truncated after 100 steps, 2 s.

    ## Info
    `is_success`, whether the fingertip has been within 5 mm for the last 0.2 s; `distance`, m, of
    the true fingertip from the target; `target`, m; `smoothness`, 1 minus half the mean change of
    the commands; `reward_nearness`, `reward_effort` and `reward_change` (with `goal=True`
    `reward_goal`); `diverged` if the simulation diverged.

    ## Versions
    v1: the first.

    Args:
        goal: Whether observations are Dicts with goals.
        **arguments: See the section Common arguments of this page.
    """

    measures = (SUCCESS, RETURN, SMOOTHNESS)
    _options = ("posture", "target")

    def __init__(self, *, goal: bool = False, **arguments: Any) -> None:
        super().__init__(**arguments)
        self._has_goal = goal
        self._target = np.zeros(3)
        self._steps_near = 0
        senses = features_of_senses()
        target = place_features("target", _TARGET)
        if goal:
            achieved = [Feature(f"achieved/{axis}", "m", element=_TARGET) for axis in "xyz"]
            # Gymnasium flattens a Dict in this order.
            features = [*achieved, *target, *senses]
            self.observation_space = gym.spaces.Dict(
                {
                    "observation": _unbounded(len(senses)),
                    "achieved_goal": _unbounded(3),
                    "desired_goal": _unbounded(3),
                }
            )
        else:
            offset = [Feature(f"target/d{axis}", "m", element=_TARGET) for axis in "xyz"]
            features = [*senses, *target, *offset]
            self.observation_space = _unbounded(len(features))
        self.observation_layout = Layout(tuple(features))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode.

        Args:
            seed: Seed of the env's random generator; None keeps the present generator.
            options: `posture`, four start angles, rad; `target`, a point, m, (3,), or four angles
                that place the fingertip at the target. Omitted options are drawn.

        Raises:
            UnknownName: If the name of an option is unknown.
            FingerError: If a posture is malformed or out of range, or a target is malformed.
        """
        super().reset(seed=seed)
        given = (options or {}).get("target")
        target = fingertip(draw_posture(self.np_random))
        if given is not None:
            target = as_numbers(given)
            target = fingertip(target) if target.shape == (4,) else target
            if target.shape != (3,) or not np.isfinite(target).all():
                raise FingerError(
                    f"A target must be three finite numbers, m, or four angles, rad; got {given}."
                )
        self._target = target
        senses = self._place(options)
        self.plant.mark(self._target)
        self._steps_near = 0
        return self._observation(senses), self._info()

    def _advance(self) -> None:
        self._steps_near = self._steps_near + 1 if self._distance <= TOLERANCE_M else 0

    def _terms(self, senses: FingerSenses) -> dict[str, float]:
        if not self._has_goal:
            return super()._terms(senses)
        return {"reward_goal": float(self.compute_reward(senses.fingertip, self._target, None))}

    def compute_reward(
        self, achieved_goal: NDArray[np.float64], desired_goal: NDArray[np.float64], info: object
    ) -> NDArray[np.float64]:
        """Return the reward of `goal=True`: 0 within 5 mm, -1 elsewhere; shape (...).

        Args:
            achieved_goal: Fingertips, m, (..., 3).
            desired_goal: Targets, m, (..., 3).
            info: Ignored.
        """
        distance = np.linalg.norm(np.asarray(achieved_goal) - np.asarray(desired_goal), axis=-1)
        return -(distance > TOLERANCE_M).astype(np.float64)

    def _observation(self, senses: FingerSenses) -> Any:
        if self._has_goal:
            return {
                "observation": senses.numbers(),
                "achieved_goal": senses.fingertip.copy(),
                "desired_goal": self._target.copy(),
            }
        return np.concatenate([senses.numbers(), self._target, self._target - senses.fingertip])

    def _info(self) -> dict[str, Any]:
        return {
            "is_success": self._steps_near >= HELD_STEPS,
            "distance": self._distance,
            "target": self._target.copy(),
        }


def _unbounded(size: int) -> gym.spaces.Box:
    return gym.spaces.Box(-np.inf, np.inf, (size,), np.float64)
