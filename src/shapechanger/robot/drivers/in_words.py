"""Turns what goes wrong in a device into a sentence."""

from __future__ import annotations

import sys
from collections.abc import Generator
from contextlib import contextmanager

from gpiozero import GPIOZeroError

from shapechanger.errors import RobotError

__all__ = ["in_words"]


@contextmanager
def in_words(device: str) -> Generator[None]:
    """Give the errors of gpiozero, lgpio and the kernel as `RobotError`.

    Args:
        device: What it is, such as "The motor on GPIO22 and GPIO27".

    Raises:
        RobotError: If the device does not answer.
    """
    try:
        yield
    except _errors() as error:
        raise RobotError(f"{device} does not answer: {str(error).rstrip('.')}.") from error


def _errors() -> tuple[type[BaseException], ...]:
    # lgpio has an exception of its own, and is not everywhere; what was never loaded never raises.
    lgpio = sys.modules.get("lgpio")
    own: tuple[type[BaseException], ...] = () if lgpio is None else (lgpio.error,)
    return (GPIOZeroError, OSError, ImportError, *own)
