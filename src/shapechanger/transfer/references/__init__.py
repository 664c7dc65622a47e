"""References of envs: values without skill, values of training from scratch, and a policy.

`references.json` and the policies next to it are written by `python -m benchmarks.run references`;
`README.md` is their card.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Final

import msgspec

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import require_known

FOLDER: Final = Path(__file__).parent


class EnvReference(msgspec.Struct, frozen=True, kw_only=True):
    """Measured values of an env, with the learner, env steps and seeds of its trainings.

    Attributes:
        floor: Values of each measure without skill: for random actions and for the action zero.
        ends: Values of each measure at the end of each training, the mean of its last evaluations.
        policy_seed: Seed of the shipped policy.
    """

    learner: str
    steps: int
    seeds: tuple[int, ...]
    version: str
    command: str
    floor: dict[str, dict[str, float]]
    ends: dict[str, tuple[float, ...]]
    policy_seed: int

    def end(self, measure: str) -> float | None:
        """Return the mean over the seeds of a measure's value at the end; None if not measured."""
        values = self.ends.get(measure)
        return sum(values) / len(values) if values else None

    @property
    def text(self) -> str:
        """Learner, steps and number of seeds of the reference, as text."""
        return f"the reference ({self.learner}, {self.steps:,} steps, {len(self.seeds)} seeds)"


@cache
def load_references() -> dict[str, EnvReference]:
    """Return all references, keyed by the ids of their envs."""
    content = (FOLDER / "references.json").read_bytes()
    return msgspec.json.decode(content, type=dict[str, EnvReference])


def reference_of(env: EnvRef) -> EnvReference | None:
    """Return the reference of an env; None if the env with these arguments has no reference."""
    return None if env.kwargs else load_references().get(env.id)


def reference_policy(env_id: str) -> Path:
    """Return the file of the shipped policy of an env; UnknownName if it has none."""
    require_known("reference policy", load_references(), env_id)
    return FOLDER / f"{env_id.rpartition('/')[2]}.safetensors"
