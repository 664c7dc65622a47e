"""What a finger is like, found out by moving it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    import gymnasium as gym

    from shapechanger.embodiments.finger import FingerParameters

__all__ = ["identified"]

_SECONDS: Final = 10.0


def identified(
    env: gym.Env[Any, Any], actions: str, seed: int, known: FingerParameters | None = None
) -> FingerParameters:
    """Let a finger move all its joints for ten seconds, and identify it.

    Args:
        env: Of the finger; without a longest episode.
        actions: What its actions command.
        seed: Of the motions.
        known: A finger whose motors are those of this one; None where nothing is known of them.

    Raises:
        FingerError: If the motions are not enough, or observations are no list of numbers.
        MissingExtra: If `mujoco.sysid` is not there.
    """
    # An optimiser, which an env that only steps does not need.
    from shapechanger.envs.finger.recording import record_babble
    from shapechanger.identify import identify

    return identify(record_babble(env, _SECONDS, seed, actions), known=known).parameters
