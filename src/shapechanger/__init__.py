"""Environments, robots and measurements for transfer learning in robotics.

Importing this package registers its ids with Gymnasium and loads neither a simulator nor torch:

>>> import gymnasium as gym
>>> import shapechanger
>>> env = gym.make("shapechanger/BigAnt-v1")
>>> env.unwrapped.observation_layout.names[0]
'torso/z'

The names below are the public interface; each is imported on first use and may need an extra.

- Layouts: `Layout`, `Feature`, `Element` name the numbers of observations and actions.
- Body edits: `Stretch`, `Radius`, `Cut`, `Remove`, `Split`, `AddSegment`, `AddLimb`, `Mass`,
  `Density`, `Gear`, `Damping`, `Stiffness`, `Friction`, `JointRange`, `Lock`, `Gravity`,
  `StartHeight`, `PlaceBody`, `PlaceGeom`, `TotalMass`, `AddMotor`, `AddFreeJoint` and `AddFloor`
  are values; `reshape` and `compile_body` apply them, `interpolate` returns a body between two
  bodies, `certify` lists what a shift changes. Subclass `morphology.Edit` for custom edits.
- Envs: `from_mjcf` makes an env of a custom robot and task, `make_vec` makes vector envs, and
  `examine` runs the checks that every env must pass.
- Transfer: `BodyMap` maps observations and actions between bodies, `transplant` moves a policy's
  weights, `TransferTask`, `make_plan` and `run_study` measure the effect of transfer, `load_policy`
  and `save_policy` read and write policies.
- Robots and demonstrations: `RobotClient`, `load_dataset`, `load_log`.
"""

from __future__ import annotations

import importlib
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final

from shapechanger.envs.catalogue import register_all
from shapechanger.errors import ShapechangerError as ShapechangerError
from shapechanger.layout import Element as Element
from shapechanger.layout import Feature as Feature
from shapechanger.layout import Layout as Layout

if TYPE_CHECKING:
    from shapechanger.contract.testing import examine as examine
    from shapechanger.demos.dataset import Dataset as Dataset
    from shapechanger.demos.dataset import load_dataset as load_dataset
    from shapechanger.envs.make_vec import make_vec as make_vec
    from shapechanger.envs.own import from_mjcf as from_mjcf
    from shapechanger.finger.identify import load_log as load_log
    from shapechanger.morphology import AddFloor as AddFloor
    from shapechanger.morphology import AddFreeJoint as AddFreeJoint
    from shapechanger.morphology import AddLimb as AddLimb
    from shapechanger.morphology import AddMotor as AddMotor
    from shapechanger.morphology import AddSegment as AddSegment
    from shapechanger.morphology import Cut as Cut
    from shapechanger.morphology import Damping as Damping
    from shapechanger.morphology import Density as Density
    from shapechanger.morphology import Friction as Friction
    from shapechanger.morphology import Gear as Gear
    from shapechanger.morphology import Gravity as Gravity
    from shapechanger.morphology import JointRange as JointRange
    from shapechanger.morphology import Lock as Lock
    from shapechanger.morphology import Mass as Mass
    from shapechanger.morphology import PlaceBody as PlaceBody
    from shapechanger.morphology import PlaceGeom as PlaceGeom
    from shapechanger.morphology import Radius as Radius
    from shapechanger.morphology import Remove as Remove
    from shapechanger.morphology import Split as Split
    from shapechanger.morphology import StartHeight as StartHeight
    from shapechanger.morphology import Stiffness as Stiffness
    from shapechanger.morphology import Stretch as Stretch
    from shapechanger.morphology import TotalMass as TotalMass
    from shapechanger.morphology import compile_body as compile_body
    from shapechanger.morphology import interpolate as interpolate
    from shapechanger.morphology import reshape as reshape
    from shapechanger.morphology.certificate import Certificate as Certificate
    from shapechanger.morphology.certificate import certify as certify
    from shapechanger.policy import load_policy as load_policy
    from shapechanger.policy import save_policy as save_policy
    from shapechanger.robot.client.client import RobotClient as RobotClient
    from shapechanger.transfer import BodyMap as BodyMap
    from shapechanger.transfer import TransferTask as TransferTask
    from shapechanger.transfer.study import make_plan as make_plan
    from shapechanger.transfer.study import run_study as run_study
    from shapechanger.transfer.transplant import transplant as transplant

__version__: Final = version("shapechanger")

# Names that are imported on first use, keyed by module.
_NAMES: Final = {
    "contract.testing": "examine",
    "demos.dataset": "Dataset load_dataset",
    "envs.make_vec": "make_vec",
    "envs.own": "from_mjcf",
    "finger.identify": "load_log",
    "morphology": (
        "AddFloor AddFreeJoint AddLimb AddMotor AddSegment Cut Damping Density Friction Gear "
        "Gravity JointRange Lock Mass PlaceBody PlaceGeom Radius Remove Split StartHeight "
        "Stiffness Stretch TotalMass compile_body interpolate reshape"
    ),
    "morphology.certificate": "Certificate certify",
    "policy": "load_policy save_policy",
    "robot.client.client": "RobotClient",
    "transfer": "BodyMap TransferTask",
    "transfer.study": "make_plan run_study",
    "transfer.transplant": "transplant",
}
_MODULES: Final = {name: module for module, names in _NAMES.items() for name in names.split()}
# For type checkers, the imports above define these names.
__all__ = [*_MODULES, "Element", "Feature", "Layout", "ShapechangerError", "__version__"]  # pyright: ignore[reportUnsupportedDunderAll]

register_all()


def __getattr__(name: str) -> Any:
    """Import a public name on first use (PEP 562).

    Raises:
        AttributeError: If the package has no such name.
        MissingExtra: If the name needs an extra that is not installed.
    """
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(f"{__name__}.{_MODULES[name]}")
    return globals().setdefault(name, getattr(module, name))


def __dir__() -> list[str]:
    """Return the names of the package, including those not imported yet."""
    return sorted({*globals(), *__all__})
