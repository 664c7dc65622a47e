"""What keys mean: W, A, S, D and the arrows hold the robot's steering and throttle.

A terminal says that a key went down, again and again while it is held, and never that it went up.
So a direction holds for a moment after each press, and ends by itself: hold to run.

Of two keys that are held together a terminal repeats only the one that went down last. So when
another direction arrives, one that still holds goes on for as long as a first press does. It could
also go on for as long as the other key repeats; but then nobody could end the throttle while they
steer, since a terminal does not say that a key went up. As it is, no key acts for longer than
`FIRST_HOLD_S` after it was last pressed; to drive through a long curve, press both in turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

__all__ = ["DIRECTIONS", "FIRST_HOLD_S", "REPEAT_HOLD_S", "HeldKeys"]

FIRST_HOLD_S: Final = 0.6
"""How long a first press holds, s: terminals begin to repeat after up to 0.5 s. No press holds for
longer."""

REPEAT_HOLD_S: Final = 0.2
"""How long a repeated press holds, s: terminals repeat some 30 times a second. Where another
direction arrives meanwhile, it holds as long as a first press."""

DIRECTIONS: Final = {
    "w": ("throttle", 1.0),
    "up": ("throttle", 1.0),
    "s": ("throttle", -1.0),
    "down": ("throttle", -1.0),
    "a": ("steering", -1.0),
    "left": ("steering", -1.0),
    "d": ("steering", 1.0),
    "right": ("steering", 1.0),
}
"""What each key moves, and which way: -1 is left and backward."""


@dataclass(slots=True)
class _Held:
    value: float
    pressed_s: float
    until_s: float


class HeldKeys:
    """The values that the keys hold at the moment.

    >>> keys = HeldKeys()
    >>> keys.press("w", now_s=0.0)
    True
    >>> keys.value("throttle", now_s=0.1), keys.value("throttle", now_s=0.7)
    (1.0, 0.0)
    """

    def __init__(self) -> None:
        self._held: dict[str, _Held] = {}

    def press(self, key: str, now_s: float) -> bool:
        """Take note of a key.

        Returns:
            Whether it is a direction.
        """
        if key not in DIRECTIONS:
            return False
        action, value = DIRECTIONS[key]
        held = self._held.get(action)
        repeats = held is not None and held.value == value and now_s <= held.until_s
        until_s = now_s + (REPEAT_HOLD_S if repeats else FIRST_HOLD_S)
        # The first repeat may come long before the first hold is over: never shorten it.
        if repeats and held is not None:
            until_s = max(until_s, held.until_s)
        for other in self._held.values():
            if now_s <= other.until_s:  # Its own repeats may end here, because this key has begun.
                other.until_s = max(other.until_s, other.pressed_s + FIRST_HOLD_S)
        self._held[action] = _Held(value, now_s, until_s)
        return True

    def value(self, action: str, now_s: float) -> float:
        """What the keys hold of an action: -1, 0 or 1."""
        held = self._held.get(action)
        return held.value if held is not None and now_s <= held.until_s else 0.0

    def let_go(self) -> None:
        """Forget all keys."""
        self._held.clear()
