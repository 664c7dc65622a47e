"""The fast step of ants and pendulums, bit-equal to Gymnasium's.

`tuned.TunedStep` is the mixin; `ModelWatch` detects edits to a model; `find_fast_model` finds a
model that moves equally to the last bit and costs less.
"""

from __future__ import annotations

from shapechanger.envs.stepping.fast_model import find_fast_model
from shapechanger.envs.stepping.watch import ModelWatch

__all__ = ["ModelWatch", "find_fast_model"]
