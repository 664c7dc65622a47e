"""Policies of any kind from a file: trained, cloned, and both as exported for other programs."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from shapechanger.errors import CorruptStudy, no_policy_file

if TYPE_CHECKING:
    from shapechanger.demos.cloning.onnx_policy import OnnxClone
    from shapechanger.demos.cloning.policy import CameraPolicy
    from shapechanger.transfer.learners.policy_file import TrainedPolicy
    from shapechanger.transfer.onnx_policy import OnnxPolicy

    AnyPolicy: TypeAlias = TrainedPolicy | CameraPolicy | OnnxPolicy | OnnxClone


def load_policy(path: str | PathLike[str], algorithm: str = "") -> AnyPolicy:
    """Load a policy of any kind; no code in the file is run.

    Each kind has a `card` with its origin, and `act`, from observations of shape (n, ...) to
    actions of shape (n, m). ONNX files need no PyTorch.

    Args:
        path: A file that a training, a study, a cloning or `shapechanger policies export` wrote.
        algorithm: An algorithm of yours, a class or function as `module:name`, that the file may
            name, see `shapechanger.transfer.learners.policy_file.load_policy`.

    Raises:
        CorruptStudy: If the file is missing, is no policy, or has been changed.
        PolicyError: The same of a cloned policy.
        MissingExtra: If what the kind needs is not installed.
    """
    file = Path(path)
    if not file.exists():
        raise CorruptStudy(no_policy_file(file))
    if file.suffix == ".onnx":
        from shapechanger.demos.cloning.onnx_policy import OnnxClone, is_onnx_clone
        from shapechanger.transfer.onnx_policy import OnnxPolicy

        return OnnxClone(file) if is_onnx_clone(file) else OnnxPolicy(file)
    from shapechanger.demos.cloning.policy import CameraPolicy
    from shapechanger.transfer.learners import policy_file
    from shapechanger.transfer.learners.cloning import is_clone

    return CameraPolicy.load(file) if is_clone(file) else policy_file.load_policy(file, algorithm)
