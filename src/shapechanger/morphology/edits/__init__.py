"""The edits: one class for each change to a model.

Every module of this folder is imported, so a file with an edit needs to be named nowhere else.
"""

from __future__ import annotations

import importlib
import pkgutil

from shapechanger.morphology.edits.edit import EDITS, Edit, Vector

__all__ = ["EDITS", "Edit", "Vector"]

for _module in pkgutil.iter_modules(__path__, f"{__name__}."):
    importlib.import_module(_module.name)
