# /// script
# dependencies = ["shapechanger[sim,robot,remote]", "tyro"]
# ///
"""Run one script in simulation and on a robot: drive toward the farthest visible floor.

    python examples/simulation_and_robot.py                        # the simulated car
    python examples/simulation_and_robot.py --robot my-car         # a real car, or its twin

`shapechanger robot serve my-car.toml --twin` serves a twin, which programs may arm. If only a
person may arm the robot, run `shapechanger robot drive my-car` in another terminal, and press P
while the program waits.
"""

import gymnasium as gym
import numpy as np
import tyro

import shapechanger  # noqa: F401  # Registers the ids.


def drive(picture: np.ndarray) -> np.ndarray:
    """Return steering (-1 is left) and throttle toward the farthest floor in an image.

    Args:
        picture: RGB, (height, width, 3).
    """
    height, width, _ = picture.shape
    rows = picture[: int(0.85 * height)].astype(float)  # Below is the car itself.
    colour = rows / (rows.sum(axis=2, keepdims=True) + 1.0)
    floor = colour[-6:, width // 3 : 2 * width // 3].mean(axis=(0, 1))
    is_floor = np.abs(colour - floor).sum(axis=2) < 0.06
    depth = np.argmin(is_floor[::-1], axis=0) / len(rows)  # Height of the floor in each column.
    depth = np.convolve(depth, np.full(21, 1 / 21), "same")
    columns = np.linspace(-1.0, 1.0, width)
    heading = float((columns * depth**4).sum() / ((depth**4).sum() + 1e-9))
    ahead = float(depth[2 * width // 5 : 3 * width // 5].mean())
    if ahead < 0.1:
        return np.array([0.0, -0.5], np.float32)
    return np.array([np.clip(2.5 * heading, -1.0, 1.0), 0.3 + 0.4 * ahead], np.float32)


def main(steps: int = 400, robot: str = "") -> None:
    """Drive for this many steps; `robot` is the name or address of a robot, "" the simulation."""
    env = (
        gym.make("shapechanger/RemoteVehicle-v1", robot=robot)
        if robot
        else gym.make("shapechanger/Car-v1")
    )
    picture, info = env.reset(seed=0)
    total, collisions = 0.0, 0
    for _ in range(steps):
        picture, reward, terminated, truncated, info = env.step(drive(picture))
        total += float(reward)
        collisions += terminated
        if truncated:
            print(info.get("truncated_because", "The time is up."))
        if terminated or truncated:
            picture, info = env.reset()
    env.close()
    print(f"a return of {total:.1f} in {steps} steps, {collisions} collisions")


if __name__ == "__main__":
    tyro.cli(main)
