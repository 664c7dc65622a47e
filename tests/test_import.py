"""Importing the package: loaded modules, registered ids, and missing extras."""

from __future__ import annotations

import subprocess
import sys

import pytest

import shapechanger
from shapechanger.envs.catalogue import (
    FINGER_ENVS,
    ODRL_ENVS,
    OWN_ROBOT,
    REMOTE_FINGER,
    REMOTE_FINGER_TRACK,
    REMOTE_VEHICLE,
    REMOTE_WAYPOINT,
    VEHICLE_ENVS,
)

_IDS = (
    "shapechanger/InvertedPendulum-v1",
    "shapechanger/SmallInvertedPendulum-v1",
    "shapechanger/BigInvertedPendulum-v1",
    "shapechanger/Ant-v1",
    "shapechanger/AmputatedAnt-v1",
    "shapechanger/BigAnt-v1",
    "shapechanger/ExtendedAnt-v1",
    "shapechanger/HalfCheetah-v1",
    "shapechanger/Hopper-v1",
    "shapechanger/Walker2d-v1",
    "shapechanger/Swimmer-v1",
    "shapechanger/Humanoid-v1",
    "shapechanger/InvertedDoublePendulum-v1",
)
_VEHICLES = (
    "shapechanger/Car-v1",
    "shapechanger/Tank-v1",
    "shapechanger/Truck-v1",
    "shapechanger/Boat-v1",
)
# Variants with distances and with waypoints.
_MORE_VEHICLES = tuple(
    name.replace("-v1", f"{kind}-v1") for kind in ("Ranges", "Waypoint") for name in _VEHICLES
)

_FINGERS = ("shapechanger/Finger-v1", "shapechanger/FingerTrack-v1")

# Imports of a blocked package fail, as if it were not installed.
_BLOCK = """
import sys

class Block:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == {blocked!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Block())
"""

_MAKE = """
import gymnasium as gym
import shapechanger
from shapechanger.errors import MissingExtra

for env_id in {ids!r}:
    try:
        gym.make(env_id)
    except MissingExtra as error:
        print(error)
"""


def _run(script: str) -> str:
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], check=True, capture_output=True, text=True
    )
    return run.stdout


def test_import_registers_ids_without_a_simulator() -> None:
    """Importing registers all ids and loads neither MuJoCo nor PyTorch."""
    script = (
        "import sys, gymnasium as gym, shapechanger\n"
        "print(*[name for name in ('mujoco', 'torch', 'glfw', 'OpenGL') if name in sys.modules])\n"
        "print(*[name for name in gym.registry if name.startswith('shapechanger/')])"
    )
    loaded, ids = _run(script).splitlines()
    assert loaded == ""
    vehicles = (*_VEHICLES, *_MORE_VEHICLES)
    remote = (REMOTE_FINGER, REMOTE_FINGER_TRACK, REMOTE_VEHICLE, REMOTE_WAYPOINT)
    assert tuple(ids.split()) == (*_IDS, *ODRL_ENVS, OWN_ROBOT, *vehicles, *_FINGERS, *remote)
    assert (tuple(VEHICLE_ENVS), tuple(FINGER_ENVS)) == (_VEHICLES, _FINGERS)


def test_a_finger_loads_few_modules() -> None:
    """Making an env of the finger loads at most 40 of our modules, and no robot or other body."""
    script = (
        "import sys, gymnasium, shapechanger\n"
        "gymnasium.make('shapechanger/Finger-v1')\n"
        "print(*[name for name in sys.modules if name.partition('.')[0] == 'shapechanger'])"
    )
    modules = _run(script).split()
    assert len(modules) <= 40
    packages = {name.split(".")[1] for name in modules if "." in name}
    assert not packages & {"bodies", "link", "morphology", "remote", "robot", "transfer", "twin"}


@pytest.mark.parametrize("blocked", ["mujoco", "glfw", "imageio"])
def test_missing_dependencies_of_mujoco_envs_name_the_extra(blocked: str) -> None:
    """Without one of them, making an env raises an error with the command that installs it."""
    every = (*_IDS, *_FINGERS, *(_VEHICLES if blocked == "mujoco" else ()))
    lines = _run(_BLOCK.format(blocked=blocked) + _MAKE.format(ids=every)).splitlines()
    assert len(lines) == len(every)
    for sentence in lines:
        assert sentence.endswith("run `pip install 'shapechanger[sim]'`.")


def test_importing_again_keeps_the_registry() -> None:
    """Reloading or re-importing the package leaves the registry unchanged."""
    script = (
        "import sys, importlib, gymnasium as gym, shapechanger\n"
        "before = dict(gym.registry)\n"
        "importlib.reload(shapechanger)\n"
        "for name in [name for name in sys.modules if name.startswith('shapechanger')]:\n"
        "    del sys.modules[name]\n"
        "import shapechanger\n"
        "print(dict(gym.registry) == before)"
    )
    assert _run(script) == "True\n"


def test_public_names_are_imported_lazily() -> None:
    """Public names are listed by `dir` and imported on first use; others raise AttributeError."""
    for name in shapechanger.__all__:
        assert name in dir(shapechanger)
        assert getattr(shapechanger, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'Strech'"):
        _ = shapechanger.Strech
