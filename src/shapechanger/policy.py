"""Files of policies: their format, their card, and one function that reads every kind.

A file is safetensors (github.com/huggingface/safetensors: 8 bytes of length, a JSON header, then
the numbers) with a card in JSON and a hash, or ONNX with the same card. Reading a file does not run
code that it contains.
"""

from __future__ import annotations

import copy
import hashlib
import json
import logging
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any, Final, Literal, Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import MissingExtra, PolicyError, no_policy_file, translate_errors
from shapechanger.files import make_folder, read_file, write_atomic
from shapechanger.identity import Identity
from shapechanger.layout import Layout
from shapechanger.registry import POLICIES

ONNX_CARD: Final = "shapechanger"
"""Key of the card in the metadata of an ONNX file."""
STEERING: Final = ("steering", "throttle")
"""Names of the values of an action if the policy has no action layout."""

MAX_BYTES: Final = 2**28
"""Size of the largest file that is read, bytes."""

_CARD: Final = "card"
_HASH: Final = "sha256"
_LENGTH_BYTES: Final = 8
_MAX_HEADER_BYTES: Final = 2**22  # Parsed JSON needs twenty times as much memory.
_LONGEST: Final = 200  # Longest reason in a message, characters.
_MAX_MEMBERS: Final = 32  # Limits the work that a forged card can cause.


class Framing(msgspec.Struct, frozen=True, kw_only=True):
    """Crop and resolution of the images of a policy.

    Attributes:
        height: Rows of the reduced image.
        width: Columns of the reduced image.
        top: Share of the rows that is cut off at the top, in [0, 1).
    """

    # Half the resolution of a 160 x 120 image, without the top fifth, in which a camera a few
    # centimetres above the floor sees ceiling or sky.
    height: int = 48
    width: int = 80
    top: float = 0.2

    def __post_init__(self) -> None:
        if min(self.height, self.width) < 1 or not 0.0 <= self.top < 1.0:
            raise PolicyError(
                f"Invalid framing of images: sizes must be > 0, top in [0, 1): {self}."
            )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Rows, columns and colours of the reduced image."""
        return self.height, self.width, 3


class CloneNetwork(msgspec.Struct, frozen=True, kw_only=True):
    """Architecture of a policy that was cloned from demonstrations.

    Attributes:
        framing: Part of the image that the policy sees.
        channels: Filters of each convolution.
        features: Number of features between image and actions.
        eyes: Input of the first layer: "colours" or "edges" of an image; "none" without images.
        nerves: Widths of the layers for the state; () without a state.
        members: Number of networks whose outputs are averaged.
        classes: Actions to choose from; () for continuous actions.
        class_names: Names of the classes.
        unseen: Names of state values that the policy ignores.
        low: Action for an output of -1; () for -1 each.
        high: Action for an output of 1; () for 1 each.
        seeds: Seeds of the trainings in order; () for an untrained network.
        body: Kind of robot that an exported policy was trained for, such as "car"; "" for any.
        control_hz: Actions per second in the demonstrations; None if unknown.
    """

    framing: Framing
    channels: tuple[int, ...]
    features: int
    eyes: Literal["colours", "edges", "none"] = "colours"
    nerves: tuple[int, ...] = ()
    members: int = 1
    classes: tuple[tuple[float, ...], ...] = ()
    class_names: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    seeds: tuple[int, ...] = ()
    body: str = ""
    control_hz: float | None = None

    def __post_init__(self) -> None:
        if not self.channels or min(self.features, *self.channels, *self.nerves) < 1:
            raise PolicyError("channels, features and nerves must be positive.")
        if not 1 <= self.members <= _MAX_MEMBERS:
            raise PolicyError(f"members must be from 1 to {_MAX_MEMBERS}, got {self.members}.")
        if self.eyes == "none" and not self.nerves:
            raise PolicyError("A policy needs images, a state, or both.")
        if len(self.class_names) != len(self.classes):
            raise PolicyError("Each class must have a name.")


class PolicyCard(msgspec.Struct, frozen=True, kw_only=True):
    """Provenance of a policy.

    Attributes:
        env: The env of the training; None for recordings.
        observation: Layout of the observed numbers; None for images alone.
        action: Layout of the actions; None for steering and throttle in [-1, 1] of any vehicle.
        learner: Name of the learner.
        settings: Settings of the learner; None in an ONNX file.
        steps: Env steps of the training; for a clone, the number of demonstrated steps.
        seed: Seed of the training.
        version: Version of Shapechanger.
        identity: Identities of the env and the learner, see `shapechanger.transfer.identities`.
        command: The command that wrote the file; empty in a study, whose `study.json` has it.
        start_log_std: If the training started from another policy, the initial logarithm of the
            standard deviation of each action; None otherwise, or if it is not a parameter.
        clone: Architecture of a clone; None for other policies, whose `settings` define it.
        data: Origin of the demonstrations of a clone; JSON values.
    """

    env: EnvRef | None = None
    observation: Layout | None = None
    action: Layout | None = None
    learner: str
    settings: Any = None
    steps: int = 0
    seed: int = 0
    version: str = msgspec.field(default_factory=lambda: version("shapechanger"))
    identity: dict[str, Identity] = {}
    command: str = ""
    start_log_std: tuple[float, ...] | None = None
    clone: CloneNetwork | None = None
    data: dict[str, Any] = {}

    def __post_init__(self) -> None:
        net, size = self.clone, self.action_size
        if net is None:
            if None in (self.env, self.observation, self.action):
                raise PolicyError("The card of a policy must have an env and both layouts.")
            return
        if bool(net.nerves) != (self.observation is not None):
            raise PolicyError("nerves and a layout of the state must be given together.")
        if any(len(values) != size for values in (*net.classes, net.low or [0] * size)):
            raise PolicyError(f"Classes, low and high must have {size} values.")
        if len(net.low) != len(net.high):
            raise PolicyError("low and high must be given together.")

    @property
    def trained_in(self) -> EnvRef:
        """The env of the training; raises PolicyError if the policy learned from recordings."""
        if self.env is None:
            raise PolicyError("This policy learned from recordings without an env.")
        return self.env

    @property
    def network(self) -> CloneNetwork:
        """The architecture of a clone; raises PolicyError for another policy."""
        if self.clone is None:
            raise PolicyError(f"A clone is needed here, and this policy learned by {self.learner}.")
        return self.clone

    @property
    def layouts(self) -> tuple[Layout, Layout]:
        """Layouts of observations and actions; raises PolicyError for a clone without both."""
        if self.observation is None or self.action is None:
            raise PolicyError(f"A policy of numbers is needed, and this is a {self.learner} clone.")
        return self.observation, self.action

    @property
    def action_size(self) -> int:
        """Number of values in an action."""
        return len(STEERING) if self.action is None else self.action.size

    @property
    def shapes(self) -> dict[str, list[int]]:
        """Shapes of the inputs and the output of an ONNX file, without their first axis."""
        if (net := self.clone) is None:
            return {"observation": [self.layouts[0].size], "action": [self.action_size]}
        shapes = {} if net.eyes == "none" else {"picture": list(net.framing.shape)}
        if self.observation is not None:
            shapes["state"] = [self.observation.size]
        return shapes | {"output": [len(net.classes) or self.action_size]}

    def require_layouts(self, actions: Layout, state: Layout | None = None) -> None:
        """Raise PolicyError if a clone's layouts differ from the layouts of a robot or an env."""
        mine, theirs = map(_text, (self.action, actions))
        if self.action is None:
            mine, theirs = ", ".join(STEERING), ", ".join(actions.names)
        if mine != theirs:
            raise PolicyError(
                f"The actions of the policy are {mine}, but those required here are {theirs}."
            )
        if self.observation is not None and _text(self.observation) != _text(state):
            raise PolicyError(
                f"The policy needs the state {_text(self.observation)}, but it gets {_text(state)}."
            )


def _text(layout: Layout | None) -> str:
    features = (f"{f}{f' x {f.shape}' if f.shape else ''}" for f in layout or ())
    return ", ".join(features) or "none"


class Policy(ABC):
    """A policy of any kind.

    Attributes:
        card: Provenance of the policy.
    """

    card: PolicyCard

    @abstractmethod
    def act(self, observations: Any) -> NDArray[Any]:
        """Return an action for each observation of an env, shape (n, m).

        Args:
            observations: Shape (n, ...); for a clone that needs images and a state, a mapping with
                `image` and `state`.
        """

    def tensors(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of the policy's file, keyed by name."""
        raise PolicyError("A policy from an ONNX file cannot be written again: copy the file.")

    def carded(self, **changes: Any) -> Self:
        """Return the same policy with other values of its card."""
        other = copy.copy(self)
        other.card = msgspec.structs.replace(self.card, **changes)
        return other

    def save(self, path: Path) -> None:
        """Write the policy to one file of safetensors; a missing folder is made."""
        content = tensor_bytes(self.tensors(), msgspec.json.encode(self.card))
        make_folder(path.parent)
        write_atomic(path, content)


class OnnxPolicy(Policy):
    """A trained policy from an ONNX file; its network, `run`, does not need PyTorch."""

    def __init__(self, card: PolicyCard, run: Network) -> None:
        self.card, self._run = card, run

    def act(self, observations: NDArray[Any]) -> NDArray[np.float32]:
        """Return the mean actions, shape (n, actions), for observations, (n, observations)."""
        (size,) = self.card.shapes["observation"]
        if observations.ndim != 2 or observations.shape[1] != size:
            raise PolicyError(
                f"Observations must have the shape (n, {size}), got {observations.shape}."
            )
        return self._run({"observation": np.asarray(observations, np.float64)})


def load_policy(path: str | PathLike[str], algorithm: str = "") -> Any:
    """Load a policy of any kind; no code in the file is run.

    The result is a `Policy`: its `card` describes its origin, and its `act` maps observations of
    shape (n, ...) to actions of shape (n, m). ONNX files do not need PyTorch.

    Args:
        path: A file that a training, a study, a cloning or `shapechanger policies export` wrote. It
            is read once, so later changes have no effect.
        algorithm: Your algorithm, a class or function as `module:name`, if the file names it.
            Without this argument, a file may only name classes of models of Stable-Baselines3,
            sb3-contrib or a module that is already imported.

    Raises:
        PolicyError: If the file is missing, is not a policy, or does not match its hash.
        MissingExtra: If a package that this kind of policy needs is not installed.
    """
    file = Path(path)
    exported = file.suffix == ".onnx"
    try:
        card, content = read_network(file) if exported else read_tensors(file)
        kind = ("trained" if card.clone is None else "clone") + ("-onnx" if exported else "")
        read = POLICIES.load(kind)
        return read(card, content, algorithm) if kind == "trained" else read(card, content)
    except FileNotFoundError as missing:
        raise PolicyError(no_policy_file(file)) from missing
    except (PolicyError, MissingExtra):
        raise
    except Exception as cause:  # The errors of libraries have no common base.
        reason = str(getattr(cause, "strerror", cause)).strip()
        text = reason.partition("\n")[0][:_LONGEST].rstrip(".: ") or "it needs too much memory"
        text = f"it lacks {text}" if isinstance(cause, KeyError) else text
        raise PolicyError(
            f"{file} is not a policy that Shapechanger has written ({text})."
        ) from cause


def save_policy(policy: Policy, path: str | PathLike[str]) -> None:
    """Write a policy of any kind to a file, such as `Ant-v1.safetensors`.

    Raises:
        OutputError: If the file cannot be written.
    """
    policy.save(Path(path))


def tensor_bytes(tensors: Mapping[str, NDArray[Any]], card: bytes) -> bytes:
    """Return the content of a policy file; equal arguments give equal bytes."""
    # Safetensors would store the bytes of an array in the order of its memory.
    arrays = {name: np.asarray(value, order="C") for name, value in tensors.items()}
    content = _safetensors().save(arrays, metadata={_CARD: card.decode()})
    # Safetensors writes the metadata in random order, so the header is written again.
    end = _LENGTH_BYTES + int.from_bytes(content[:_LENGTH_BYTES], "little")
    header = json.loads(content[_LENGTH_BYTES:end])
    header["__metadata__"][_HASH] = _digest(card, arrays)
    text = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % _LENGTH_BYTES)
    return len(text).to_bytes(_LENGTH_BYTES, "little") + text + content[end:]


def read_tensors(path: Path) -> tuple[PolicyCard, dict[str, NDArray[Any]]]:
    """Return the card of a file of safetensors, and its arrays keyed by name."""
    content = read_file(path, MAX_BYTES)
    length = int.from_bytes(content[:_LENGTH_BYTES], "little")
    try:
        if length > _MAX_HEADER_BYTES:
            raise ValueError(length)
        header = json.loads(content[_LENGTH_BYTES : _LENGTH_BYTES + length])
        metadata = msgspec.convert(header["__metadata__"], dict[str, str])
    except (ValueError, LookupError, TypeError, RecursionError, msgspec.MsgspecError) as error:
        raise ValueError("it is not a safetensors file with a card") from error
    tensors = _safetensors().load(content)
    card = metadata[_CARD].encode()
    if _digest(card, tensors) != metadata[_HASH]:
        raise ValueError("its card or its numbers do not match its hash")
    return msgspec.json.decode(card, type=PolicyCard), tensors


def _safetensors() -> Any:
    with translate_errors(ImportError, to=lambda _: MissingExtra("safetensors", "learn")):
        return import_module("safetensors.numpy")


def _digest(card: bytes, tensors: Mapping[str, NDArray[Any]]) -> str:
    """Return the SHA-256 of card, names, types, shapes and numbers."""
    digest = hashlib.sha256(f" {len(card)} ".encode() + card)
    for name in sorted(tensors):
        array = tensors[name]
        digest.update(f"{name} {array.dtype} {array.shape} ".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


Network = Callable[[Mapping[str, NDArray[Any]]], NDArray[np.float32]]
"""A network: maps inputs keyed by name, each of shape (n, ...), to its output."""


def read_network(path: Path) -> tuple[PolicyCard, Network]:
    """Return the card of an ONNX file, and its network, which runs on the CPU without PyTorch."""
    content = read_file(path, MAX_BYTES)
    with translate_errors(ImportError, to=lambda _: MissingExtra("onnxruntime", "onboard")):
        runtime: Any = import_module("onnxruntime")
    options = runtime.SessionOptions()
    options.intra_op_num_threads = 1  # More threads do not make a small network faster.
    options.log_severity_level = 4  # Errors are raised instead of being logged.
    session = runtime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    facts = session.get_modelmeta().custom_metadata_map
    if ONNX_CARD not in facts:
        raise ValueError("it has no card of Shapechanger")
    card = msgspec.json.decode(facts[ONNX_CARD], type=PolicyCard)
    sides = (*session.get_inputs(), *session.get_outputs())
    if (found := {side.name: list(side.shape[1:]) for side in sides}) != card.shapes:
        raise ValueError(f"its network takes and gives {found}, and its card states {card.shapes}")
    return card, lambda inputs: session.run(None, dict(inputs))[0]


def export_network(
    network: Any, inputs: Mapping[str, Any], card: PolicyCard, path: Path, **facts: str
) -> None:
    """Write a network of PyTorch as ONNX, with the card of its policy, without its settings.

    The arguments of its `forward` are the inputs in their order. Each value of `inputs` is an
    example of shape (2, ...), whose first axis may have any length in the file. The last key of the
    card's `shapes` is the name of the output. `facts` are additional metadata.

    Raises:
        MissingExtra: If onnx or onnxscript is not installed.
        OutputError: If the file cannot be written.
    """
    with translate_errors(ImportError, to=lambda _: MissingExtra("onnxscript", "onnx")):
        operators: Any = import_module("onnxscript").opset18
    torch: Any = import_module("torch")

    def hypot(x: Any, y: Any) -> Any:
        """Translate `hypot`, which ONNX lacks."""
        return operators.Sqrt(operators.Add(operators.Mul(x, x), operators.Mul(y, y)))

    many = torch.export.Dim("n", min=1)
    log = logging.getLogger("torch.onnx")
    level = log.level
    log.setLevel(logging.ERROR)  # Hide warnings about packages that these networks do not need.
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            program = torch.onnx.export(
                network.eval(),
                tuple(inputs.values()),
                input_names=[*inputs],
                output_names=[[*card.shapes][-1]],
                dynamic_shapes=(tuple({0: many} for _ in inputs),),
                opset_version=18,
                custom_translation_table={torch.ops.aten.hypot.default: hypot},
                dynamo=True,
                verbose=False,
            )
    finally:
        log.setLevel(level)
    model = program.model_proto
    text = msgspec.json.encode(msgspec.structs.replace(card, settings=None)).decode()
    for name, value in {**facts, ONNX_CARD: text}.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = name, value
    make_folder(path.parent)
    write_atomic(path, model.SerializeToString())
