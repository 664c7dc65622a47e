"""A policy that drives a robot while a person is in charge of it."""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

from shapechanger.envs.remote.vehicle import RemoteVehicleEnv
from shapechanger.errors import RobotRefused
from shapechanger.layout import Layout
from shapechanger.remote.client import RobotClient
from shapechanger.remote.known_robots import KnownRobot

if TYPE_CHECKING:
    from shapechanger.demos.cloning.policy import CameraPolicy

__all__ = ["Pilot", "load_pilot"]

# s. How long a reset waits for the person before it looks whether to end; then it waits again.
_LOOK_EVERY_S: Final = 1.0
_END_S: Final = 10.0


def load_pilot(path: Path, robot: KnownRobot) -> Pilot:
    """The policy in a file, if it can drive the robot; nothing moves yet.

    Raises:
        PolicyError: If it is none, or one for another robot.
        LinkError: If the robot cannot be reached.
    """
    from shapechanger.demos.cloning.policy import CameraPolicy

    policy = CameraPolicy.load(path)
    with RobotClient.connect(robot, frames=False) as there:
        welcome = there.welcome
    actions = Layout.from_json(welcome.action_layout)
    policy.card.require_layouts(actions, Layout.from_json(welcome.state_layout))
    if policy.card.eyes != "none" and welcome.image_size is None:
        raise RobotRefused(f"{robot.name} has no camera, and the policy drives by pictures.")
    return Pilot(policy, path.stem, robot, welcome.image_size or (160, 120))


class Pilot:
    """Lets a policy drive, from when a person says so until they take the robot or stop it.

    Then it waits until they let it drive again. It works in a thread, between `__enter__` and
    `__exit__`.

    Args:
        policy: The policy.
        name: What people see it called.
        robot: The robot.
        size: Width and height of the pictures that the policy gets.

    Attributes:
        note: What it does, in words.
    """

    def __init__(
        self, policy: CameraPolicy, name: str, robot: KnownRobot, size: tuple[int, int]
    ) -> None:
        self.note = ""
        self._policy = policy
        self._ended = threading.Event()
        self._failure: Exception | None = None
        self._why = ""
        self._options: dict[str, Any] = {
            "robot": robot.address,
            "key": robot.key,
            "fingerprint": robot.fingerprint,
            "size": size,
            "image": policy.card.eyes != "none",
            "state": policy.card.state_layout is not None,
            "interventions": True,
            "on_reset": "person",
            "on_waiting": self._wait_for,
            "reset_timeout_s": _LOOK_EVERY_S,
            "name": name,
        }
        self._thread = threading.Thread(target=self._run, name="pilot", daemon=True)

    def __enter__(self) -> Self:
        """Begin to wait for the person."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Give the robot back."""
        self._ended.set()
        self._thread.join(_END_S)

    def require_well(self) -> None:
        """Pass on what ended it.

        Raises:
            Exception: If anything did.
        """
        if self._failure is not None:
            raise self._failure

    def _run(self) -> None:
        try:
            env = RemoteVehicleEnv(**self._options)
            try:
                while not self._ended.is_set():
                    # It says that the person has not armed it yet, or who has the robot.
                    with contextlib.suppress(RobotRefused):
                        self._drive(env, env.reset()[0])
            finally:
                env.close()
        except Exception as error:  # Whatever it was, the thread of the person raises it.
            self._failure = error

    def _drive(self, env: RemoteVehicleEnv, observation: Any) -> None:
        """Drive until the episode ends."""
        self._why, self.note = "", "it drives"
        while not self._ended.is_set():
            action = self._policy.predict(*self._perceived(observation))
            observation, _, terminated, truncated, info = env.step(action)
            self.note = "you drive, and it watches" if "intervene_action" in info else "it drives"
            if terminated or truncated:
                self._why = info["truncated_because"] or "It ran into something."
                return

    def _perceived(self, observation: Any) -> tuple[Any, Any]:
        """The picture and the state in an observation; None for what the policy does not use."""
        if self._options["image"] and self._options["state"]:
            return observation["image"], observation["state"]
        return (observation, None) if self._options["image"] else (None, observation)

    def _wait_for(self, text: str) -> None:
        self.note = f"{self._why} {text}".strip()
