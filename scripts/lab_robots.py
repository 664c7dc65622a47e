"""Copy the names, numbers and layouts of the lab's robots from their profiles to their envs.

Run it after a change of `lab-*.toml`; a test compares the two.
"""

import json
from pathlib import Path

import msgspec

import shapechanger.vehicles.envs
from shapechanger.vehicles.twin import read_robot


def lab_robots_json() -> str:
    """Return the content of `lab_robots.json`."""
    names = ("lab-boat", "lab-car", "lab-tank", "lab-truck")
    robots = {name: msgspec.structs.replace(read_robot(name), path=name) for name in names}
    plain = msgspec.to_builtins(robots, enc_hook=int)
    return json.dumps(plain, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    folder = Path(shapechanger.vehicles.envs.__file__).parent
    (folder / "lab_robots.json").write_text(lab_robots_json(), "utf-8")
