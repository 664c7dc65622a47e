"""Learn in many bodies of the family first, and then in the target."""

from __future__ import annotations

from typing import Any, Final

import msgspec

from shapechanger.contract.env_ref import BodyDraw
from shapechanger.transfer.methods import Method, MethodRun

BODIES: Final = 32
"""Bodies that the policy learns in before the target."""


class Generalist(Method):
    """Learn in bodies drawn from the source's family, then in the target with the same weights.

    The evaluation before the first target step shows the generalist in a body that it has
    never had.
    """

    name = "generalist"
    needs = (("many bodies", "a policy that fits many bodies: give --learner limbs or rsl-limbs"),)
    paper = "A. Gupta and others, MetaMorph: Learning Universal Controllers, ICLR 2022"
    uses_source_policy = False
    one_family = True

    def learn(self, run: MethodRun) -> Any:
        """Train on many bodies, then on the target."""
        many = run.source.having({"bodies": msgspec.to_builtins(BodyDraw(count=BODIES))})
        return run.fine_tune(start=run.train(many, run.source_steps))
