"""Registration of `make_vec`, so that learners make vector envs without importing any env."""

from __future__ import annotations

from typing import Any, Final

from gymnasium.envs.registration import load_env_creator

_MAKERS: Final[list[str]] = []


def register_make_vec(where: str) -> None:
    """Let learners make vector envs.

    Args:
        where: "module:function" of a function like `shapechanger.make_vec`, imported on its first
            use.
    """
    _MAKERS[:] = [where]


def make_vec(env_id: str, num_envs: int, **arguments: Any) -> Any:
    """Make a vector env by the registered function.

    Args:
        env_id: A registered id.
        num_envs: How many envs.
        **arguments: All other arguments of `shapechanger.make_vec`.

    Raises:
        ShapechangerError: As `shapechanger.make_vec`.
    """
    maker: Any = load_env_creator(_MAKERS[0])
    return maker(env_id, num_envs, **arguments)
