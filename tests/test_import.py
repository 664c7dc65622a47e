"""Importing the package: loaded modules, registered ids, and missing extras."""

from __future__ import annotations

import subprocess
import sys

import pytest

import shapechanger
from shapechanger.envs.catalogue import FINGER_ENVS, ODRL_ENVS, VEHICLE_ENVS
from tests.drawing import run_python


def _ids(*names: str) -> tuple[str, ...]:
    return tuple(f"shapechanger/{name}-v1" for name in names)


_IDS = _ids(
    *("InvertedPendulum", "SmallInvertedPendulum", "BigInvertedPendulum", "Ant", "AmputatedAnt"),
    *("BigAnt", "ExtendedAnt", "HalfCheetah", "Hopper", "Walker2d", "Swimmer", "Humanoid"),
    "InvertedDoublePendulum",
)
_NAMES = ("Car", "Tank", "Truck", "Boat")
_VEHICLES = _ids(*_NAMES)
_MORE_VEHICLES = _ids(*(name + kind for kind in ("Ranges", "Waypoint") for name in _NAMES))
_FINGERS = _ids("Finger", "FingerTrack")
_REMOTE = _ids("RemoteFinger", "RemoteFingerTrack", "RemoteVehicle", "RemoteWaypoint")

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
    """Neither MuJoCo nor PyTorch is loaded."""
    script = (
        "import sys, gymnasium as gym, shapechanger\n"
        "print(*[name for name in ('mujoco', 'torch', 'glfw', 'OpenGL') if name in sys.modules])\n"
        "print(*[name for name in gym.registry if name.startswith('shapechanger/')])"
    )
    loaded, ids = _run(script).splitlines()
    assert loaded == ""
    own = (*_ids("OwnRobot"), *_VEHICLES, *_MORE_VEHICLES, *_FINGERS, *_REMOTE)
    assert tuple(ids.split()) == (*_IDS, *ODRL_ENVS, *own)
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
    every = (*_IDS, *_FINGERS, *(_VEHICLES if blocked == "mujoco" else ()))
    lines = _run(_BLOCK.format(blocked=blocked) + _MAKE.format(ids=every)).splitlines()
    assert len(lines) == len(every)
    for sentence in lines:
        assert sentence.endswith("run `pip install 'shapechanger[sim]'`.")


@pytest.mark.system
@pytest.mark.parametrize(
    ("missing", "extra", "command"),
    [
        ("stable_baselines3", "learn", "train InvertedPendulum"),
        ("tensorboard", "learn", "train InvertedPendulum --tensorboard logs"),
        ("tyro", "cli", "envs"),
    ],
)
def test_a_command_names_the_missing_extra(missing: str, extra: str, command: str) -> None:
    script = f"from shapechanger.cli import main; main({command.split()})"
    done = run_python(_BLOCK.format(blocked=missing) + script)
    assert done.returncode != 0
    assert f"pip install 'shapechanger[{extra}]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_importing_again_keeps_the_registry() -> None:
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
