"""Environments, robots and measurements for transfer learning in robotics.

Importing this package registers its ids with Gymnasium and loads neither a simulator nor torch:

>>> import gymnasium as gym
>>> import shapechanger
>>> env = gym.make("shapechanger/BigAnt-v1")
>>> env.unwrapped.observation_layout.names[0]
'torso/z'

The names below are the public interface; most are imported on first use and may need an extra.

- Layouts: `Layout`, `Feature`, `Element` name the numbers of observations and actions.
- Body edits: `Stretch`, `Radius`, `Cut`, `Remove`, `Split`, `AddSegment`, `AddLimb`, `Mass`,
  `Density`, `Gear`, `Damping`, `Stiffness`, `Friction`, `JointRange`, `Lock`, `Gravity`,
  `StartHeight`, `PlaceBody`, `PlaceGeom`, `TotalMass`, `AddMotor`, `AddFreeJoint` and `AddFloor`
  are values; `reshape` and `compile_body` apply them, `interpolate` returns a body between two
  bodies, `certify` a `Certificate` of a shift's changes. Subclass `morphology.Edit` for your own.
- Envs: `from_mjcf` makes an env of a custom robot and task, `make_vec` makes vector envs, and
  `examine` runs the checks that every env must pass.
- Transfer: `BodyMap` maps observations and actions between bodies, `transplant` moves a policy's
  weights, `TransferTask`, `make_plan` and `run_study` measure the effect of transfer, `load_policy`
  and `save_policy` read and write policies.
- Robots and demonstrations: `RobotClient`, `load_dataset`, which returns a `Dataset`, `load_log`.
- `ShapechangerError` is the base class of all exceptions of this package.
"""

from __future__ import annotations

import importlib
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final

from shapechanger.envs.catalogue import register_all
from shapechanger.errors import ShapechangerError
from shapechanger.layout import Element, Feature, Layout

if TYPE_CHECKING:
    from shapechanger.contract.testing import examine
    from shapechanger.demos.dataset import Dataset, load_dataset
    from shapechanger.envs.make_vec import make_vec
    from shapechanger.envs.own import from_mjcf
    from shapechanger.finger.identify import load_log
    from shapechanger.morphology import (
        AddFloor,
        AddFreeJoint,
        AddLimb,
        AddMotor,
        AddSegment,
        Cut,
        Damping,
        Density,
        Friction,
        Gear,
        Gravity,
        JointRange,
        Lock,
        Mass,
        PlaceBody,
        PlaceGeom,
        Radius,
        Remove,
        Split,
        StartHeight,
        Stiffness,
        Stretch,
        TotalMass,
        compile_body,
        interpolate,
        reshape,
    )
    from shapechanger.morphology.certificate import Certificate, certify
    from shapechanger.policy import load_policy, save_policy
    from shapechanger.robot.client.client import RobotClient
    from shapechanger.transfer import BodyMap, TransferTask
    from shapechanger.transfer.study import make_plan, run_study
    from shapechanger.transfer.transplant import transplant

__all__ = [
    "AddFloor",
    "AddFreeJoint",
    "AddLimb",
    "AddMotor",
    "AddSegment",
    "BodyMap",
    "Certificate",
    "Cut",
    "Damping",
    "Dataset",
    "Density",
    "Element",
    "Feature",
    "Friction",
    "Gear",
    "Gravity",
    "JointRange",
    "Layout",
    "Lock",
    "Mass",
    "PlaceBody",
    "PlaceGeom",
    "Radius",
    "Remove",
    "RobotClient",
    "ShapechangerError",
    "Split",
    "StartHeight",
    "Stiffness",
    "Stretch",
    "TotalMass",
    "TransferTask",
    "__version__",
    "certify",
    "compile_body",
    "examine",
    "from_mjcf",
    "interpolate",
    "load_dataset",
    "load_log",
    "load_policy",
    "make_plan",
    "make_vec",
    "reshape",
    "run_study",
    "save_policy",
    "transplant",
]

__version__: Final = version("shapechanger")

# Modules of the names that are imported on first use; names that are not here are in `morphology`.
_MODULES: Final = {
    "BodyMap": "transfer",
    "Certificate": "morphology.certificate",
    "Dataset": "demos.dataset",
    "RobotClient": "robot.client.client",
    "TransferTask": "transfer",
    "certify": "morphology.certificate",
    "examine": "contract.testing",
    "from_mjcf": "envs.own",
    "load_dataset": "demos.dataset",
    "load_log": "finger.identify",
    "load_policy": "policy",
    "make_plan": "transfer.study",
    "make_vec": "envs.make_vec",
    "run_study": "transfer.study",
    "save_policy": "policy",
    "transplant": "transfer.transplant",
}

register_all()


def __getattr__(name: str) -> Any:
    """Import a public name on first use (PEP 562).

    Raises:
        AttributeError: If the package has no such name.
        MissingExtra: If the name needs an extra that is not installed.
    """
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(f"{__name__}.{_MODULES.get(name, 'morphology')}")
    return globals().setdefault(name, getattr(module, name))


def __dir__() -> list[str]:
    """Return the names of the package, including those not imported yet."""
    return sorted({*globals(), *__all__})
