"""Observation statistics of the target, and the first layer's view of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.running_mean_std import RunningMeanStd

from shapechanger.layout import Feature
from shapechanger.transfer.body_map import BodyMap, Take

__all__ = ["Affine", "Scaling", "observation_affine", "transplant_normalisation"]

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
        if isinstance(entry.rule, Take):
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
