"""Importing the package: what it loads, what it registers, what it says without a simulator."""

from __future__ import annotations

import subprocess
import sys

import gymnasium as gym
import pytest

import shapechanger
from shapechanger.envs import CATALOGUE, register_all
from shapechanger.envs.catalogue import (
    FINGER_ENVS,
    REMOTE_FINGER,
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
# Each of them on distances, and with waypoints.
_MORE_VEHICLES = tuple(
    name.replace("-v1", f"{kind}-v1") for kind in ("Ranges", "Waypoint") for name in _VEHICLES
)

_FINGERS = ("shapechanger/Finger-v1", "shapechanger/FingerTrack-v1")

# Every import of a blocked package fails, as where it is not installed.
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


def test_importing_registers_the_ids_and_loads_no_simulator() -> None:
    """Who lists envs must not wait for MuJoCo or Torch."""
    script = (
        "import sys, gymnasium as gym, shapechanger\n"
        "print(*[name for name in ('mujoco', 'torch', 'glfw', 'OpenGL') if name in sys.modules])\n"
        "print(*[name for name in gym.registry if name.startswith('shapechanger/')])"
    )
    loaded, ids = _run(script).splitlines()
    assert loaded == ""
    vehicles = (*_VEHICLES, *_MORE_VEHICLES)
    remote = (REMOTE_FINGER, REMOTE_VEHICLE, REMOTE_WAYPOINT)
    assert tuple(ids.split()) == (*_IDS, *vehicles, *_FINGERS, *remote)
    assert (tuple(VEHICLE_ENVS), tuple(FINGER_ENVS)) == (_VEHICLES, _FINGERS)


def test_without_the_simulator_the_message_says_what_to_install() -> None:
    """A user who installed the bare package is one command away."""
    plain = (*_IDS, *_FINGERS)
    said = _run(_BLOCK.format(blocked="mujoco") + _MAKE.format(ids=plain)).splitlines()
    sentence = "This needs mujoco, which is not installed: run `pip install 'shapechanger[sim]'`."
    assert said == [sentence] * len(plain)


def test_without_the_simulator_a_vehicle_says_what_to_install() -> None:
    """It is a simulated world and a robot, and wants what both want."""
    said = _run(_BLOCK.format(blocked="mujoco") + _MAKE.format(ids=_VEHICLES)).splitlines()
    sentence = "This needs mujoco, which is not installed: "
    sentence += "run `pip install 'shapechanger[sim,robot]'`."
    assert said == [sentence] * len(_VEHICLES)


@pytest.mark.parametrize("blocked", ["glfw", "imageio"])
def test_what_the_simulator_needs_comes_with_the_same_command(blocked: str) -> None:
    """MuJoCo alone does not make an env: Gymnasium's parts for it import more."""
    said = _run(_BLOCK.format(blocked=blocked) + _MAKE.format(ids=_IDS)).splitlines()
    assert len(said) == len(_IDS)
    for sentence in said:
        assert sentence.endswith("run `pip install 'shapechanger[sim]'`.")


def test_registering_again_changes_nothing() -> None:
    """A module that is imported twice, or a user who makes sure, does no harm."""
    before = {env_id: gym.registry[env_id] for env_id in CATALOGUE}
    register_all()
    assert {env_id: gym.registry[env_id] for env_id in CATALOGUE} == before
    assert all(gym.registry[env_id] is spec for env_id, spec in before.items())


def test_importing_again_does_no_harm() -> None:
    """The registry outlives the module."""
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


def test_every_public_name_is_imported_on_first_use() -> None:
    """`import shapechanger` documents itself: `dir` lists what can be imported from it."""
    for name in shapechanger.__all__:
        assert name in dir(shapechanger)
        assert getattr(shapechanger, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'Strech'"):
        _ = shapechanger.Strech
