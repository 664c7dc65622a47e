"""Policies as ONNX files, which run without PyTorch.

The file holds the policy's mean action with its normalisation and bounds. Its metadata has the
names of the layouts and the card, so that a program that knows nothing of Shapechanger can see what
each number is. Reading one runs no code from it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import (
    CorruptStudy,
    MissingExtra,
    StudyError,
    TransplantError,
    no_policy_file,
)
from shapechanger.files import write_atomic
from shapechanger.identity import Identity
from shapechanger.layout import Layout
from shapechanger.transfer.actions import ActionScale

if TYPE_CHECKING:
    from shapechanger.transfer.learners.policy_file import TrainedPolicy

_CARD: Final = "shapechanger"
_OPSET: Final = 17
# The intermediate representation of ONNX 1.12, which every runtime since 2022 reads.
_IR_VERSION: Final = 8


class OnnxCard(msgspec.Struct, frozen=True):
    """Provenance of a policy in an ONNX file: a part of its `PolicyCard`.

    Attributes:
        env: The env that it was trained in.
        observation: Layout of its observations.
        action: Layout of its actions.
        learner: Name of the learner.
        steps: Env steps of training.
        seed: Seed of the training.
        version: Version of Shapechanger.
        identity: Version of the env and of the learner.
    """

    env: EnvRef
    observation: Layout
    action: Layout
    learner: str
    steps: int
    seed: int
    version: str
    identity: dict[str, Identity]


class OnnxGraph:
    """An ONNX graph that is built operator by operator.

    Attributes:
        constants: Its constants by name.

    Raises:
        MissingExtra: If onnx is not installed.
    """

    def __init__(self) -> None:
        try:
            import onnx
            from onnx import helper, numpy_helper
        except ImportError as error:
            raise MissingExtra("onnx", "onnx") from error
        self._onnx: Any = onnx
        self._make: Any = helper
        self._numbers: Any = numpy_helper
        self._nodes: list[Any] = []
        self.constants: dict[str, NDArray[Any]] = {}

    def apply(self, operator: str, *inputs: str | NDArray[Any], to: str = "", **more: Any) -> str:
        """Add an operator, and return the name of its output.

        Args:
            operator: Its name in ONNX.
            *inputs: Outputs of others by name, and constants.
            to: Name of its output; made up if not given.
            **more: Its attributes.
        """
        names: list[str] = []
        for each in inputs:
            if not isinstance(each, str):
                self.constants[f"constant_{len(self.constants)}"] = each
                each = f"constant_{len(self.constants) - 1}"
            names.append(each)
        output = to or f"{operator.lower()}_{len(self._nodes)}"
        self._nodes.append(self._make.make_node(operator, names, [output], **more))
        return output

    def as_float(self, name: str) -> str:
        """Return an output with float32 numbers."""
        output = f"float_{len(self._nodes)}"
        kind = self._onnx.TensorProto.FLOAT
        self._nodes.append(self._make.make_node("Cast", [name], [output], to=kind))
        return output

    def write(self, path: Path, card: OnnxCard) -> None:
        """Write the graph, from `observation` to `action`.

        Args:
            path: The file.
            card: Provenance, which goes into the metadata.

        Raises:
            OutputError: If it cannot be written.
        """
        make, kinds = self._make, self._onnx.TensorProto
        sides = (
            ("observation", kinds.DOUBLE, card.observation),
            ("action", kinds.FLOAT, card.action),
        )
        seen, done = (
            make.make_tensor_value_info(name, kind, ["n", layout.size])
            for name, kind, layout in sides
        )
        tensors = [
            self._numbers.from_array(np.asarray(value), name)
            for name, value in self.constants.items()
        ]
        graph = make.make_graph(self._nodes, "policy", [seen], [done], tensors)
        model = make.make_model(
            graph,
            opset_imports=[make.make_opsetid("", _OPSET)],
            ir_version=_IR_VERSION,
            producer_name="shapechanger",
            producer_version=card.version,
        )
        facts = {f"{name}_names": json.dumps(layout.names) for name, _, layout in sides}
        make.set_model_props(model, {**facts, _CARD: msgspec.json.encode(card).decode()})
        self._onnx.checker.check_model(model)
        write_atomic(path, model.SerializeToString())


def export_onnx(policy: TrainedPolicy, path: Path) -> None:
    """Write a policy as ONNX.

    Its input `observation` is float64 of shape (n, observations), as the env returns it, and its
    output `action` float32 of shape (n, actions), as the env takes it.

    Args:
        policy: The policy.
        path: The file, such as `ant.onnx`.

    Raises:
        MissingExtra: If onnx is not installed.
        StudyError: If its network is not the `MlpPolicy` of PPO, SAC or TQC.
        OutputError: If it cannot be written.
    """
    graph = OnnxGraph()
    from shapechanger.transfer.transplant.layers import CLIP, EPSILON

    last = "observation"
    if policy.normalisation is not None:
        statistics = policy.normalisation.observation
        deviation = np.sqrt(np.asarray(statistics.var, np.float64) + EPSILON)
        last = graph.apply("Sub", last, np.asarray(statistics.mean, np.float64))
        last = graph.apply("Div", last, deviation)
        last = graph.apply("Clip", last, np.array(-CLIP), np.array(CLIP))
    last = graph.as_float(last)
    network = _mean_network(policy)
    for place, layer in enumerate(network.layers):
        weight, bias = (each.detach().cpu().numpy() for each in (layer.weight, layer.bias))
        last = graph.apply("Gemm", last, weight, bias, transB=1)
        if place < len(network.layers) - 1:
            last = graph.apply(network.activation, last)
    space: Any = cast("Any", policy.model).action_space
    low, high = space.low.astype(np.float32), space.high.astype(np.float32)
    if network.squashes:
        last = graph.apply("Tanh", last)
        last = graph.apply("Mul", last, 0.5 * (high - low))
        last = graph.apply("Add", last, 0.5 * (high + low))
    last = graph.apply("Min", graph.apply("Max", last, low), high)
    scale = ActionScale.between(space, policy.card.action)
    middle, half, low, high = (each.astype(np.float32) for each in scale)
    last = graph.apply("Add", graph.apply("Mul", last, half), middle)
    graph.apply("Min", graph.apply("Max", last, low), high, to="action")
    graph.write(path, msgspec.convert(policy.card, OnnxCard, from_attributes=True))


class _MeanNetwork(NamedTuple):
    """The network from normalised observations to mean actions.

    Attributes:
        layers: Its linear layers.
        activation: What follows each but the last, as ONNX calls it.
        squashes: Whether tanh and the bounds follow the last.
    """

    layers: list[Any]
    activation: str
    squashes: bool


def _mean_network(policy: TrainedPolicy) -> _MeanNetwork:
    from torch import nn

    from shapechanger.transfer.transplant.model import check_supported

    try:
        check_supported(policy.model)
    except TransplantError as error:
        raise StudyError(f"This policy cannot be exported: {error}") from error
    model: Any = policy.model
    squashes = not hasattr(model.policy, "mlp_extractor")
    if squashes:
        hidden, last = model.policy.actor.latent_pi, model.policy.actor.mu
    else:
        hidden, last = model.policy.mlp_extractor.policy_net, model.policy.action_net
    kinds: set[type] = {type(layer) for layer in hidden if not isinstance(layer, nn.Linear)}
    known: dict[type, str] = {nn.Tanh: "Tanh", nn.ReLU: "Relu"}
    activation = known.get(kinds.pop()) if kinds else "Tanh"
    if kinds or activation is None:
        raise StudyError("This policy cannot be exported: it has other layers than Tanh or ReLU.")
    layers = [layer for layer in hidden if isinstance(layer, nn.Linear)]
    return _MeanNetwork([*layers, last], activation, squashes)


class OnnxPolicy:
    """A policy from an ONNX file that `export_onnx` wrote.

    Attributes:
        card: Its provenance.

    Args:
        path: The file.

    Raises:
        MissingExtra: If onnxruntime is not installed.
        CorruptStudy: If the file is missing or is not such a policy.
    """

    def __init__(self, path: Path) -> None:
        try:
            import onnxruntime  # pyright: ignore[reportMissingTypeStubs]
        except ImportError as error:
            raise MissingExtra("onnxruntime", "onnx") from error
        runtime: Any = onnxruntime
        options = runtime.SessionOptions()
        # One policy is small: more threads would only wait for one another.
        options.intra_op_num_threads = 1
        try:
            self._session = runtime.InferenceSession(
                path.read_bytes(), options, providers=["CPUExecutionProvider"]
            )
            facts = self._session.get_modelmeta().custom_metadata_map
            self.card = msgspec.json.decode(facts[_CARD], type=OnnxCard)
        except FileNotFoundError as error:
            raise CorruptStudy(no_policy_file(path)) from error
        except Exception as error:  # The runtime's errors have no common base.
            reason = (str(error).strip().splitlines() or [type(error).__name__])[0].rstrip(".")
            raise CorruptStudy(
                f"{path} is not a policy that `shapechanger policies export` has written "
                f"({reason})."
            ) from error
        sizes = [
            each.shape[1] for each in (*self._session.get_inputs(), *self._session.get_outputs())
        ]
        if sizes != [self.card.observation.size, self.card.action.size]:
            raise CorruptStudy(
                f"{path} has {sizes} numbers, and its layouts "
                f"{[self.card.observation.size, self.card.action.size]}."
            )

    def act(self, observations: NDArray[Any]) -> NDArray[np.float32]:
        """Return the mean actions, shape (n, actions), for observations of shape (n, observations).

        Raises:
            StudyError: If the observations have another size.
        """
        if observations.ndim != 2 or observations.shape[1] != self.card.observation.size:
            raise StudyError(
                f"This policy takes observations of shape (n, {self.card.observation.size}), got "
                f"{observations.shape}."
            )
        inputs = {"observation": np.asarray(observations, np.float64)}
        return cast("NDArray[np.float32]", self._session.run(["action"], inputs)[0])
