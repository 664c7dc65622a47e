"""The fastest exact way to step a body: a tuned step, and a model that moves equally for less.

`tuned.TunedStep` is mixed into an env; `ModelWatch` notices when a user edits the model;
`find_twin` looks for a model that moves to the last bit like another and costs less.
"""

from __future__ import annotations

from shapechanger.envs.stepping.actions import check_action
from shapechanger.envs.stepping.twin import find_twin
from shapechanger.envs.stepping.watch import ModelWatch

__all__ = ["ModelWatch", "check_action", "find_twin"]
