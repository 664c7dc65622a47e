"""Targets that fingers of a gap can hold, by statics and by a controller with a model of each."""

from __future__ import annotations

import os
from typing import Any, Final, cast

import gymnasium as gym
import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import shapechanger  # noqa: F401 - Registers the ids.
from benchmarks.row import Row
from shapechanger.contract.env_ref import EnvRef
from shapechanger.finger.anatomy import JOINT_RANGE, JOINT_REST
from shapechanger.finger.controller import FingerController
from shapechanger.finger.gap import GAPS
from shapechanger.finger.model import build_finger
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.postures import angles_for, joint_torque
from shapechanger.finger.task import fingertip, fingertip_jacobian
from shapechanger.finger.tensions import drive_of, tensions_for_torque
from shapechanger.transfer.learners.evaluation import evaluation_seed

# Gain of the controller, 1/s. With a larger gain, a finger with a rig's command path oscillates;
# with 6, it has not yet arrived after 2 s.
_GAIN: Final = 12.0
# Units in which the solver's numbers are near 1: errors of 1 cm, tensions of 10 N, torques of
# 10 mN·m.
_ERROR_M, _TENSION_N, _TORQUE_NM = 0.01, 10.0, 0.01
# Largest unbalanced torque at an equilibrium, N·m: a thousandth of the torque of the finger's
# weight.
_BALANCED_NM: Final = 1e-5
# Searches for an equilibrium, and the spread of their starts, rad.
_STARTS: Final = 4
_SPREAD_RAD: Final = 0.3
FINGERS: Final = 10
TARGETS: Final = 60
_RIG: Final = GAPS["real-like"]
_GAP_FINGER: Final = EnvRef("shapechanger/Finger-v1", {"gap": "real-like"})


def _nominal(*names: str) -> dict[str, Any]:
    return {name: getattr(NOMINAL, name) for name in names}


_REPLACED: Final = {
    "": {},
    " without noise": _nominal("joint_noise", "tension_noise"),
    " without delay": _nominal("command_delay"),
    " with stiff tendons": _nominal("tendon_stiffness", "backlash"),
    # Not without friction, because the controller would oscillate.
    " with the least friction of the gap": {"tendon_friction": _RIG.tendon_friction[0]},
    " with the nominal finger's tensions": _nominal("most_tension", "least_tension"),
    " with the nominal finger's moment arms": _nominal("moment_arms"),
    " with the nominal finger's joints": _nominal(
        "joint_stiffness", "joint_damping", "joint_friction"
    ),
}


class Statics:
    """Equilibria of a finger under constant tensions.

    Args:
        parameters: The finger; delay, lag, stretch and noise do not matter.
    """

    def __init__(self, parameters: FingerParameters) -> None:
        still = parameters.replace(
            tendon_stiffness=None, backlash=0.0, command_delay=0.0, path=None
        )
        self._model = build_finger(still, drive_of("tension", still)).compile()
        self._data = mujoco.MjData(self._model)
        self._arms = parameters.arms
        self._friction = parameters.tendon_friction
        self._low = np.full(len(self._arms), parameters.least_tension)
        self._high = np.array(parameters.most_tension)

    def distance(self, target: NDArray[np.float64]) -> float:
        """Return the distance from a target to the nearest equilibrium without friction, m.

        Args:
            target: Position of the fingertip, m, (3,).
        """
        return self._nearest(target, self._low, self._high)[0]

    def distance_coming_from_rest(self, target: NDArray[np.float64]) -> float:
        """Return the distance to the nearest point at which a motion from the rest posture ends, m.

        Friction reduces the pull of a shortening tendon, and increases the pull of a lengthening
        one.

        Args:
            target: Position of the fingertip, m, (3,).
        """
        distance, angles = self._nearest(target, self._low, self._high)
        for _ in range(2):  # Which tendons shorten, and so lose force, depends on the result.
            lost = self._friction * np.sign(self._arms @ (angles - JOINT_REST))
            distance, angles = self._nearest(target, self._low - lost, self._high - lost)
        return distance

    def _nearest(
        self,
        target: NDArray[np.float64],
        least: NDArray[np.float64],
        most: NDArray[np.float64],
    ) -> tuple[float, NDArray[np.float64]]:
        """Return the distance to the nearest equilibrium, m, and its angles, rad, (4,)."""
        rng = np.random.default_rng(0)
        low, high = JOINT_RANGE.T
        least = np.maximum(least, 0.0)
        first = angles_for(target)[0]
        best, angles = np.inf, first
        for start in range(_STARTS):
            q = first
            if start > 0:
                q = np.clip(first + _SPREAD_RAD * rng.standard_normal(4), low, high)
            tensions = tensions_for_torque(self._arms, self._torque(q), least, most)[0]
            found = cast("Any", minimize)(
                lambda x: float(np.sum(self._error(x, target) ** 2)),
                np.concatenate([q, tensions / _TENSION_N]),
                jac=lambda x: self._slope(x, target),
                method="SLSQP",
                bounds=[
                    *zip(low, high, strict=True),
                    *zip(least / _TENSION_N, most / _TENSION_N, strict=True),
                ],
                constraints={"type": "eq", "fun": self._missing},
                options={"maxiter": 300, "ftol": 1e-9},
            )
            off = float(np.linalg.norm(self._error(found.x, target))) * _ERROR_M
            missing = float(np.abs(self._missing(found.x)).max()) * _TORQUE_NM
            if missing <= _BALANCED_NM and off < best:
                best, angles = off, found.x[:4]
        return float(best), angles

    def _torque(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        return joint_torque(self._model, self._data, angles, np.zeros(4), np.zeros(4))

    def _error(self, x: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
        return (fingertip(x[:4]) - target) / _ERROR_M

    def _slope(self, x: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
        per_angle = fingertip_jacobian(x[:4]) / _ERROR_M
        return np.concatenate([2.0 * per_angle.T @ self._error(x, target), np.zeros(len(x) - 4)])

    def _missing(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return (self._arms.T @ (_TENSION_N * x[4:]) - self._torque(x[:4])) / _TORQUE_NM


def causes() -> list[Row]:
    """Measure which parameters keep a controller with a model of the finger from its targets.

    For each row, some parameters of the fingers are replaced.
    """
    many = int(os.environ.get("FINGERS", FINGERS))
    fingers = [_RIG.draw(np.random.default_rng(seed)) for seed in range(many)]
    first = [evaluation_seed(_GAP_FINGER.having({"finger_seed": i}), TARGETS) for i in range(many)]
    rows: list[Row] = []
    for label, changes in _REPLACED.items():
        shares = [
            float(np.mean(held_by_controller(finger.replace(**changes), first[seed], TARGETS)))
            for seed, finger in enumerate(fingers)
        ]
        rows.append(
            Row(
                f"controller that knows the finger, fingers of the gap real-like{label}: targets "
                "reached within 5 mm",
                f"{np.mean(shares):.0%}",
                f"{', '.join(f'{share:.0%}' for share in shares)} of {TARGETS} targets each",
                "none",
                True,
            )
        )
    return rows


def held_by_controller(finger: FingerParameters, first_seed: int, targets: int) -> list[bool]:
    """Return whether a controller with a model of the finger reaches and holds each target.

    Args:
        finger: Parameters of the finger.
        first_seed: Seed of the first episode.
        targets: Number of episodes.
    """
    reached: list[bool] = []
    with gym.make("shapechanger/Finger-v1", parameters=finger) as env:
        inner: Any = env.unwrapped
        act = FingerController(inner.observation_layout, parameters=finger, gain=_GAIN)
        for i in range(targets):
            observation, info = env.reset(seed=first_seed + i)
            act.reset()
            ended = False
            while not ended:
                observation, _, terminated, truncated, info = env.step(act(observation))
                ended = terminated or truncated
            reached.append(bool(info["is_success"]))
    return reached
