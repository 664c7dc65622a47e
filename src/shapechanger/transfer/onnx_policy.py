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

from shapechanger.errors import CorruptStudy, MissingExtra, StudyError, TransplantError
from shapechanger.layout import Layout
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.files import write_atomic

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
    """

    env: EnvRef
    observation: Layout
    action: Layout
    learner: str
    steps: int
    seed: int
    version: str


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
    try:
        import onnx
        from onnx import helper, numpy_helper
    except ImportError as error:
        raise MissingExtra("onnx", "onnx") from error

    from shapechanger.transfer.transplant.layers import CLIP, EPSILON

    make: Any = helper
    numbers: Any = numpy_helper
    nodes: list[Any] = []
    constants: dict[str, NDArray[Any]] = {}

    def apply(operator: str, inputs: list[str], output: str, **attributes: Any) -> str:
        nodes.append(make.make_node(operator, inputs, [output], **attributes))
        return output

    last = "observation"
    if policy.normalisation is not None:
        statistics = policy.normalisation.observation
        constants["mean"] = np.asarray(statistics.mean, np.float64)
        constants["deviation"] = np.sqrt(np.asarray(statistics.var, np.float64) + EPSILON)
        constants["least"], constants["most"] = np.float64(-CLIP), np.float64(CLIP)  # pyright: ignore[reportArgumentType]
        last = apply("Sub", [last, "mean"], "centred")
        last = apply("Div", [last, "deviation"], "scaled")
        last = apply("Clip", [last, "least", "most"], "normalised")
    last = apply("Cast", [last], "features", to=onnx.TensorProto.FLOAT)
    network = _mean_network(policy)
    for place, layer in enumerate(network.layers):
        constants[f"weight_{place}"] = layer.weight.detach().cpu().numpy()
        constants[f"bias_{place}"] = layer.bias.detach().cpu().numpy()
        inputs = [last, f"weight_{place}", f"bias_{place}"]
        last = apply("Gemm", inputs, f"sum_{place}", transB=1)
        if place < len(network.layers) - 1:
            last = apply(network.activation, [last], f"layer_{place}")
    space: Any = cast("Any", policy.model).action_space
    low, high = space.low.astype(np.float32), space.high.astype(np.float32)
    if network.squashes:
        constants["half"], constants["middle"] = 0.5 * (high - low), 0.5 * (high + low)
        last = apply("Tanh", [last], "squashed")
        last = apply("Mul", [last, "half"], "stretched")
        last = apply("Add", [last, "middle"], "moved")
    constants["low"], constants["high"] = low, high
    last = apply("Max", [last, "low"], "bounded")
    apply("Min", [last, "high"], "action")
    sides = (
        ("observation", onnx.TensorProto.DOUBLE, policy.card.observation),
        ("action", onnx.TensorProto.FLOAT, policy.card.action),
    )
    seen, done = (
        make.make_tensor_value_info(name, kind, ["n", layout.size]) for name, kind, layout in sides
    )
    tensors = [numbers.from_array(np.asarray(value), name) for name, value in constants.items()]
    graph = make.make_graph(nodes, "policy", [seen], [done], tensors)
    model = make.make_model(
        graph,
        opset_imports=[make.make_opsetid("", _OPSET)],
        ir_version=_IR_VERSION,
        producer_name="shapechanger",
        producer_version=policy.card.version,
    )
    facts = {f"{name}_names": json.dumps(layout.names) for name, _, layout in sides}
    card = msgspec.convert(policy.card, OnnxCard, from_attributes=True)
    make.set_model_props(model, {**facts, _CARD: msgspec.json.encode(card).decode()})
    cast("Any", onnx).checker.check_model(model)
    write_atomic(path, model.SerializeToString())


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
            raise CorruptStudy(f"There is no policy file {path}.") from error
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
