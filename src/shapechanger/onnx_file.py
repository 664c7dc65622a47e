"""Networks of policies as ONNX files, for programs that have neither PyTorch nor Shapechanger."""

from __future__ import annotations

import hashlib
import logging
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MissingExtra
from shapechanger.files import make_folder, write_atomic
from shapechanger.policy import read_limited

_OPSET: Final = 18
_CARD: Final = "shapechanger"


def export_network(
    network: Any, inputs: Mapping[str, Any], output: str, path: Path, facts: Mapping[str, str]
) -> None:
    """Write a network of PyTorch as ONNX.

    Args:
        network: A module that takes the inputs in their order.
        inputs: An example of each input by name, a tensor of shape (2, ...); the first axis stands
            for any number.
        output: Name of the output.
        path: The file.
        facts: Its metadata.

    Raises:
        MissingExtra: If onnx or onnxscript is not installed.
        OutputError: If the file cannot be written.
    """
    try:
        from onnxscript import opset18
    except ImportError as error:
        raise MissingExtra("onnxscript", "onnx") from error
    import torch

    operators: Any = opset18

    def hypot(x: Any, y: Any) -> Any:
        """Translate the length of an edge, which ONNX lacks."""
        return operators.Sqrt(operators.Add(operators.Mul(x, x), operators.Mul(y, y)))

    class Positional(torch.nn.Module):
        """The network with any number of inputs, which are then named alike."""

        def __init__(self) -> None:
            super().__init__()
            self.network = network

        def forward(self, *given: torch.Tensor) -> torch.Tensor:
            return self.network(*given)

    many = torch.export.Dim("n", min=1)
    # The exporter warns of packages that these networks do not need.
    log = logging.getLogger("torch.onnx")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            program: Any = cast("Any", torch.onnx).export(
                Positional().eval(),
                tuple(inputs.values()),
                input_names=[*inputs],
                output_names=[output],
                dynamic_shapes=(tuple({0: many} for _ in inputs),),
                opset_version=_OPSET,
                custom_translation_table={torch.ops.aten.hypot.default: hypot},
                dynamo=True,
                verbose=False,
            )
    finally:
        log.setLevel(level)
    model = program.model_proto
    for name, value in facts.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = name, value
    make_folder(path.parent)
    write_atomic(path, model.SerializeToString())


class OnnxNetwork:
    """The network of an ONNX file, which runs on the CPU without PyTorch.

    Attributes:
        card: The JSON of its card.
        digest: First digits of the SHA-256 of the file.
        shapes: Shapes of inputs and output by name, without their first axis.

    Args:
        path: The file, read once: a later change of it changes nothing here.
        card: Name of the metadata that holds the card.

    Raises:
        FileNotFoundError: If there is none.
        MissingExtra: If onnxruntime is not installed.
        ValueError: If the file has no card, is too large or is no ONNX; others of onnxruntime.
    """

    def __init__(self, path: Path, card: str = _CARD) -> None:
        try:
            import onnxruntime  # pyright: ignore[reportMissingTypeStubs]
        except ImportError as error:
            raise MissingExtra("onnxruntime", "onboard") from error
        runtime: Any = onnxruntime
        options = runtime.SessionOptions()
        # One policy is small: more threads would only wait for one another.
        options.intra_op_num_threads = 1
        options.log_severity_level = 4  # What is wrong is raised, too.
        content = read_limited(path)
        self._session = runtime.InferenceSession(
            content, options, providers=["CPUExecutionProvider"]
        )
        facts = self._session.get_modelmeta().custom_metadata_map
        if card not in facts:
            raise ValueError("it has no card of Shapechanger")
        self.card: str = facts[card]
        self.digest = hashlib.sha256(content).hexdigest()[:12]
        sides = (*self._session.get_inputs(), *self._session.get_outputs())
        self.shapes: dict[str, list[int]] = {side.name: list(side.shape[1:]) for side in sides}

    def run(self, inputs: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Return the output for inputs by name, each of shape (n, ...)."""
        return self._session.run(None, dict(inputs))[0]
