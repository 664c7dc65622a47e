"""A policy that drives a robot, from a workstation or in a process on board.

`python -m shapechanger.vehicles.remote.pilot` is the process on board. It reads its task as one
line of JSON, and writes its state and the reason of its end as lines of JSON. It ends when its
standard input is closed.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, Self

import numpy as np

from shapechanger.demos.cloning.clone import Clone, load_clone
from shapechanger.demos.episodes.records import is_same_rate
from shapechanger.errors import PolicyError, RobotRefused, ShapechangerError, no_policy_file
from shapechanger.layout import Layout
from shapechanger.policy import PolicyCard
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.env import RemoteVehicleEnv
from shapechanger.robot.client.known_robots import KnownRobot
from shapechanger.robot.daemon.policies import ENDING, policies_in
from shapechanger.robot.link.card import RobotCard
from shapechanger.vehicles.remote.waypoints import RemoteWaypointEnv
from shapechanger.vehicles.waypoints import ACTION_LAYOUT

# Interval at which a waiting reset checks whether to end, s.
_LOOK_EVERY_S: Final = 1.0
_END_S: Final = 10.0
_WAITS_ON_BOARD: Final = "It waits until no client has control and you arm the robot for it."


def require_fit(card: PolicyCard, robot: RobotCard, *, measures: bool) -> None:
    """Raise PolicyError or RobotRefused, naming the difference, if a policy does not fit a robot.

    `measures` is whether the vehicle's turning can be measured before the policy drives.
    """
    net = card.network
    if net.body and net.body != robot.body:
        raise PolicyError(
            f"The policy learned to steer a {net.body}, but {robot.robot} is a {robot.body}: only "
            "policies with waypoints can drive other bodies."
        )
    jitter = card.data.get("rate_jitter", 0.0)
    jitter = float(jitter) if isinstance(jitter, int | float) else 0.0
    if (hz := net.control_hz) is not None and not is_same_rate(hz, robot.control_hz, jitter):
        within = f" (varying by {100 * jitter:.0f} %)" if jitter else ""
        raise PolicyError(
            f"The policy learned at {hz:g} actions a second{within}, but {robot.robot} has "
            f"control_hz = {robot.control_hz:g}."
        )
    has_waypoints = _has_waypoints(card)
    if not has_waypoints:
        actions, state = map(Layout.from_json, (robot.action_layout, robot.state_layout))
        card.require_layouts(actions, state)
    if net.eyes != "none" and robot.image_size is None:
        raise RobotRefused(f"{robot.robot} has no camera, but the policy needs images.")
    if has_waypoints and None in robot.camera_deg:
        raise RobotRefused(
            f"The profile of {robot.robot} does not state pitch_deg and fovy_deg of its camera, "
            "which waypoints need: measure them with `shapechanger robot camera`."
        )
    if has_waypoints and robot.turning is None and not measures:
        raise RobotRefused(
            f"The profile of {robot.robot} does not state turn_deg_per_m or turn_deg_per_s, which "
            "waypoints need on board: `shapechanger robot drive --policy` measures them."
        )


def require_policies(path: Path, robot: RobotCard) -> None:
    """Raise PolicyError unless the policy, or each policy of the folder, at `path` fits a robot."""
    if not path.exists():
        raise PolicyError(no_policy_file(path, noun="file or folder"))
    files = [path] if path.suffix == ENDING else []
    if path.is_dir():
        files = [path / f"{name}{ENDING}" for name in policies_in(path)]
    if not files:
        raise PolicyError(
            f"There is no policy NAME{ENDING} at {path}: `shapechanger policies export` writes one."
        )
    for file in files:
        card = load_clone(file).card
        try:
            require_fit(card, robot, measures=False)
        except (PolicyError, RobotRefused) as error:
            raise PolicyError(f"{file} cannot drive {robot.robot}: {error}") from error


def _has_waypoints(card: PolicyCard) -> bool:
    return card.action is not None and card.action.names == ACTION_LAYOUT.names


class PolicyDriver:
    """Drives a robot by a policy whenever a person permits it; the person may intervene.

    `run` drives in the thread that calls it. As a context manager, the driver has its own thread.
    `note` is its state as text; `on_note` is called whenever it changes. `waits` is the text to
    display while the driver waits; "" for instructions at a terminal.
    """

    def __init__(
        self,
        policy: Clone,
        name: str,
        robot: KnownRobot,
        on_note: Callable[[str], object] = lambda _: None,
        waits: str = "",
    ) -> None:
        self.note = self._why = ""
        self._policy, self._name, self._robot = policy, name, robot
        self._on_note, self._waits = on_note, waits
        self._ended = threading.Event()
        self._failure: Exception | None = None
        self._sees = policy.net.eyes != "none"
        self._feels = policy.card.observation is not None
        self._thread = threading.Thread(target=self._run, name="pilot", daemon=True)

    def __enter__(self) -> Self:
        """Start the thread."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Release the robot and end the thread."""
        self.end()
        self._thread.join(_END_S)

    def end(self) -> None:
        """Make `run` release the robot and return."""
        self._ended.set()

    def require_well(self) -> None:
        """Raise the error that ended the thread."""
        if self._failure is not None:
            raise self._failure

    def run(self) -> None:
        """Drive whenever a person permits it, until `end` is called."""
        with contextlib.closing(self._env()) as env:
            while not self._ended.is_set():
                # A reset is refused while the robot is disarmed or another client has control.
                with contextlib.suppress(RobotRefused):
                    self._drive(env, env.reset()[0])

    def _run(self) -> None:
        try:
            self.run()
        except Exception as error:  # Raised again in the main thread.
            self._failure = error

    def _env(self) -> RemoteVehicleEnv | RemoteWaypointEnv:
        with RobotClient.connect(self._robot, frames=False) as there:
            welcome = there.welcome
        options: dict[str, Any] = {
            "robot": self._robot.address,
            "key": self._robot.key,
            "fingerprint": self._robot.fingerprint,
            "pace": "lockstep" if welcome.clock == "twin" else "realtime",
            "interventions": True,
            "on_reset": "person",
            "on_waiting": self._wait_for,
            "reset_timeout_s": _LOOK_EVERY_S,
            "name": self._name,
        }
        if _has_waypoints(self._policy.card):
            return RemoteWaypointEnv(response=welcome.turning, **options)
        return RemoteVehicleEnv(
            size=welcome.image_size or (160, 120), image=self._sees, state=self._feels, **options
        )

    def _drive(self, env: RemoteVehicleEnv | RemoteWaypointEnv, observation: Any) -> None:
        """Drive until the episode ends."""
        self._why = ""
        self._say("it drives")
        while not self._ended.is_set():
            action = self._policy.predict(*self._perceived(observation))
            if not np.isfinite(action).all():
                # The robot would also refuse the action, and stop.
                raise PolicyError(f"The policy gave {action.tolist()}, which is not finite.")
            observation, _, terminated, truncated, info = env.step(action)
            yields = "intervene_action" in info
            self._say("you drive, and the policy watches" if yields else "it drives")
            if terminated or truncated:
                self._why = info["truncated_because"] or "It collided."
                return

    def _perceived(self, observation: Any) -> tuple[Any, Any]:
        """Split an observation into frame and state; None for unused parts."""
        if self._sees and self._feels:
            return observation["image"], observation["state"]
        return (observation, None) if self._sees else (None, observation)

    def _wait_for(self, text: str) -> None:
        self._say(f"{self._why} {self._waits or text}".strip())

    def _say(self, note: str) -> None:
        if note != self.note:
            self.note = note
            self._on_note(note)


def main() -> int:
    """Run a policy on board, and return the exit status."""
    # Standard output is for the daemon alone: redirect prints of other code to standard error.
    out = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def tell(**said: str) -> None:
        with contextlib.suppress(OSError):  # The daemon has ended.
            out.write(json.dumps({name: text[:400] for name, text in said.items()}) + "\n")

    task = json.loads(sys.stdin.readline())
    robot = KnownRobot(**task["robot"])
    file = Path(task["policy"])
    try:
        policy = load_clone(file)
        with RobotClient.connect(robot, frames=False) as there:
            card = there.welcome
        require_fit(policy.card, card, measures=False)
        driver = PolicyDriver(
            policy, file.stem, robot, lambda note: tell(note=note), waits=_WAITS_ON_BOARD
        )

        def end_with_input() -> None:  # The daemon closes the input to end the policy.
            while sys.stdin.readline():
                pass
            driver.end()

        threading.Thread(target=end_with_input, daemon=True).start()
        driver.run()
    except ShapechangerError as error:
        tell(failed=str(error))
        return 1
    except Exception as error:  # A policy may raise any exception.
        tell(failed=f"{type(error).__name__}: {error}")
        raise
    return 0


if __name__ == "__main__":
    sys.exit(main())
