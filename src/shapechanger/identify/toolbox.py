"""MuJoCo's toolbox for system identification, which is there only with its extra."""

from __future__ import annotations

import importlib
from typing import Any

from shapechanger.errors import MissingExtra

__all__ = ["sysid_toolbox"]


def sysid_toolbox() -> Any:
    """The module `mujoco.sysid`; it has no types.

    Raises:
        MissingExtra: If what it needs is not installed.
    """
    module = importlib.import_module("mujoco.sysid")
    # Without its dependencies it can be imported all the same, but is empty.
    if not hasattr(module, "build_residual_fn"):
        raise MissingExtra("mujoco[sysid]", "identify")
    return module
