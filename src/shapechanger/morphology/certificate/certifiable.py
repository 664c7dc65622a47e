"""Protocols of environments whose shifts can be certified, without Gymnasium."""

from __future__ import annotations

from typing import Any, Protocol, SupportsFloat, cast

import mujoco

from shapechanger.layout import Layout


class Certifiable(Protocol):
    """An environment whose body and numbers are known.

    Attributes:
        model: The compiled model that it steps.
        standing_height: Height in m of its trunk when it stands; None if it does not stand.
        observation_layout: What the numbers of an observation mean.
        action_layout: What the numbers of an action mean.
    """

    model: mujoco.MjModel
    standing_height: float | None
    observation_layout: Layout
    action_layout: Layout

    def reset(self, *, seed: int | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode."""
        ...

    def step(self, action: Any, /) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Act for one step."""
        ...


class Wrapped(Protocol):
    """A wrapper around a `Certifiable`: what it changes in observations and actions counts."""

    @property
    def unwrapped(self) -> Any:
        """The environment inside all wrappers."""
        ...

    def reset(self, *, seed: int | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode."""
        ...

    def step(self, action: Any, /) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Act for one step."""
        ...


def attribute(env: Certifiable | Wrapped, name: str) -> Any:
    """Return an attribute of an environment, or of the one inside its wrappers.

    Args:
        env: The environment.
        name: Name of the attribute.

    Raises:
        AttributeError: If neither has it.
    """
    return getattr(env, name) if hasattr(env, name) else getattr(cast(Any, env).unwrapped, name)
