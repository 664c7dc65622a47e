"""Learn in a source that is adapted to the target, and act on the target without learning there."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Final

from shapechanger.errors import StudyError
from shapechanger.transfer.env_ref import EnvTraits, SourceAdaptation
from shapechanger.transfer.files import write_json
from shapechanger.transfer.learners.settings import Settings
from shapechanger.transfer.methods import Method, MethodRun

__all__ = ["AdaptedSource", "Identified", "Randomised"]

# The env in the folder of the run.
_SOURCE: Final = "source.json"


class AdaptedSource(Method):
    """Train in a source adapted to the target; base class of the two below."""

    uses_source_policy = False
    learns_on_target = False

    def require(self, source: EnvTraits, target: EnvTraits, settings: Settings) -> None:
        """Refuse a target that cannot adapt its source."""
        del source, settings
        if not target.adapts_source:
            raise StudyError(
                f"{self.name} needs a target that can adapt the source to itself, such as a "
                "finger: leave this arm out."
            )

    def learn(self, run: MethodRun) -> Any:
        """Adapt the source, train in it, and evaluate on the target."""
        made = run.target.make()
        try:
            target = made.unwrapped
            assert isinstance(target, SourceAdaptation)  # As `require` has seen.
            env = run.source.having(self.arguments(target, run.seed))
        finally:
            made.close()
        write_json(run.folder / _SOURCE, env)
        policy = run.train(env, run.source_steps)
        run.report(run.evaluate(policy))
        return policy

    @abstractmethod
    def arguments(self, target: SourceAdaptation, seed: int) -> dict[str, Any]:
        """Return the arguments that make the source more like the target.

        Args:
            target: The target env.
            seed: Seed of what is random.
        """


class Randomised(AdaptedSource):
    """Learn in a source whose body is drawn anew for each episode."""

    name = "randomised"
    paper = "X. B. Peng and others, Sim-to-Real Transfer with Dynamics Randomization, ICRA 2018"

    def arguments(self, target: SourceAdaptation, seed: int) -> dict[str, Any]:
        """Return the plausible range of bodies."""
        del seed
        return target.randomised_source()


class Identified(AdaptedSource):
    """Learn in a source whose parameters are identified from motions of the target."""

    name = "identified"
    paper = "J. Tan and others, Sim-to-Real: Learning Agile Locomotion, RSS 2018"

    def arguments(self, target: SourceAdaptation, seed: int) -> dict[str, Any]:
        """Move the target, and return what was identified."""
        return target.identified_source(seed)
