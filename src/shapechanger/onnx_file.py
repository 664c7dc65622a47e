"""Policies as ONNX files, for programs that have neither PyTorch nor Shapechanger."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, Final, cast

import msgspec

from shapechanger.errors import MissingExtra, translate_errors
from shapechanger.files import make_folder, write_atomic
from shapechanger.policy import ONNX_CARD, PolicyCard

_OPSET: Final = 18


def export_network(
    network: Any, inputs: Mapping[str, Any], card: PolicyCard, path: Path, **facts: str
) -> None:
    """Write a network of PyTorch as ONNX, with the card of its policy, without its settings.

    Its `forward` takes the inputs in their order, each given by an example of shape (2, ...), whose
    first axis stands for any number. The card's last shape names the output; facts are metadata.

    Raises:
        MissingExtra: If onnx or onnxscript is not installed.
        OutputError: If the file cannot be written.
    """
    with translate_errors(ImportError, to=lambda _: MissingExtra("onnxscript", "onnx")):
        operators: Any = import_module("onnxscript").opset18
    import torch

    def hypot(x: Any, y: Any) -> Any:
        """Translate the length of an edge, which ONNX lacks."""
        return operators.Sqrt(operators.Add(operators.Mul(x, x), operators.Mul(y, y)))

    many = torch.export.Dim("n", min=1)
    # The exporter warns of packages that these networks do not need.
    log = logging.getLogger("torch.onnx")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            program: Any = cast("Any", torch.onnx).export(
                network.eval(),
                tuple(inputs.values()),
                input_names=[*inputs],
                output_names=[[*card.shapes][-1]],
                dynamic_shapes=(tuple({0: many} for _ in inputs),),
                opset_version=_OPSET,
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
