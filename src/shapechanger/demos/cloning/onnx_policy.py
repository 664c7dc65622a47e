"""Cloned policies as ONNX files, which a robot runs without PyTorch.

The file holds the network from a prepared picture, a state or both to its outputs. Its metadata has
the card of the policy and what else a robot compares before it arms. Reading one runs no code.
"""

from __future__ import annotations

import hashlib
import logging
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.pictures import PolicyError, prepare
from shapechanger.demos.episodes.files import cannot_write, write_atomic
from shapechanger.errors import MissingExtra

if TYPE_CHECKING:
    from shapechanger.demos.cloning.policy import CameraPolicy

_CARD: Final = "shapechanger-clone"
_OPSET: Final = 18
_PICTURE: Final = "picture"
_STATE: Final = "state"
_OUTPUT: Final = "output"
_MOST_BYTES: Final = 2**28


class OnboardCard(msgspec.Struct, frozen=True, kw_only=True):
    """Card of an exported policy.

    Attributes:
        clone: Card of the policy.
        body: Kind of robot that it learned in, such as "car"; "" for any.
        control_hz: Actions per second that it learned with; None if unknown.
    """

    clone: CloneCard
    body: str = ""
    control_hz: float | None = None


def export_clone(
    policy: CameraPolicy, path: Path, *, body: str = "", control_hz: float | None = None
) -> None:
    """Write a cloned policy as ONNX.

    Its inputs are `picture`, uint8 of the shape (n, height, width, 3) that the card's framing
    gives, and `state`, float32 of shape (n, values); its output is `output`, float32: actions in
    [-1, 1], or probabilities of the card's classes.

    Args:
        policy: The policy.
        path: The file, such as `car.onnx`.
        body: Kind of robot that it learned in; "" for any.
        control_hz: Actions per second that it learned with; None if unknown.

    Raises:
        MissingExtra: If onnx or onnxscript is not installed.
        OutputError: If the file cannot be written.
    """
    try:
        from onnxscript import opset18
    except ImportError as error:
        raise MissingExtra("onnxscript", "onnx") from error
    operators: Any = opset18
    import torch

    from shapechanger.demos.cloning.batches import scaled

    card = policy.card
    inputs: dict[str, Any] = {}
    if card.eyes != "none":
        inputs[_PICTURE] = torch.zeros((2, *card.framing.shape), dtype=torch.uint8)
    if card.state_size:
        inputs[_STATE] = torch.zeros((2, card.state_size))

    class Whole(torch.nn.Module):
        """The network with the scaling of pictures and outputs."""

        def __init__(self) -> None:
            super().__init__()
            self.network = policy.network

        def forward(self, *given: torch.Tensor) -> torch.Tensor:
            named = dict(zip(inputs, given, strict=True))
            picture = named.get(_PICTURE)
            seen = None if picture is None else scaled(picture)
            out = self.network.hands(self.network.perceive(seen, named.get(_STATE)))
            return torch.softmax(out, dim=1) if card.classes else torch.tanh(out)

    def hypot(x: Any, y: Any) -> Any:
        """Translate the length of an edge, which ONNX lacks."""
        return operators.Sqrt(operators.Add(operators.Mul(x, x), operators.Mul(y, y)))

    many = torch.export.Dim("n", min=1)
    # The exporter warns of packages that this network does not need.
    log = logging.getLogger("torch.onnx")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            program: Any = cast("Any", torch.onnx).export(
                Whole().eval(),
                tuple(inputs.values()),
                input_names=[*inputs],
                output_names=[_OUTPUT],
                dynamic_shapes=(tuple({0: many} for _ in inputs),),
                opset_version=_OPSET,
                custom_translation_table={torch.ops.aten.hypot.default: hypot},
                dynamo=True,
                verbose=False,
            )
    finally:
        log.setLevel(level)
    model = program.model_proto
    entry = model.metadata_props.add()
    entry.key = _CARD
    whole = OnboardCard(clone=card, body=body, control_hz=control_hz)
    entry.value = msgspec.json.encode(whole).decode()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(path, error) from error
    write_atomic(path, model.SerializeToString())


class OnnxClone:
    """A cloned policy from a file of `export_clone`.

    Attributes:
        card: Card of the policy.
        body: Kind of robot that it learned in; "" for any.
        control_hz: Actions per second that it learned with; None if unknown.
        digest: First digits of the SHA-256 of the file.

    Args:
        path: The file, read once: a later change of it changes nothing here.

    Raises:
        MissingExtra: If onnxruntime is not installed.
        PolicyError: If the file is missing or is not such a policy.
    """

    def __init__(self, path: Path) -> None:
        try:
            import onnxruntime  # pyright: ignore[reportMissingTypeStubs]
        except ImportError as error:
            raise MissingExtra("onnxruntime", "onboard") from error
        runtime: Any = onnxruntime
        options = runtime.SessionOptions()
        # One picture at a time: more threads would only wait for one another.
        options.intra_op_num_threads = 1
        options.log_severity_level = 4  # What is wrong is raised, too.
        try:
            if path.stat().st_size > _MOST_BYTES:
                raise ValueError(f"it is larger than {_MOST_BYTES >> 20} MB")
            content = path.read_bytes()
            self._session = runtime.InferenceSession(
                content, options, providers=["CPUExecutionProvider"]
            )
            facts = self._session.get_modelmeta().custom_metadata_map
            if _CARD not in facts:
                raise ValueError("it has no card of Shapechanger")
            whole = msgspec.json.decode(facts[_CARD], type=OnboardCard)
            self._require_shapes(whole.clone)
        except FileNotFoundError as error:
            raise PolicyError(f"There is no policy file {path}.") from error
        except Exception as error:  # The runtime's errors have no common base.
            reason = (str(error).strip().splitlines() or [type(error).__name__])[0].rstrip(".")
            raise PolicyError(
                f"{path} is not a cloned policy that `shapechanger policies export` has written: "
                f"{reason}."
            ) from error
        self.card, self.body, self.control_hz = whole.clone, whole.body, whole.control_hz
        self.digest = hashlib.sha256(content).hexdigest()[:12]

    def predict(
        self, picture: NDArray[np.uint8] | None, state: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return the action for one picture and state, as `CameraPolicy.predict` does.

        Args:
            picture: Red, green and blue, shape (H, W, 3); None for a policy without pictures.
            state: Shape (k,), NaN for unknown values; None for a policy without a state.

        Returns:
            Action, shape (m,).

        Raises:
            CloningError: If an input is missing or has another shape.
        """
        given: dict[str, NDArray[Any]] = {}
        if self.card.eyes != "none":
            self.card.require_picture(picture)
            given[_PICTURE] = prepare(np.asarray(picture)[np.newaxis], self.card.framing)
        known = self.card.known_states(None if state is None else state[np.newaxis])
        if known is not None:
            given[_STATE] = known
        return self.card.actions(self._session.run([_OUTPUT], given)[0])[0]

    def _require_shapes(self, card: CloneCard) -> None:
        """Require that inputs and output have the shapes that the card gives."""
        wanted: dict[str, list[int]] = {}
        if card.eyes != "none":
            wanted[_PICTURE] = list(card.framing.shape)
        if card.state_size:
            wanted[_STATE] = [card.state_size]
        wanted[_OUTPUT] = [card.outputs]
        sides = (*self._session.get_inputs(), *self._session.get_outputs())
        found = {side.name: list(side.shape[1:]) for side in sides}
        if found != wanted:
            raise ValueError(f"its network takes and gives {found}, and its card says {wanted}")
