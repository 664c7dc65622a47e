"""Networks of policies as ONNX files, for programs that have neither PyTorch nor Shapechanger."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MissingExtra, ShapechangerError
from shapechanger.files import make_folder, write_atomic
from shapechanger.policy import read_limited, refusing

_OPSET: Final = 18
CARD: Final = "shapechanger"
"""Name of the metadata that holds the card of a trained policy."""

Card = TypeVar("Card")


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
        """The network with any number of inputs, which then share one name."""

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


def read_network(
    path: Path,
    card_type: type[Card],
    shapes_of: Callable[[Card], dict[str, list[int]]],
    error: type[ShapechangerError],
    key: str = CARD,
) -> tuple[Card, Callable[[Mapping[str, NDArray[Any]]], NDArray[np.float32]]]:
    """Read a network from an ONNX file, which runs on the CPU without PyTorch.

    Args:
        path: The file, read once: a later change of it changes nothing here.
        card_type: Type of the card.
        shapes_of: Returns the shapes that the network must have according to its card: of inputs
            and output by name, without their first axis.
        error: Exception for a file that cannot be used.
        key: Name of the metadata that holds the card.

    Returns:
        The card, and a function from inputs by name, each of shape (n, ...), to the output.

    Raises:
        MissingExtra: If onnxruntime is not installed.
    """
    with refusing(path, error):
        content = read_limited(path)
        try:
            import onnxruntime  # pyright: ignore[reportMissingTypeStubs]
        except ImportError as missing:
            raise MissingExtra("onnxruntime", "onboard") from missing
        runtime: Any = onnxruntime
        options = runtime.SessionOptions()
        # One policy is small: more threads would only wait for one another.
        options.intra_op_num_threads = 1
        options.log_severity_level = 4  # What is wrong is raised, too.
        session = runtime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        facts = session.get_modelmeta().custom_metadata_map
        if key not in facts:
            raise ValueError("it has no card of Shapechanger")
        card = msgspec.json.decode(facts[key], type=card_type)
        sides = (*session.get_inputs(), *session.get_outputs())
        found = {side.name: list(side.shape[1:]) for side in sides}
        if found != (stated := shapes_of(card)):
            raise ValueError(f"its network takes and gives {found}, and its card says {stated}")
        return card, lambda inputs: session.run(None, dict(inputs))[0]
