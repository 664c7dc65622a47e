"""Typed access to the settings of a driver."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar, cast

from shapechanger.errors import RobotError

_T = TypeVar("_T")


def whole(settings: Mapping[str, object], key: str) -> int:
    """Return an integer setting, such as a pin.

    Args:
        settings: Settings of the plan.
        key: Name of the setting.
    """
    return _of_type(settings, key, int, "a whole number")


def number(settings: Mapping[str, object], key: str) -> float:
    """Return a number, such as a length.

    Args:
        settings: Settings of the plan.
        key: Name of the setting.
    """
    if isinstance(value := settings.get(key), int) and not isinstance(value, bool):
        return float(value)
    return _of_type(settings, key, float, "a number")


def text(settings: Mapping[str, object], key: str) -> str:
    """Return a string.

    Args:
        settings: Settings of the plan.
        key: Name of the setting.
    """
    return _of_type(settings, key, str, "a word")


def wholes(settings: Mapping[str, object], key: str) -> tuple[int, ...]:
    """Return a tuple of integers, such as pins.

    Args:
        settings: Settings of the plan.
        key: Name of the setting.
    """
    values = cast("list[object]", _of_type(settings, key, list, "a list of whole numbers"))
    return tuple(whole({f"{key}[{i}]": value}, f"{key}[{i}]") for i, value in enumerate(values))


def texts(settings: Mapping[str, object], key: str) -> tuple[str, ...]:
    """Return a tuple of strings, such as names of tendons.

    Args:
        settings: Settings of the plan.
        key: Name of the setting.
    """
    values = cast("list[object]", _of_type(settings, key, list, "a list of words"))
    return tuple(text({f"{key}[{i}]": value}, f"{key}[{i}]") for i, value in enumerate(values))


def _of_type(settings: Mapping[str, object], key: str, kind: type[_T], words: str) -> _T:
    value = settings.get(key)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise RobotError(f"The setting {key!r} must be {words}, not {value!r}.")
    return value
