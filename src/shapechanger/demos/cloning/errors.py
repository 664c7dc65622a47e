"""What can go wrong when a policy is cloned, used, saved or loaded."""

from __future__ import annotations

from shapechanger.errors import ShapechangerError

__all__ = ["CloningError", "PolicyError"]


class CloningError(ShapechangerError, ValueError):
    """Pictures, actions or settings that nothing can be learned from."""


class PolicyError(ShapechangerError, ValueError):
    """A file that holds no policy, or a policy that does not fit the env it is to act in."""
