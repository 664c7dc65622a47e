"""The fastest exact way to step a body: a tuned step, and a model that moves equally for less.

`tuned.TunedStep` is mixed into an env; `ModelWatch` notices when a user edits the model;
`find_fast_model` looks for a model that moves to the last bit like another and costs less.
"""

from __future__ import annotations

from shapechanger.envs.actions import check_action
from shapechanger.envs.stepping.fast_model import find_fast_model
from shapechanger.envs.stepping.watch import ModelWatch

__all__ = ["ModelWatch", "check_action", "find_fast_model"]
