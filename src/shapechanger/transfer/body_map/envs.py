"""Body maps of Gymnasium envs, and the wrapper that gives a target env the source's spaces."""

from __future__ import annotations

from typing import Any, SupportsFloat, cast

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from shapechanger.contract.env_ref import layouts_of
from shapechanger.errors import SpaceMismatch
from shapechanger.layout import Layout
from shapechanger.transfer.body_map.map import BodyMap

Array = NDArray[Any]


def body_map(
    source_env: gym.Env[Any, Any], target_env: gym.Env[Any, Any], **options: Any
) -> BodyMap:
    """Match the features of two envs by name.

    Args:
        source_env: The env that a policy was trained in.
        target_env: The env that the policy acts in.
        **options: Rules, `otherwise` and `units`, see `BodyMap.between`.

    Raises:
        LayoutError: If an env publishes no layouts.
        MapError: If the two envs cannot be mapped.
        UnknownName: If a rule matches no feature, or copies one that does not exist.
    """
    ours, theirs = layouts_of(source_env), layouts_of(target_env)
    return BodyMap.between(ours[0], theirs[0], ours[1], theirs[1], **options)


class MappedEnv(gym.Wrapper[Array, Array, Array, Array], gym.utils.RecordConstructorArgs):
    """Target env with the observations and actions of the source, for a policy of the source.

    Observations are float64 and actions are float32, with the ranges of the source's layouts.
    Rewards, terminations and infos come from the target.

    Attributes:
        body_map: Map between the two bodies.

    Args:
        env: The target env.
        body_map: Map between the bodies, or its JSON; the spec of this env contains the JSON.

    Raises:
        MapError: If the JSON is not a body map.
        SpaceMismatch: If a space of the target does not have the size of its layout.
    """

    def __init__(self, env: gym.Env[Any, Any], body_map: BodyMap | str) -> None:
        built = BodyMap.from_json(body_map) if isinstance(body_map, str) else body_map
        gym.utils.RecordConstructorArgs.__init__(self, body_map=built.to_json())
        super().__init__(env)
        self.body_map = built
        check_size("target observation", env.observation_space, built.target_observation)
        moves = check_size("target action", env.action_space, built.target_action)
        self._target_dtype = moves.dtype
        sensed, moved = built.source_observation, built.source_action
        self.observation_space = Box(sensed.low, sensed.high, dtype=np.float64)
        low, high = moved.low.astype(np.float32), moved.high.astype(np.float32)
        self.action_space = Box(low, high, dtype=np.float32)

    @property
    def observation_layout(self) -> Layout:
        """The source's observation layout."""
        return self.body_map.source_observation

    @property
    def action_layout(self) -> Layout:
        """The source's action layout."""
        return self.body_map.source_action

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Reset the target env."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._sensed(observation), info

    def step(self, action: Array) -> tuple[Array, SupportsFloat, bool, bool, dict[str, Any]]:
        """Step the target env with an action of the source.

        Args:
            action: An action of the source, shape (source_action.size,).
        """
        moved = self.body_map.adapt_action(action).astype(self._target_dtype)
        observation, reward, terminated, truncated, info = self.env.step(moved)
        return self._sensed(observation), reward, terminated, truncated, info

    def _sensed(self, observation: Array) -> Array:
        return self.body_map.adapt_observation(np.asarray(observation, dtype=np.float64))


def check_size(which: str, space: Any, layout: Layout) -> Box[Any]:
    """Return the space if it is a flat Box of the size of its layout; raise otherwise."""
    if not isinstance(space, Box) or space.shape != (layout.size,):
        raise SpaceMismatch(
            f"The layout of the {which} has {layout.size} numbers, so its space must be a Box of "
            f"shape ({layout.size},), not {space}."
        )
    return cast("Box[Any]", space)
