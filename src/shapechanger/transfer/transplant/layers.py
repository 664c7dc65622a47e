"""The first and last layers of a transplanted network, and its observation statistics."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3.common.running_mean_std import RunningMeanStd
from torch import nn

from shapechanger.errors import TransplantError
from shapechanger.layout import Layout
from shapechanger.transfer.actions import ActionScale
from shapechanger.transfer.body_map import BodyMap, Copy, Learn

EPSILON: Final = 1e-8
"""Constant that Stable-Baselines3's `VecNormalize` adds to a variance by default."""
CLIP: Final = 10.0
"""Largest magnitude of a normalised number, the default of `VecNormalize`."""

Array = NDArray[np.float64]


class Affine(NamedTuple):
    """Affine map from the target's numbers to the source's: x_source = matrix x_target + offset.

    Attributes:
        matrix: Shape (n_source, n_target).
        offset: Shape (n_source,).
    """

    matrix: Array
    offset: Array


class Scaling(NamedTuple):
    """Normalisation of observations as in SB3's `VecNormalize`: z = clip((o - mean) / sigma).

    Attributes:
        mean: Shape (n,).
        sigma: Shape (n,), above zero: the square root of variance plus epsilon.
    """

    mean: Array
    sigma: Array
    clip: float = math.inf

    @classmethod
    def none(cls, size: int) -> Scaling:
        """Return the identity."""
        return cls(np.zeros(size), np.ones(size))

    @classmethod
    def of(cls, statistics: RunningMeanStd, epsilon: float, clip: float) -> Scaling:
        """Return the normalisation with the statistics of a training."""
        return cls(np.asarray(statistics.mean, np.float64), np.sqrt(statistics.var + epsilon), clip)


def observation_affine(body_map: BodyMap, source: Scaling, target: Scaling) -> Affine:
    """Map the target network's inputs to the source network's.

    With o_s = M o_t + c, o_t = mean_t + sigma_t z_t and z_s = (o_s - mean_s) / sigma_s:

        z_s = diag(1 / sigma_s) M diag(sigma_t) z_t + (M mean_t + c - mean_s) / sigma_s

    The clipping of z_t replaces the clipping of z_s; both have the same effect if a number keeps
    its statistics. Constant numbers are clipped here.
    """
    matrix = body_map.observation_matrix * target.sigma / source.sigma[:, np.newaxis]
    seen = body_map.observation_matrix @ target.mean + body_map.observation_offset
    offset = (seen - source.mean) / source.sigma
    constant = ~body_map.observation_matrix.any(axis=1)
    offset[constant] = np.clip(offset[constant], -source.clip, source.clip)
    return Affine(matrix, offset)


def transplant_normalisation(source: RunningMeanStd, body_map: BodyMap) -> RunningMeanStd:
    """Transplant observation statistics from the source to the target.

    If a source number copies a target number, the target number gets the source's mean divided by
    the scale, and the source's variance divided by the squared scale. Of several copies, the copy
    of the same name counts, or else the first. A new number is assumed to be uniform in its range.
    If the range is infinite, the mean is the value in it nearest to 0, and the variance is 1. The
    count is kept, so the source's experience keeps its weight.

    Args:
        source: Mean and variance of the source's observations, shape (source_observation.size,).
        body_map: Map between the bodies.

    Returns:
        Mean and variance of the target's observations, shape (target_observation.size,).
    """
    layout = body_map.target_observation
    carried = RunningMeanStd(shape=(layout.size,))
    carried.count = source.count
    copies: dict[str, tuple[str, float]] = {}
    for entry in body_map.observation:
        if isinstance(entry.rule, Copy):
            taken = entry.rule.feature
            if taken not in copies or entry.feature == taken:
                copies[taken] = (entry.feature, entry.rule.scale)
    ours = body_map.source_observation.slices
    for feature, place in zip(layout, layout.slices.values(), strict=True):
        if feature.name in copies:
            name, scale = copies[feature.name]
            carried.mean[place] = source.mean[ours[name]] / scale
            carried.var[place] = source.var[ours[name]] / scale**2
        else:
            width = feature.high - feature.low
            carried.mean[place] = feature.middle
            carried.var[place] = width**2 / 12.0 if 0.0 < width < math.inf else 1.0
    return carried


# tanh reaches 1 only at infinity; a constant at a bound is placed a millionth inside.
_CLOSEST_TO_BOUND: Final = 1.0 - 1e-6
# Tolerance of ratios and shifts, because bounds of a Box are in single precision.
_SAME: Final = 1e-6


class OutputMap(NamedTuple):
    """Map from the source's outputs to the target's: y_target = matrix y_source + offset.

    Attributes:
        matrix: Shape (n_target, n_source).
        offset: Shape (n_target,).
        fresh: Whether each output has the rule `learn` and gets the weights of a new policy, shape
            (n_target,).
    """

    matrix: Array
    offset: Array
    fresh: NDArray[np.bool_]


class PolicyOutputs(NamedTuple):
    """Maps of the two output layers of a Gaussian policy."""

    mean: OutputMap
    log_std: OutputMap


def gaussian_outputs(body_map: BodyMap, source: Box[Any], target: Box[Any]) -> PolicyOutputs:
    """Return the maps of outputs of a policy without squashed actions, such as PPO.

    The body map is in the units of the layouts, a_t = N a_s + d. The outputs y are in the units of
    the models, a = middle + half y.
    """
    ours = ActionScale.between(source, body_map.source_action)
    theirs = ActionScale.between(target, body_map.target_action)
    matrix = body_map.action_matrix * ours.half / theirs.half[:, np.newaxis]
    middle = body_map.action_matrix @ ours.middle + body_map.action_offset - theirs.middle
    scale = np.abs(matrix).sum(axis=1)
    log_scale = np.log(np.where(scale > 0.0, scale, 1.0))
    return _outputs(body_map, matrix, middle / theirs.half, log_scale)


def squashed_outputs(body_map: BodyMap, source: Box[Any], target: Box[Any]) -> PolicyOutputs:
    """Return the maps of outputs of a policy that squashes actions by tanh, such as SAC.

    With u = tanh(mean) in [-1, 1], the action is middle + half u. Since tanh is odd, a change of
    sign can be applied to the mean, but no other scale can.
    """
    matrix = body_map.action_matrix
    signs, squashed = np.zeros_like(matrix), np.zeros(len(matrix))
    ours = ActionScale.between(source, body_map.source_action)
    theirs = ActionScale.between(target, body_map.target_action)
    source_middle, source_half = ours.of_squashed(source)
    target_middle, target_half = theirs.of_squashed(target)
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
                f"{name!r} the source's range would become {ratio:+.3g} times the target's, "
                f"shifted by {shift:+.3g}, and must become +1 or -1 times, shifted by 0. "
                "Map it with units='same', hold it, learn it, or use PPO."
            )
        signs[place, origin] = np.sign(ratio)
    bias = np.arctanh(np.clip(squashed, -_CLOSEST_TO_BOUND, _CLOSEST_TO_BOUND))
    return _outputs(body_map, signs, bias, np.zeros(len(signs)))


def critic_actions(body_map: BodyMap, outputs: PolicyOutputs, source: Box[Any]) -> Affine:
    """Map squashed target actions to squashed source actions, for SAC's critics.

    This is the inverse of the map of outputs. If several target actions copy one source action, the
    copy of the same name represents it, or else the mean of the copies; either is exact for the
    policy's actions. A target action that copies no source action has the weight 0 until trained,
    and a source action without a copy is assumed to be 0.
    """
    signs = outputs.mean.matrix
    source_names, target_names = _names(body_map.source_action), _names(body_map.target_action)
    matrix = np.zeros(signs.T.shape)
    for origin, name in enumerate(source_names):
        copies = [int(place) for place in np.flatnonzero(signs[:, origin])]
        chosen = [place for place in copies if target_names[place] == name] or copies
        matrix[origin, chosen] = signs[chosen, origin] / max(1, len(chosen))
    scale = ActionScale.between(source, body_map.source_action)
    middle, half = scale.of_squashed(source)
    still = np.clip(-middle / half, -1.0, 1.0)
    return Affine(matrix, np.where(matrix.any(axis=1), 0.0, still))


def _names(layout: Layout) -> list[tuple[str, int]]:
    return [(feature.name, place) for feature in layout for place in range(feature.size)]


def _outputs(body_map: BodyMap, matrix: Array, offset: Array, log_scale: Array) -> PolicyOutputs:
    fresh = np.zeros(body_map.target_action.size, dtype=np.bool_)
    places = body_map.target_action.slices
    for entry in body_map.action:
        fresh[places[entry.feature]] = isinstance(entry.rule, Learn)
    # An action gets the log standard deviation of its source action, or else the mean of all.
    taken = matrix != 0.0
    mean = np.full_like(matrix, 1.0 / matrix.shape[1])
    spread = np.where(taken.any(axis=1, keepdims=True), taken.astype(np.float64), mean)
    return PolicyOutputs(OutputMap(matrix, offset, fresh), OutputMap(spread, log_scale, fresh))


class BoundaryLayers(NamedTuple):
    """Maps of the layers that depend on the body, keyed by the name of the layer."""

    inputs: dict[str, Affine]
    outputs: dict[str, OutputMap]


def first_linear(network: nn.Module, name: str, otherwise: Iterable[str] = ()) -> list[str]:
    """Return the name of a network's first linear layer, or else `otherwise`."""
    for child, module in network.named_children():
        if isinstance(module, nn.Linear):
            return [f"{name}.{child}"]
    return list(otherwise)


def move_parameters(
    source: nn.Module, target: nn.Module, boundary: BoundaryLayers
) -> dict[str, torch.Tensor]:
    """Return parameters for `target` that make it equivalent to `source` through the maps.

    They are computed in float64 and stored in the source's type.
    """
    trained, new = source.state_dict(), target.state_dict()
    moved = {name: tensor.detach().clone() for name, tensor in trained.items()}

    for layer in dict.fromkeys((*boundary.inputs, *boundary.outputs)):
        at_weight, at_bias = f"{layer}.weight", f"{layer}.bias"
        # Weights and biases of a layer, or a vector of parameters.
        names = (layer,) if layer in trained else (at_weight, at_bias)
        values = {name: _array(trained, name) for name in names}
        if layer in boundary.inputs:  # W (A x + e) + b, as a layer of x.
            matrix, offset = boundary.inputs[layer]
            values[at_bias] = values[at_bias] + values[at_weight] @ offset
            values[at_weight] = values[at_weight] @ matrix
        if layer in boundary.outputs:  # N W and N b + d, or the parameters of a new network.
            matrix, offset, fresh = boundary.outputs[layer]
            for name, given in values.items():
                mapped = matrix @ given if name == at_weight else matrix @ given + offset
                is_new = fresh[:, np.newaxis] if name == at_weight else fresh
                values[name] = np.where(is_new, _array(new, name), mapped)
        for name, result in values.items():
            moved[name] = torch.as_tensor(result).to(trained[name])
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
    return moved


def _array(parameters: Mapping[str, torch.Tensor], name: str) -> Array:
    return parameters[name].detach().cpu().double().numpy()
