"""`shapechanger train`: train a policy in one env."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from shapechanger.cli.console import NO_POLICY, StudyProgress, command_line, interruptible, say
from shapechanger.cli.env_arguments import Body, EnvId, Learner, Settings, opened, settings_of
from shapechanger.contract.env_ref import BodyDraw, EnvRef, each_body, env_traits
from shapechanger.envs.catalogue import allow_own_modules, default_learner, driven, env_ref
from shapechanger.errors import StudyError, check_seed, needing_extra
from shapechanger.files import make_folder, require_file
from shapechanger.policy import load_policy
from shapechanger.transfer.executor import use_one_thread
from shapechanger.transfer.learners import SharedFile
from shapechanger.transfer.learners.presets import in_many_bodies, resolve_learner, tuning_text
from shapechanger.transfer.runs import learner_of

if TYPE_CHECKING:
    from shapechanger.transfer.learners.evaluation import Evaluation

# Trains a policy, with a callback that takes the number of steps done.
_Training = Callable[[Callable[[int], None]], Any]


@dataclass(frozen=True)
class Train:
    """Train a policy in one env and write it to a file for `play` and `transfer`."""

    env: EnvId
    body: Body = ""
    bodies: int = 0
    """Train one policy in this many bodies at once, drawn from the env's family; 0 for one body."""
    out: Path | None = None
    """The file to write; results/policies/ENV.safetensors if not given."""
    steps: int | None = None
    """Number of env steps; the default of the learner, or of the student, if not given."""
    learner: Learner = ""
    set: Settings = ()
    seed: int = 0
    """Seed of all randomness."""
    teacher: Path | None = None
    """Policy of the same vehicle that observes distances, such as one trained in CarRanges. Instead
    of reinforcement learning, a student that observes only images is trained to imitate it."""
    tensorboard: Path | None = None
    """Folder for TensorBoard's logs; none are written if not given."""

    def run(self) -> None:
        check_seed(self.seed, StudyError)
        allow_own_modules(self.learner)
        env = driven(env_ref(self.env, self.body))
        if self.bodies:
            if self.bodies < 0 or self.body:
                raise StudyError("--bodies must be above 0, and excludes --body.")
            draw = BodyDraw(count=self.bodies, seed=self.seed)
            env = env.having({"bodies": msgspec.to_builtins(draw)})
        out = self.out or Path("results", "policies", env.id.split("/")[-1] + ".safetensors")
        by = self._by_learner(env) if self.teacher is None else self._by_teacher(env, self.teacher)
        steps, training = by
        require_file(out)  # The policy is written last; check first that it can be.
        use_one_thread()
        with interruptible(lambda: NO_POLICY), StudyProgress({env.id: steps}) as progress:
            policy = training(lambda done: progress(env.id, done, False))
        policy.carded(command=command_line()).save(out)
        say(f"wrote {out}")

    def _by_learner(self, env: EnvRef) -> tuple[int, _Training]:
        wanted = self.learner or ("limbs" if self.bodies else default_learner(env))
        if self.bodies:
            wanted = in_many_bodies(wanted)
        learner, settings = resolve_learner(wanted, settings_of(self.set))
        if self.bodies and "many bodies" not in settings.takes:
            raise StudyError(
                f"{learner} learns in one body. With --bodies, give --learner limbs, or rsl-ppo "
                "for worlds on a GPU."
            )
        steps = settings.steps if self.steps is None else self.steps
        settings.require_budget(steps)
        trains = learner_of(learner, settings)
        with opened(each_body(env)[0]) as made:
            trains.require(env, env_traits(made))
        if self.tensorboard is not None:
            if "callback" not in settings.takes:
                raise StudyError(f"{learner} has no TensorBoard logs: leave out --tensorboard.")
            with needing_extra("learn"):
                import_module("torch.utils.tensorboard")
            make_folder(self.tensorboard)
        whole = settings.whole_updates(steps)

        def training(on_steps: Callable[[int], None]) -> Any:
            say(f"{learner}: {tuning_text(learner, env.id)}")
            more: dict[str, Any] = {}
            if "demonstrations" in settings.takes:
                name = f"{env.id.split('/')[-1]}-{self.seed}.npz"
                file = Path("results", "demonstrations", name)
                more["demonstrations"] = SharedFile(file, self.seed)
            trains.threads, trains.tensorboard = None, self.tensorboard
            more |= {"on_evaluation": _print_evaluation, "on_steps": on_steps}
            return trains.train(env, whole, self.seed, **more)

        return whole, training

    def _by_teacher(self, env: EnvRef, teacher: Path) -> tuple[int, _Training]:
        from shapechanger.vehicles.cloning import STUDENT_STEPS, train_student  # PyTorch.

        if self.learner or self.set or self.tensorboard is not None:
            raise StudyError("--teacher excludes --learner, --set and --tensorboard.")
        if not teacher.exists():
            raise StudyError(
                f"There is no teacher {teacher}: `shapechanger train CarRanges` makes a car's."
            )
        steps = STUDENT_STEPS if self.steps is None else self.steps

        def training(on_steps: Callable[[int], None]) -> Any:
            return train_student(env, load_policy(teacher), steps, self.seed, on_steps=on_steps)

        return steps, training


def _print_evaluation(result: Evaluation) -> None:
    terms = ", ".join(f"{name} {value:.4g}" for name, value in result.terms.items())
    if result.standing is not None:
        terms += f"; it stood in {result.standing:.1%} of the steps"
    say(
        f"{result.steps:>9} steps: return {result.mean_return:.1f} "
        f"over {result.mean_length:.0f} steps an episode ({terms})"
    )
