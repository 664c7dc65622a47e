"""Where each tendon runs along the bones, for display."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

__all__ = ["COURSES", "HAND", "Course", "Over", "Through"]

HAND: Final = "hand"
"""Name of the body that shows the hand; its axes are those of the finger, at the knuckle."""


class Through(NamedTuple):
    """A tendon passes a point of a bone.

    Attributes:
        body: Whose axes they are: x along the bone from its own joint, y radial, z dorsal.
        x: mm.
        y: mm.
        z: mm.
    """

    body: str
    x: float
    y: float
    z: float


class Over(NamedTuple):
    """A tendon passes the back of a joint, and lies on it where it bends.

    Attributes:
        joint: "MCP", "PIP" or "DIP".
    """

    joint: str


Course = tuple[Through | Over, ...]


def _on(body: str, *points: tuple[float, float, float]) -> Course:
    return tuple(Through(body, *point) for point in points)


_P, _M, _D = "proximal", "middle", "distal"


def _extensor(y: float) -> Course:
    """Over the knuckle, down the middle of the hood, to the base of the distal phalanx."""
    return (
        *_on(HAND, (-58.0, 1.8 * y, 7.0), (-12.0, y, 7.0)),
        Over("MCP"),
        *_on(_P, (12.0, y, 6.2), (36.0, 0.7 * y, 5.8)),
        Over("PIP"),
        *_on(_M, (8.0, 0.7 * y, 5.2), (20.0, 0.5 * y, 4.6)),
        Over("DIP"),
        *_on(_D, (4.5, 0.4 * y, 3.8)),
    )


def _to_the_hood(side: float) -> Course:
    """From the side of the proximal phalanx into the hood, and on as its lateral band."""
    return (
        *_on(_P, (9.0, 7.0 * side, -3.5), (30.0, 5.0 * side, 3.6)),
        Over("PIP"),
        *_on(_M, (7.0, 3.2 * side, 4.7), (20.0, 1.6 * side, 4.4)),
        Over("DIP"),
        *_on(_D, (4.5, 1.2 * side, 3.6)),
    )


# Drawn by the plates of any atlas: sides and order are anatomy, millimetres are chosen, so that
# each is seen. Off the flexors' joints a pulley is farther than the bent tendon is below.
COURSES: Final[Mapping[str, tuple[Course, ...]]] = MappingProxyType(
    {
        # Below FDS up to the knuckle, then through its slips, to the base of the distal phalanx.
        "FDP": (
            (
                *_on(HAND, (-58.0, 0.6, -6.6), (-11.0, 0.0, -7.0)),
                *_on(_P, (11.0, 0.0, -6.6), (24.0, 0.0, -7.0), (36.0, 0.0, -6.6)),
                *_on(_M, (9.0, 0.0, -5.8), (19.0, 0.0, -5.4)),
                *_on(_D, (6.0, 0.0, -3.4)),
            ),
        ),
        # Nearest to the palm; it splits around FDP, and each slip ends at a side of the middle
        # phalanx.
        "FDS": tuple(
            (
                *_on(HAND, (-58.0, -0.6, -8.8), (-11.0, 0.0, -9.2)),
                *_on(_P, (11.0, 0.0, -8.6), (24.0, 2.2 * side, -7.0), (36.0, 2.8 * side, -6.0)),
                *_on(_M, (10.0, 2.8 * side, -3.6)),
            )
            for side in (1.0, -1.0)
        ),
        # On the ulnar side of EDC.
        "EIP": (_extensor(-1.5),),
        "EDC": (_extensor(1.5),),
        # From the tendon of FDP in the palm, radially and palmar of the knuckle's axis.
        "LUM": ((*_on(HAND, (-40.0, 1.6, -6.6), (-10.0, 6.2, -6.0)), *_to_the_hood(1.0)),),
        # From the back of the web between thumb and finger to the base of the proximal phalanx.
        "DI": (
            (
                *_on(HAND, (-42.0, 5.0, 1.5), (-9.0, 7.6, -1.0)),
                *_on(_P, (4.0, 7.6, -1.2), (10.0, 4.6, -0.8)),
            ),
        ),
        "PI": ((*_on(HAND, (-42.0, -5.0, -1.5), (-9.0, -7.2, -3.6)), *_to_the_hood(-1.0)),),
    }
)
"""The courses of each tendon, from the wrist on: one, or one for each slip it splits into."""
