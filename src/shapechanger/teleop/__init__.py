"""A person at the workstation who drives: what keys mean, without sockets or pins."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
