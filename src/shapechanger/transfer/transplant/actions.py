"""What becomes of each output of a policy, and of each action that a critic judges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from shapechanger.errors import TransplantError
from shapechanger.layout import Layout
from shapechanger.transfer.body_map import BodyMap, Learn
from shapechanger.transfer.transplant.normalisation import Affine

__all__ = ["Output", "Outputs", "gaussian_outputs", "judged_actions", "squashed_outputs"]

# tanh reaches 1 only at infinity; a constant at a bound is a millionth within it.
_CLOSEST_TO_BOUND: Final = 1.0 - 1e-6
# Bounds of a Box are in single precision.
_SAME: Final = 1e-6

Array = NDArray[np.float64]


class Output(NamedTuple):
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
class Outputs:
    """The two layers, or the layer and the parameters, that a Gaussian policy ends in.

    Attributes:
        mean: The mean of each action, before any squashing.
        log_std: The logarithm of its standard deviation. Where the mean is constant it is the mean
            of those of the source.
    """

    mean: Output
    log_std: Output


def gaussian_outputs(body_map: BodyMap) -> Outputs:
    """For a policy whose actions are in the env's units, as PPO's: a_t = N a_s + d."""
    matrix = body_map.action_matrix
    scale = np.abs(matrix).sum(axis=1)
    log_scale = np.log(np.where(scale > 0.0, scale, 1.0))
    fresh = _fresh(body_map)
    return Outputs(
        mean=Output(matrix, body_map.action_offset, fresh),
        log_std=Output(_spread(matrix), log_scale, fresh),
    )


def squashed_outputs(body_map: BodyMap, source: Box[Any], target: Box[Any]) -> Outputs:
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
    return Outputs(
        mean=Output(signs, bias, fresh),
        log_std=Output(_spread(signs), np.zeros(len(signs)), fresh),
    )


def judged_actions(body_map: BodyMap, outputs: Outputs, source: Box[Any]) -> Affine:
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
