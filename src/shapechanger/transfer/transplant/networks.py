"""The parameters of a network with other inputs and outputs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from shapechanger.errors import TransplantError
from shapechanger.transfer.transplant.actions import Output
from shapechanger.transfer.transplant.normalisation import Affine

__all__ = ["Edges", "first_linear", "moved_parameters"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Edges:
    """Which parts of a network meet the body.

    Attributes:
        inputs: For the name of a linear layer what its inputs become.
        outputs: For the name of a linear layer, or of a vector of parameters, what its outputs
            become. A layer may be both: a network without hidden layers is one.
    """

    inputs: dict[str, Affine] = field(default_factory=dict[str, Affine])
    outputs: dict[str, Output] = field(default_factory=dict[str, Output])


def first_linear(network: nn.Module, name: str, otherwise: Iterable[str] = ()) -> list[str]:
    """The name of the first linear layer of a network, or other names if it has none."""
    for child, module in network.named_children():
        if isinstance(module, nn.Linear):
            return [f"{name}.{child}"]
    return list(otherwise)


def moved_parameters(source: nn.Module, target: nn.Module, edges: Edges) -> dict[str, torch.Tensor]:
    """The parameters of `target` that make it compute what `source` computes.

    Everything is computed in float64 and stored as the source stores it.

    Args:
        source: The network that was trained.
        target: A new network of the same make, in the shapes of the target; what is to be learned
            keeps its parameters.
        edges: What changes at the inputs and outputs. All else is copied.

    Raises:
        TransplantError: If there are parameters at the edges that nobody says how to move.
    """
    trained, new = source.state_dict(), target.state_dict()
    moved = {name: tensor.detach().clone() for name, tensor in trained.items()}

    def replace(name: str, values: Array) -> None:
        moved[name] = torch.as_tensor(values).to(trained[name])

    for layer in dict.fromkeys((*edges.inputs, *edges.outputs)):
        if layer in trained:  # A vector of parameters and no layer.
            replace(layer, _biases(_array(trained, layer), edges.outputs[layer], new, layer))
            continue
        at_weight, at_bias = f"{layer}.weight", f"{layer}.bias"
        weight, bias = _array(trained, at_weight), _array(trained, at_bias)
        if layer in edges.inputs:  # W (A x + e) + b, as a layer of x.
            matrix, offset = edges.inputs[layer]
            weight, bias = weight @ matrix, bias + weight @ offset
        if layer in edges.outputs:
            output = edges.outputs[layer]
            fresh = output.fresh[:, np.newaxis]
            weight = np.where(fresh, _array(new, at_weight), output.matrix @ weight)
            bias = _biases(bias, output, new, at_bias)
        replace(at_weight, weight)
        replace(at_bias, bias)
    _check_shapes(moved, new)
    return moved


def _biases(trained: Array, output: Output, new: Mapping[str, torch.Tensor], name: str) -> Array:
    """N b + d, or those of a new network."""
    return np.where(output.fresh, _array(new, name), output.matrix @ trained + output.offset)


def _array(parameters: Mapping[str, torch.Tensor], name: str) -> Array:
    return parameters[name].detach().cpu().double().numpy()


def _check_shapes(moved: Mapping[str, torch.Tensor], new: Mapping[str, torch.Tensor]) -> None:
    differing = [
        name
        for name in dict.fromkeys((*moved, *new))
        if name not in moved or name not in new or moved[name].shape != new[name].shape
    ]
    if differing:
        raise TransplantError(
            f"The parameters {', '.join(differing)} of this policy cannot be moved: "
            "only the first and the last layer of an MlpPolicy may depend on the body."
        )
