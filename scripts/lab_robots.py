"""Copy the numbers of the lab's robots from their profiles to the envs that simulate them.

Run it after a change of `lab-*.toml`; a test compares the two.
"""

from __future__ import annotations

import json
from pathlib import Path

import msgspec

import shapechanger.vehicles.envs
from shapechanger.vehicles.twin import read_robot


def lab_robots_json() -> str:
    """Return the content of the file."""
    robots = {name: read_robot(name) for name in ("lab-boat", "lab-car", "lab-tank", "lab-truck")}
    for name, robot in robots.items():
        robots[name] = msgspec.structs.replace(robot, path=name)
    return (
        json.dumps(msgspec.to_builtins(robots, enc_hook=int), indent=1, ensure_ascii=False) + "\n"
    )


if __name__ == "__main__":
    folder = Path(shapechanger.vehicles.envs.__file__).parent
    (folder / "lab_robots.json").write_text(lab_robots_json(), "utf-8")
