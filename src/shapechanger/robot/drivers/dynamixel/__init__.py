"""Servos on one bus that pull tendons: Dynamixel, protocol 2.0, in current mode.

`ServoBus` (`bus`) is what the rest uses. It has no thread, never sleeps and takes the time from its
caller. Below it: `settings` and `models` say what is attached, `units` turns tensions and lengths
into counts, `wire` moves bytes with `dynamixel_sdk`, `health` and `slack` judge what the servos
say, `ramp` and `homing` say what they are told.

A tension here is what the current would pull without friction. The gears take some newtons of it
when the spool winds in, and add as much when the tendon pulls it out: see `ServoModel.friction_nm`.
"""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
