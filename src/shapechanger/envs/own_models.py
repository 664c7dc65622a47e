"""Load users' robots: MJCF and URDF files, and robots of `robot_descriptions`."""

from __future__ import annotations

import importlib
import importlib.util
import re
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np

from shapechanger.envs.catalogue import MODEL_FILES
from shapechanger.errors import BrokenModel, MorphologyError, ShapechangerError, UnknownName
from shapechanger.morphology import Body, name_elements, reason_of, reshape, to_json
from shapechanger.morphology.families import Family

# Names of robots in the package are names of its modules.
_DESCRIPTION: Final = re.compile(r"[A-Za-z0-9_]+_description")
_PACKAGE: Final = "robot_descriptions"
# Path schemes of ROS and Gazebo.
_IN_PACKAGE: Final = re.compile(r"(package|model)://+(?P<name>[^/]+)/(?P<rest>.+)")


@contextmanager
def compiling(path: Path, verb: str = "compile") -> Generator[None]:
    """Report errors of MuJoCo as a `BrokenModel` with the name of a file."""
    try:
        yield
    except ShapechangerError:
        raise
    except (ValueError, mujoco.FatalError) as error:
        raise BrokenModel(f"MuJoCo cannot {verb} {path.name}: {reason_of(error)}.") from error


@dataclass(frozen=True)
class OwnFamily(Family):
    """The bodies that edits make from a user's robot.

    Attributes:
        path: The file; the family is the same only for the same file and rig.
    """

    path: Path = Path()

    @property
    def key(self) -> str:
        """The file and the rig: only bodies with the same key can be interpolated."""
        return f"{self.path}{to_json(self.rig) if self.rig else ''}"

    def load(self, path: str | Path) -> mujoco.MjSpec:
        """Load a model with the rig, and name all its elements.

        A file that a URDF names as `package://NAME/REST` is searched in each folder NAME that
        contains the URDF, or lies next to such a folder.

        Raises:
            BrokenModel: If MuJoCo cannot read or compile it, or no folder has a file of a package.
            MorphologyError: If the rig does not fit it.
        """
        with compiling(Path(path), "read"):
            spec = mujoco.MjSpec.from_file(str(path))
        _find_packages(spec, Path(path))
        # By default, MuJoCo would merge the base of a URDF into the world, and lose its names.
        spec.compiler.fusestatic = False
        name_elements(spec)
        with compiling(Path(path)):
            return reshape(spec, self.rig)


def _find_packages(spec: mujoco.MjSpec, path: Path) -> None:
    """Replace the `package://` paths of a URDF, which only ROS resolves, by paths of files."""
    for element in (*spec.meshes, *spec.textures):
        if element.file.lower().endswith(".dae"):
            raise BrokenModel(
                f"{path.name} names the mesh {element.file}, and MuJoCo does not read COLLADA: "
                "convert it to OBJ or STL."
            )
        package = _IN_PACKAGE.fullmatch(element.file)
        if package is None:
            continue
        name, rest = package["name"], package["rest"]
        folders = (each if each.name == name else each / name for each in path.resolve().parents)
        found = next((folder / rest for folder in folders if (folder / rest).is_file()), None)
        if found is None:
            raise BrokenModel(
                f"{path.name} names the file {element.file}, and neither a folder {name!r} that it "
                f"is in nor one next to these has {rest}: copy the package's folder next to "
                f"{path.name}, or write a path relative to it."
            )
        element.file = str(found)


def own_family(path: str | Path, rig: Body = ()) -> OwnFamily:
    """Return the family of a user's robot.

    Args:
        path: An MJCF or URDF file, or a name of the package `robot_descriptions`, such as
            `go2_mj_description`, which downloads it.
        rig: Edits that are applied before those of any body.

    Raises:
        UnknownName: If there is no such file, or the package has no robot of this name.
        MorphologyError: If the path is a folder, or the package is missing or fails.
    """
    file = Path(path).expanduser()
    if not file.is_file():
        if _DESCRIPTION.fullmatch(str(path)):
            file = _described(str(path))
        elif file.is_dir():
            raise MorphologyError(f"{path} is a folder: name a file of MJCF or URDF in it.")
        else:
            models = (each for each in file.parent.glob("*") if each.suffix in MODEL_FILES)
            known = sorted(each.name for each in models)
            raise UnknownName(f"model in {file.parent.resolve()}", file.name, known)
    return OwnFamily(file.stem, {file.stem: ()}, path=file.resolve(), rig=rig)


def _described(name: str) -> Path:
    """Return the file of a robot of `robot_descriptions`."""
    if importlib.util.find_spec(_PACKAGE) is None:
        raise MorphologyError(
            f"{name} looks like a robot of the package {_PACKAGE}, which is not installed: run "
            f"`pip install {_PACKAGE}`."
        )
    if importlib.util.find_spec(f"{_PACKAGE}.{name}") is None:
        known: Any = importlib.import_module(f"{_PACKAGE}._descriptions").DESCRIPTIONS
        raise UnknownName(f"robot of {_PACKAGE}", name, list(known))
    try:
        module = importlib.import_module(f"{_PACKAGE}.{name}")
    except Exception as error:  # Git, network and file errors of several packages.
        raise MorphologyError(f"{_PACKAGE} cannot fetch {name}: {reason_of(error)}.") from error
    file = getattr(module, "MJCF_PATH", None) or getattr(module, "URDF_PATH", None)
    if file is None:
        raise MorphologyError(f"{name} of {_PACKAGE} has neither MJCF nor URDF.")
    return Path(file)


def require_robot(model: mujoco.MjModel, path: Path) -> None:
    """Raise a MorphologyError unless a model has joints, and actuators with ranges."""
    if not model.njnt:
        raise MorphologyError(f"{path.name} has no joints, so it cannot move.")
    if not model.nu:
        motors = "rig=AddMotor('*')" if path.suffix == ".urdf" else "rig=AddMotor('*', GEAR)"
        raise MorphologyError(
            f"{path.name} has no actuators: add them to the file, or motors with {motors}."
        )
    if unlimited := np.flatnonzero(model.actuator_ctrllimited == 0).tolist():
        raise MorphologyError(
            f"These actuators of {path.name} have no ctrlrange, so their range is unknown: "
            f"{', '.join(model.actuator(i).name for i in unlimited)}."
        )
