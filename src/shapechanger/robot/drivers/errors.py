"""Translation of the errors of devices."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Generator
from contextlib import contextmanager

from shapechanger.errors import RobotError


@contextmanager
def device_errors(device: str) -> Generator[None]:
    """Turn the errors of gpiozero, lgpio and the kernel into a `RobotError`.

    Args:
        device: Description of the device, such as "The motor on GPIO22 and GPIO27".
    """
    try:
        yield
    except _kinds() as error:
        # A device that could not be opened frees its pins when nothing refers to it any more. In
        # Python 3.13 the frame that opened it would live until a garbage collection.
        traceback.clear_frames(error.__traceback__)
        raise RobotError(f"{device} does not answer: {str(error).rstrip('.')}.") from error


def _kinds() -> tuple[type[BaseException], ...]:
    """Return the errors of the kernel, and of gpiozero and lgpio if they are loaded."""
    names = (("gpiozero", "GPIOZeroError"), ("lgpio", "error"))
    loaded = [(sys.modules.get(module), name) for module, name in names]
    own = tuple(getattr(module, name) for module, name in loaded if module is not None)
    return (OSError, ImportError, *own)
