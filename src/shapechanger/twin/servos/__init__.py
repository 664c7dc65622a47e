"""Simulated Dynamixel servos on a bus: they take and give bytes of protocol 2.0.

`Line` (`line`) is the bus with its servos; its time moves only when it is told to. Above it `port`
is a port for the driver in the same process, `pty` a pseudo-terminal for anything that opens a
serial device. Below it: `packets` and `table` are the protocol and the registers, `servo` one
servo, `motor` how it turns, `load` what it pulls at.

What no source tells and the twin assumes is marked "assumed"; the list is in `servo`.
"""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
