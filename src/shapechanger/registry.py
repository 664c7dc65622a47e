"""Registries of parts that packages can add, such as learners and transfer methods.

A part ships with Shapechanger, is registered by a module that has been imported, or is an entry
point of an installed package. It is imported on first use.
"""

from __future__ import annotations

import pkgutil
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any, Final

from shapechanger.errors import StudyError, UnknownName


class Registry:
    """Parts of one kind, keyed by name.

    `shipped` contains the parts of Shapechanger as `module` or `module:attribute` below
    `shapechanger`. Other packages add entry points of `group`, such as `shapechanger.methods`.
    """

    def __init__(self, kind: str, group: str, shipped: dict[str, str]) -> None:
        self._kind = kind
        self._group = group
        self._places = shipped
        self._registered: dict[str, Any] = {}

    def register(self, name: str, part: Any) -> None:
        """Register a part, by a new name of letters, digits, - and _."""
        title = getattr(part, "__name__", repr(part))
        if not name.replace("-", "").replace("_", "").isalnum():
            raise StudyError(
                f"The name of {self._kind} {title} must have only letters, digits, - and _, got "
                f"{name!r}."
            )
        other = self._registered.get(name)
        # A worker process may import the same class again under another module's name.
        is_same = getattr(other, "__qualname__", None) == getattr(part, "__qualname__", "")
        if name in self._places or not (other is None or is_same):
            raise StudyError(
                f"There is already a {self._kind} {name!r}: give {title} another name."
            )
        self._registered[name] = part

    def names(self) -> tuple[str, ...]:
        """Return the names of all shipped, installed and registered parts."""
        installed = (point.name for point in entry_points(group=self._group))
        return tuple(dict.fromkeys([*self._places, *installed, *self._registered]))

    def added(self) -> frozenset[str]:
        """Return the names of parts that do not come with Shapechanger."""
        return frozenset(self.names()) - self._places.keys()

    def load(self, name: str) -> Any:
        """Return a part by its name, or by `module:name` to import a module that registers it."""
        module, _, own = name.rpartition(":")
        if module:
            try:
                import_module(module)
            except ModuleNotFoundError as error:
                raise UnknownName(self._kind, name, self.names()) from error
        if own in self._places:
            return pkgutil.resolve_name(f"shapechanger.{self._places[own]}")
        if own in self._registered:
            return self._registered[own]
        for point in entry_points(group=self._group, name=own):
            return point.load()
        raise UnknownName(self._kind, name, self.names())


LEARNERS: Final = Registry(
    "learner",
    "shapechanger.learners",
    {
        "ppo": "transfer.learners.settings:PpoSettings",
        "ppo-limbs": "transfer.learners.settings:LimbSettings",
        "rsl-ppo": "transfer.learners.settings:RslPpoSettings",
        "rsl-limbs": "transfer.learners.settings:RslLimbSettings",
        "off-policy": "transfer.learners.settings:OffPolicySettings",
        "imported": "transfer.learners.settings:ImportedSettings",
        "cloning": "vehicles.cloning:CloningSettings",
    },
)
"""Classes of settings, subclasses of `shapechanger.transfer.learners.LearnerSettings`."""

METHODS: Final = Registry(
    "method",
    "shapechanger.methods",
    {
        "scratch": "transfer.methods.basic:Scratch",
        "zero-shot": "transfer.methods.basic:ZeroShot",
        "fine-tune": "transfer.methods.basic:FineTune",
        "frozen-trunk": "transfer.methods.training:FrozenTrunk",
        "rehearsal": "transfer.methods.basic:Rehearsal",
        "kickstart": "transfer.methods.training:Kickstart",
        "evolution": "transfer.methods.basic:Evolution",
        "prefilled-replay": "transfer.methods.training:PrefilledReplay",
        "off-dynamics": "transfer.methods.training:OffDynamics",
        "shuffled-map": "transfer.methods.basic:ShuffledMap",
        "randomised": "transfer.methods.basic:Randomised",
        "identified": "transfer.methods.basic:Identified",
        "generalist": "transfer.methods.basic:Generalist",
    },
)
"""Subclasses of `shapechanger.transfer.methods.Method`."""

POLICIES: Final = Registry(
    "kind of policy",
    "shapechanger.policies",
    {
        "trained": "transfer.learners.policy_file:TrainedPolicy.of_file",
        "trained-onnx": "policy:OnnxPolicy",
        "clone": "demos.cloning.network:CameraPolicy.of_file",
        "clone-onnx": "demos.cloning.clone:Clone",
    },
)
"""Functions that build a policy from the content of a file, keyed by kind of policy."""

ROBOTS: Final = Registry(
    "reader of robots", "shapechanger.robots", {"profile": "vehicles.twin:read_robot"}
)
"""Functions that read a robot, so that simulations need not import `shapechanger.robot`."""

MODELS: Final = Registry(
    "kind of model", "shapechanger.models", {"mujoco": "morphology.certificate.changes"}
)
"""Modules that read the numbers of a compiled model, keyed by the library that compiled it."""

MAKERS: Final = Registry(
    "maker of vector envs", "shapechanger.makers", {"make_vec": "envs.make_vec:make_vec"}
)
"""Functions that make vector envs, so that learners do not import envs."""
