# /// script
# dependencies = ["shapechanger[sim,robot,remote]", "tyro"]
# ///
"""Describe a new tracked vehicle with two motors by a profile, and try it on its twin.

The twin runs the robot's own programs on simulated pins, so it shows mistakes before wiring.
"""

import tempfile
from pathlib import Path

import gymnasium as gym
import numpy as np
import tyro

import shapechanger  # noqa: F401  # Registers the ids.
from shapechanger.contract.plan import output_values
from shapechanger.robot.profile import load_profile
from shapechanger.robot.twin.robot import run_robot

PROFILE = """
[robot]
name = "snowcat"
body = "tank"

[action.steering]
propels = true          # Steering turns the same motors as throttle.

[action.throttle]
propels = true
slew_per_s = 4.0

[output.left]
driver = "hbridge"
part = "left track"
forward = 17            # BCM numbers.
backward = 27
mix = { throttle = 1.0, steering = 1.0 }

[output.right]
driver = "hbridge"
part = "right track"
forward = 23
backward = 24
mix = { throttle = 1.0, steering = -1.0 }

[limits]
deadline_ms = 300       # After this time without a new command, the robot stops.
arming = "anyone"       # A program may arm the robot; by default only a person may.
"""


def main(steps: int = 40) -> None:
    """Drive forward for this many steps."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "snowcat.toml")
        path.write_text(PROFILE)
        profile = load_profile(path)  # The error for a mistake names the line.
        for steering, throttle in ((0.0, 1.0), (1.0, 0.0), (-0.5, 0.5)):
            left, right = output_values(profile.guard_plan(), [steering, throttle])
            print(
                f"steering {steering:4}, throttle {throttle}: tracks {left:5.2f} and {right:5.2f}"
            )

        with run_robot(profile, clock="twin", arguments=("--world", "room")) as robot:
            env = gym.make(
                "shapechanger/RemoteVehicle-v1",
                robot=robot.known.address,
                key=robot.known.key,
                fingerprint=robot.known.fingerprint,
                pace="lockstep",
            )
            with robot.operator() as operator:
                env.reset(seed=0)
                start = operator.where()
                for _ in range(steps):
                    env.step(np.array([0.0, 1.0], np.float32))
                end = operator.where()
            print(f"driven {end.travelled_m - start.travelled_m:.2f} m in {steps / 20:.1f} s")
            env.close()


if __name__ == "__main__":
    tyro.cli(main)
