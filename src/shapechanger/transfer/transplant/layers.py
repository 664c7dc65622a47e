"""Observation statistics of the target, and the first layer's view of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3.common.running_mean_std import RunningMeanStd
from torch import nn

from shapechanger.errors import TransplantError
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Copy, Learn

__all__ = [
    "Affine",
    "Edges",
    "OutputMap",
    "PolicyOutputs",
    "Scaling",
    "critic_actions",
    "first_linear",
    "gaussian_outputs",
    "move_parameters",
    "observation_affine",
    "squashed_outputs",
    "transplant_normalisation",
]

Vector = NDArray[np.float64]


class Affine(NamedTuple):
    """The source's numbers from the target's: x_source = matrix x_target + offset.

    Attributes:
        matrix: Shape (n_source, n_target).
        offset: Shape (n_source,).
    """

    matrix: Vector
    offset: Vector


@dataclass(frozen=True, slots=True)
class Scaling:
    """How observations are normalised, as by SB3's `VecNormalize`: z = clip((o - mean) / sigma).

    Attributes:
        mean: Shape (n,).
        sigma: Shape (n,), above zero: the square root of variance plus epsilon.
        clip: Largest magnitude of z.
    """

    mean: Vector
    sigma: Vector
    clip: float = math.inf

    @classmethod
    def none(cls, size: int) -> Scaling:
        """Observations as they are."""
        return cls(np.zeros(size), np.ones(size))

    @classmethod
    def of(cls, statistics: RunningMeanStd, epsilon: float, clip: float) -> Scaling:
        """By statistics that were gathered in training."""
        return cls(np.asarray(statistics.mean, np.float64), np.sqrt(statistics.var + epsilon), clip)


def observation_affine(body_map: BodyMap, source: Scaling, target: Scaling) -> Affine:
    """The source network's inputs from the target network's.

    With o_s = M o_t + c, o_t = mean_t + sigma_t z_t and z_s = (o_s - mean_s) / sigma_s:

        z_s = diag(1 / sigma_s) M diag(sigma_t) z_t + (M mean_t + c - mean_s) / sigma_s

    The clipping of z_t stands for that of z_s, which is the same where a number keeps its
    statistics. A number that is constant is clipped here.
    """
    matrix = body_map.observation_matrix * target.sigma / source.sigma[:, np.newaxis]
    seen = body_map.observation_matrix @ target.mean + body_map.observation_offset
    offset = (seen - source.mean) / source.sigma
    constant = ~body_map.observation_matrix.any(axis=1)
    offset[constant] = np.clip(offset[constant], -source.clip, source.clip)
    return Affine(matrix, offset)


def transplant_normalisation(source: RunningMeanStd, body_map: BodyMap) -> RunningMeanStd:
    """The target's observation statistics, from those of the source.

    A target number that the source takes carries its mean and variance over, through the scale; if
    several take it, the one of the same name, or else the first, does. A number that is new is
    taken to be uniform in its range, or to have the mean nearest to 0 and the variance 1 where it
    has no range. The count is kept: the source's experience weighs as much as it did.

    Args:
        source: Mean and variance of the source's observations, shape (source_observation.size,).
        body_map: How the bodies correspond.

    Returns:
        Mean and variance of the target's observations, shape (target_observation.size,).
    """
    layout = body_map.target_observation
    carried = RunningMeanStd(shape=(layout.size,))
    carried.count = source.count
    takers: dict[str, tuple[str, float]] = {}
    for entry in body_map.observation:
        if isinstance(entry.rule, Copy):
            taken = entry.rule.feature
            if taken not in takers or entry.feature == taken:
                takers[taken] = (entry.feature, entry.rule.scale)
    ours = body_map.source_observation.slices
    for feature, place in zip(layout, layout.slices.values(), strict=True):
        if feature.name in takers:
            name, scale = takers[feature.name]
            carried.mean[place] = source.mean[ours[name]] / scale
            carried.var[place] = source.var[ours[name]] / scale**2
        else:
            carried.mean[place], carried.var[place] = feature.middle, _guessed_variance(feature)
    return carried


def _guessed_variance(feature: Feature) -> float:
    """The variance of a uniform distribution over the range, or 1 where there is none."""
    width = feature.high - feature.low
    return width**2 / 12.0 if 0.0 < width < math.inf else 1.0


# tanh reaches 1 only at infinity; a constant at a bound is a millionth within it.
_CLOSEST_TO_BOUND: Final = 1.0 - 1e-6
# Bounds of a Box are in single precision.
_SAME: Final = 1e-6

Array = NDArray[np.float64]


class OutputMap(NamedTuple):
    """One layer of outputs, from the source's: y_target = matrix y_source + offset.

    Attributes:
        matrix: Shape (n_target, n_source).
        offset: Shape (n_target,).
        fresh: Which outputs are to be learned, and keep the weights of a new policy instead,
            shape (n_target,).
    """

    matrix: Array
    offset: Array
    fresh: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class PolicyOutputs:
    """The two layers, or the layer and the parameters, that a Gaussian policy ends in.

    Attributes:
        mean: The mean of each action, before any squashing.
        log_std: The logarithm of its standard deviation. Where the mean is constant it is the mean
            of those of the source.
    """

    mean: OutputMap
    log_std: OutputMap


def gaussian_outputs(body_map: BodyMap) -> PolicyOutputs:
    """For a policy whose actions are in the env's units, as PPO's: a_t = N a_s + d."""
    matrix = body_map.action_matrix
    scale = np.abs(matrix).sum(axis=1)
    log_scale = np.log(np.where(scale > 0.0, scale, 1.0))
    fresh = _fresh(body_map)
    return PolicyOutputs(
        mean=OutputMap(matrix, body_map.action_offset, fresh),
        log_std=OutputMap(_spread(matrix), log_scale, fresh),
    )


def squashed_outputs(body_map: BodyMap, source: Box[Any], target: Box[Any]) -> PolicyOutputs:
    """For a policy whose actions go through tanh to the bounds of the space, as SAC's.

    With u = tanh(mean) in [-1, 1] the action is middle + half u. Since tanh is odd, a sign can move
    inside of it, and no other scale can.

    Args:
        body_map: How the bodies correspond.
        source: The source's action space, bounded.
        target: The target's action space, bounded.

    Raises:
        TransplantError: If an action is taken at another scale than its range has.
    """
    matrix = body_map.action_matrix
    signs, squashed = np.zeros_like(matrix), np.zeros(len(matrix))
    source_middle, source_half = _middle_and_half(source)
    target_middle, target_half = _middle_and_half(target)
    for place, (name, _) in enumerate(_names(body_map.target_action)):
        if not matrix[place].any():
            constant = body_map.action_offset[place] - target_middle[place]
            squashed[place] = constant / target_half[place]
            continue
        origin = int(np.flatnonzero(matrix[place])[0])
        scale = matrix[place, origin]
        ratio = scale * source_half[origin] / target_half[place]
        shift = (scale * source_middle[origin] - target_middle[place]) / target_half[place]
        if abs(abs(ratio) - 1.0) > _SAME or abs(shift) > _SAME:
            raise TransplantError(
                f"SAC squashes its actions with tanh, which cannot be scaled or shifted: for "
                f"{name!r} the source's range would become {ratio:+.3g} times that of the target, "
                f"shifted by {shift:+.3g}, and must become +1 or -1 times, shifted by 0. "
                "Map it with units='same', hold it, learn it, or use PPO."
            )
        signs[place, origin] = np.sign(ratio)
    fresh = _fresh(body_map)
    bias = np.arctanh(np.clip(squashed, -_CLOSEST_TO_BOUND, _CLOSEST_TO_BOUND))
    return PolicyOutputs(
        mean=OutputMap(signs, bias, fresh),
        log_std=OutputMap(_spread(signs), np.zeros(len(signs)), fresh),
    )


def critic_actions(body_map: BodyMap, outputs: PolicyOutputs, source: Box[Any]) -> Affine:
    """The squashed source actions from the squashed target actions, for SAC's critics.

    This is the way back through the outputs. Where several target actions copy one source action,
    the one of the same name stands for it, and if there is none, their mean does: both are exact
    on what the policy does. A target action that came from nowhere counts for nothing until it is
    trained, and a source action that went nowhere is judged as the action 0.

    Args:
        body_map: How the bodies correspond.
        outputs: The squashed outputs of the same map.
        source: The source's action space, bounded.
    """
    signs = outputs.mean.matrix
    source_names, target_names = _names(body_map.source_action), _names(body_map.target_action)
    matrix = np.zeros(signs.T.shape)
    for origin, name in enumerate(source_names):
        takers = [int(place) for place in np.flatnonzero(signs[:, origin])]
        chosen = [place for place in takers if target_names[place] == name] or takers
        matrix[origin, chosen] = signs[chosen, origin] / max(1, len(chosen))
    middle, half = _middle_and_half(source)
    still = np.clip(-middle / half, -1.0, 1.0)
    return Affine(matrix, np.where(matrix.any(axis=1), 0.0, still))


def _names(layout: Layout) -> list[tuple[str, int]]:
    """For each number the name of its feature and the place in it."""
    return [(feature.name, place) for feature in layout for place in range(feature.size)]


def _fresh(body_map: BodyMap) -> NDArray[np.bool_]:
    fresh = np.zeros(body_map.target_action.size, dtype=np.bool_)
    places = body_map.target_action.slices
    for entry in body_map.action:
        fresh[places[entry.feature]] = isinstance(entry.rule, Learn)
    return fresh


def _spread(matrix: Array) -> Array:
    """Which log standard deviation each action gets: that of its origin, or the mean of all."""
    taken = matrix != 0.0
    mean = np.full_like(matrix, 1.0 / matrix.shape[1])
    return np.where(taken.any(axis=1, keepdims=True), taken.astype(np.float64), mean)


def _middle_and_half(space: Box[Any]) -> tuple[Array, Array]:
    """Middle and half width of a bounded space, each of shape (n,)."""
    low, high = space.low.astype(np.float64), space.high.astype(np.float64)
    return 0.5 * (low + high), 0.5 * (high - low)


@dataclass(frozen=True, slots=True)
class Edges:
    """Which parts of a network meet the body.

    Attributes:
        inputs: For the name of a linear layer what its inputs become.
        outputs: For the name of a linear layer, or of a vector of parameters, what its outputs
            become. A layer may be both: a network without hidden layers is one.
    """

    inputs: dict[str, Affine] = field(default_factory=dict[str, Affine])
    outputs: dict[str, OutputMap] = field(default_factory=dict[str, OutputMap])


def first_linear(network: nn.Module, name: str, otherwise: Iterable[str] = ()) -> list[str]:
    """The name of the first linear layer of a network, or other names if it has none."""
    for child, module in network.named_children():
        if isinstance(module, nn.Linear):
            return [f"{name}.{child}"]
    return list(otherwise)


def move_parameters(source: nn.Module, target: nn.Module, edges: Edges) -> dict[str, torch.Tensor]:
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


def _biases(trained: Array, output: OutputMap, new: Mapping[str, torch.Tensor], name: str) -> Array:
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
