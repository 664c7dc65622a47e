"""Reads the settings of a driver out of its plan."""

from __future__ import annotations

import sys
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from typing import TypeVar, cast

from gpiozero import GPIOZeroError

from shapechanger.errors import RobotError

__all__ = ["in_words", "number", "numbers", "text", "texts", "whole", "wholes"]

_T = TypeVar("_T")


def whole(settings: Mapping[str, object], key: str) -> int:
    """A whole number, such as a pin."""
    return _of_type(settings, key, int, "a whole number")


def number(settings: Mapping[str, object], key: str) -> float:
    """Any number, such as a length."""
    if isinstance(value := settings.get(key), int) and not isinstance(value, bool):
        return float(value)
    return _of_type(settings, key, float, "a number")


def text(settings: Mapping[str, object], key: str) -> str:
    """A word."""
    return _of_type(settings, key, str, "a word")


def wholes(settings: Mapping[str, object], key: str) -> tuple[int, ...]:
    """Several whole numbers, such as pins."""
    values = cast("list[object]", _of_type(settings, key, list, "a list of whole numbers"))
    return tuple(whole({f"{key}[{i}]": value}, f"{key}[{i}]") for i, value in enumerate(values))


def numbers(settings: Mapping[str, object], key: str) -> tuple[float, ...]:
    """Several numbers, such as tensions."""
    values = cast("list[object]", _of_type(settings, key, list, "a list of numbers"))
    return tuple(number({f"{key}[{i}]": value}, f"{key}[{i}]") for i, value in enumerate(values))


def texts(settings: Mapping[str, object], key: str) -> tuple[str, ...]:
    """Several words, such as names of tendons."""
    values = cast("list[object]", _of_type(settings, key, list, "a list of words"))
    return tuple(text({f"{key}[{i}]": value}, f"{key}[{i}]") for i, value in enumerate(values))


def _of_type(settings: Mapping[str, object], key: str, kind: type[_T], words: str) -> _T:
    value = settings.get(key)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise RobotError(f"The setting {key!r} must be {words}, not {value!r}.")
    return value


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
