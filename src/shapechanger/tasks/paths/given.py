"""A path as a user gives it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import PurePath
from typing import Any, Final, cast

from numpy.typing import ArrayLike

from shapechanger.errors import PathError, UnknownName
from shapechanger.tasks.paths.function import from_callable
from shapechanger.tasks.paths.path import Path
from shapechanger.tasks.paths.shapes import circle, curve_3d, figure_eight, line
from shapechanger.tasks.paths.table import from_csv

__all__ = ["KINDS", "PathSource", "as_path"]

PathSource = Path | str | PurePath | Mapping[str, Any] | Callable[[float], ArrayLike]
"""A path, its name, a CSV file, a name with settings, or a function of time."""

_MAKERS: Final[dict[str, Callable[..., Path]]] = {
    "circle": circle,
    "figure-eight": figure_eight,
    "line": line,
    "curve": curve_3d,
}

KINDS: Final = tuple(_MAKERS)
"""Names of the shapes."""

_KIND: Final = "kind"
_FILE: Final = ".csv"


def as_path(value: PathSource) -> Path:
    """A path, however it was given.

    Args:
        value: A path; the name of a shape, one of `KINDS`; a mapping with that name as "kind" and
            with arguments of the function that makes the shape, such as
            `{"kind": "circle", "radius": 0.01, "hz": 1.0}`; the name of a file that ends in .csv,
            as `from_csv` reads it; or a function, as `from_callable` takes it, which goes on for
            ever.

    Raises:
        UnknownName: If there is no such shape, or it has no such setting.
        PathError: If it is none of these, or no path can be made of it.
    """
    given: Any = value  # What a type checker knows, a notebook may not.
    if isinstance(given, Path):
        return given
    if isinstance(given, (str, PurePath)) and str(given).lower().endswith(_FILE):
        return from_csv(given)
    if isinstance(given, PurePath):
        raise PathError(f"A path is read from a file that ends in {_FILE}, got {str(given)!r}.")
    if isinstance(given, str):
        return _maker(given)()
    if isinstance(given, Mapping):
        return _with_settings(dict(cast("Mapping[Any, Any]", given)))
    if callable(given):
        return from_callable(cast("Callable[[float], ArrayLike]", given))
    raise PathError(
        f"A path is one of {', '.join(KINDS)}, such a name with settings, a {_FILE} file or a "
        f"function of time, got {given!r}."
    )


def _with_settings(settings: dict[Any, Any]) -> Path:
    if _KIND not in settings:
        raise PathError(
            f'A path with settings has the key "{_KIND}", one of {", ".join(KINDS)}, got '
            f"{settings!r}."
        )
    kind = str(settings.pop(_KIND))
    maker = _maker(kind)
    known = tuple(inspect.signature(maker).parameters)
    for name in settings:
        if name not in known:
            raise UnknownName(f"setting of {kind!r}", str(name), known)
    return maker(**settings)


def _maker(kind: str) -> Callable[..., Path]:
    if kind not in _MAKERS:
        raise UnknownName("path", kind, KINDS)
    return _MAKERS[kind]
