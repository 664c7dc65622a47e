"""The packages of others that only some formats need, and that say nothing of their types."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from shapechanger.errors import MissingExtra

__all__ = ["library"]


def library(name: str) -> Any:
    """A module of h5py, Minari or simplejpeg.

    Raises:
        MissingExtra: If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingExtra(name.split(".")[0], "data") from error
