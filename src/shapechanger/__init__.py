"""Environments, robots and measurements for transfer learning in robotics.

Importing this package registers its ids with Gymnasium and loads neither a simulator nor torch:

>>> import gymnasium as gym
>>> import shapechanger
>>> env = gym.make("shapechanger/BigAnt-v1")
>>> env.unwrapped.observation_layout.names[0]
'torso/z'

The names below are the public interface; each is imported on first use and may need an extra.

- Layouts: `Layout`, `Feature`, `Element` name the numbers that a robot senses and moves.
- Body edits: `Stretch`, `Radius`, `Cut`, `Remove`, `Split`, `AddSegment`, `AddLimb`, `Mass`,
  `Density`, `Gear`, `Damping`, `Stiffness`, `Friction`, `JointRange`, `Lock`, `Gravity`,
  `StartHeight`, `PlaceBody`, `PlaceGeom`, `TotalMass`, `AddMotor`, `AddFreeJoint` and `AddFloor`
  are values; `reshape` and `compile_body` apply them, `interpolate` goes from one body to another,
  `certify` proves what a shift changes. Subclass `morphology.Edit` for your own.
- Envs: `from_mjcf` makes one of your own robot and task, `make_vec` many at once; `examine`
  runs the exam that every env passes.
- Transfer: `BodyMap` maps one body's numbers to another's, `transplant` moves a policy's weights,
  `TransferTask`, `make_plan` and `run_study` measure what a transfer is worth, `load_policy` and
  `save_policy` store policies.
- Robots and demonstrations: `RobotClient`, `load_dataset`, `load_log`.
"""

from __future__ import annotations

import importlib
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final

from shapechanger.envs.catalogue import register_all
from shapechanger.errors import ShapechangerError
from shapechanger.layout import Element, Feature, Layout
from shapechanger.registry import LEARNERS, MAKERS, METHODS, MODELS, POLICIES, ROBOTS

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

_MODULES: Final = {
    "contract.testing": ("examine",),
    "demos.dataset": ("Dataset", "load_dataset"),
    "envs.own": ("from_mjcf",),
    "envs.make_vec": ("make_vec",),
    "finger.identify": ("load_log",),
    "morphology": (
        *("AddLimb", "AddSegment", "Cut", "Damping", "Density", "Friction", "Gear", "Gravity"),
        *("JointRange", "Lock", "Mass", "Radius", "Remove", "Split", "StartHeight", "Stiffness"),
        *("Stretch", "compile_body", "interpolate", "reshape"),
        *("PlaceBody", "PlaceGeom", "TotalMass", "AddMotor", "AddFreeJoint", "AddFloor"),
    ),
    "morphology.certificate": ("Certificate", "certify"),
    "policy": ("load_policy", "save_policy"),
    "robot.client.client": ("RobotClient",),
    "transfer": ("BodyMap", "TransferTask"),
    "transfer.study": ("make_plan", "run_study"),
    "transfer.transplant": ("transplant",),
}
_LAZY: Final = {name: module for module, names in _MODULES.items() for name in names}

register_all()
_BASIC: Final = "transfer.methods.basic"
METHODS.ship(
    {
        "scratch": f"{_BASIC}:Scratch",
        "zero-shot": f"{_BASIC}:ZeroShot",
        "fine-tune": f"{_BASIC}:FineTune",
        "frozen-trunk": "transfer.methods.frozen_trunk:FrozenTrunk",
        "rehearsal": "transfer.methods.rehearsal:Rehearsal",
        "kickstart": "transfer.methods.kickstart:Kickstart",
        "evolution": "transfer.methods.evolution:Evolution",
        "prefilled-replay": "transfer.methods.replay:PrefilledReplay",
        "off-dynamics": "transfer.methods.replay:OffDynamics",
        "shuffled-map": "transfer.methods.shuffled_map:ShuffledMap",
        "randomised": "transfer.methods.adapted_source:Randomised",
        "identified": "transfer.methods.adapted_source:Identified",
        "generalist": "transfer.methods.generalist:Generalist",
    }
)
_SETTINGS: Final = "transfer.learners.settings"
LEARNERS.ship(
    {
        "ppo": f"{_SETTINGS}:PpoSettings",
        "ppo-limbs": f"{_SETTINGS}:LimbSettings",
        "rsl-ppo": f"{_SETTINGS}:RslPpoSettings",
        "rsl-limbs": f"{_SETTINGS}:RslLimbSettings",
        "off-policy": f"{_SETTINGS}:OffPolicySettings",
        "imported": f"{_SETTINGS}:ImportedSettings",
        "cloning": "vehicles.cloning:CloningSettings",
    }
)
MAKERS.ship({"make_vec": "envs.make_vec:make_vec"})
MODELS.ship({"mujoco": "morphology.certificate.changes:ModelNumbers"})
POLICIES.ship(
    {
        "trained": "transfer.learners.policy_file:TrainedPolicy.of_file",
        "trained-onnx": "policy:OnnxPolicy",
        "clone": "demos.cloning.network:CameraPolicy.of_file",
        "clone-onnx": "demos.cloning.clone:OnnxClone",
    }
)
ROBOTS.ship({"profile": "vehicles.twin:read_robot"})


def __getattr__(name: str) -> Any:
    """Import a public name on first use (PEP 562).

    Raises:
        AttributeError: If the package has no such name.
        MissingExtra: If the name needs an extra that is not installed.
    """
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_LAZY[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the names of the package, including those not imported yet."""
    return sorted({*globals(), *_LAZY})
