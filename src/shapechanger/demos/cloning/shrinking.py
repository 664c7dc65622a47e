"""Frames of demonstrations, shrunk to a policy's view while they are read."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.pictures import Framing, prepare
from shapechanger.demos.episodes import EpisodeHeader

Warp = Callable[[NDArray[np.uint8], EpisodeHeader], NDArray[np.uint8]]
"""Takes a frame and the header of its episode, and returns the frame of another camera."""


@dataclass
class ShrunkFrames:
    """Convert frames to a policy's view while they are read, and record their digests.

    Attributes:
        view: How frames are warped before; None for not at all.
    """

    framing: Framing
    view: Warp | None = None
    size: tuple[int, int] | None = None
    seen: list[bytes] = field(default_factory=list[bytes])

    def __call__(self, picture: NDArray[np.uint8], header: EpisodeHeader) -> NDArray[np.uint8]:
        """Return the policy's view of a frame of an episode."""
        if self.view is not None:
            picture = self.view(picture, header)
        self.size = picture.shape[0], picture.shape[1]
        small = prepare(picture[None], self.framing)[0]
        self.seen.append(hashlib.sha256(picture.tobytes()).digest())
        return small

    def digest(self, actions: NDArray[np.float32]) -> str:
        """Return a digest of the demonstrations."""
        return hashlib.sha256(b"".join(self.seen) + actions.tobytes()).hexdigest()
