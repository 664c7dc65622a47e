"""An env as a value: its id and its arguments, so that another process can make it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import gymnasium as gym
import msgspec

from shapechanger.errors import LayoutError, UnknownName
from shapechanger.layout import Layout

__all__ = ["EnvRef", "layouts_of"]


class EnvRef(msgspec.Struct, frozen=True):
    """An env by its id and arguments.

    Attributes:
        id: A registered id, or `module:id` to import a module first.
        kwargs: Arguments of `gymnasium.make` that JSON can hold, such as a body as JSON.
    """

    id: str
    kwargs: dict[str, Any] = {}

    def __str__(self) -> str:
        """The id, with the arguments if there are any."""
        arguments = ", ".join(f"{name}={value}" for name, value in self.kwargs.items())
        return f"{self.id} ({arguments})" if arguments else self.id

    def having(self, more: Mapping[str, Any]) -> EnvRef:
        """The same env with more arguments, or with others in their place."""
        return EnvRef(self.id, {**self.kwargs, **more})

    def make(self, **more: Any) -> gym.Env[Any, Any]:
        """Make the env.

        Args:
            **more: Arguments for this one only, such as `render_mode`.

        Raises:
            UnknownName: If no env has this id.
        """
        try:
            return gym.make(self.id, **{**self.kwargs, **more})
        except (gym.error.UnregisteredEnv, ModuleNotFoundError) as error:
            known = [name for name in gym.registry if name.startswith("shapechanger/")]
            raise UnknownName("environment", self.id, known) from error


def layouts_of(env: gym.Env[Any, Any]) -> tuple[Layout, Layout]:
    """What the observation and the action of an env mean.

    Raises:
        LayoutError: If the env does not say.
    """
    found = [getattr(env.unwrapped, f"{side}_layout", None) for side in ("observation", "action")]
    if not all(isinstance(layout, Layout) for layout in found):
        name = env.spec.id if env.spec else type(env.unwrapped).__name__
        raise LayoutError(
            f"{name} publishes no observation_layout and action_layout, so nothing says what its "
            "numbers mean: add them to the env, as `shapechanger.Layout`s."
        )
    observation, action = cast("list[Layout]", found)
    return observation, action
