"""`shapechanger train`: train a policy in one env."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from shapechanger.cli.console import Interrupted, StudyProgress, plain_console
from shapechanger.cli.env_arguments import (
    default_learner,
    driven,
    env_ref,
    opened,
    require_seed,
    settings_of,
)
from shapechanger.errors import MissingExtra, OutputError, StudyError

if TYPE_CHECKING:
    from shapechanger.transfer.env_ref import EnvRef
    from shapechanger.transfer.learners.evaluation import Evaluation
    from shapechanger.transfer.learners.settings import CloningSettings


@dataclass(frozen=True)
class Train:
    """Train a policy in one env and write it to a file for `play` and `transfer`."""

    env: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ENV")]
    """Id of the env, such as BigAnt."""
    body: str = ""
    """Another body of the family: its name, or edits as JSON."""
    out: Path | None = None
    """The file to write; results/policies/ENV.safetensors if not given."""
    steps: int | None = None
    """Env steps; the learner's own number if not given."""
    learner: str | None = None
    """Name of the learner's settings, a TOML file of them, or a class or function of yours as
    module:name; those tuned for the env if not given."""
    set: tuple[str, ...] = ()
    """Settings of the learner that replace its own, as NAME=VALUE: learning_rate=3e-4."""
    seed: int = 0
    """Seed of everything random."""
    teacher: Path | None = None
    """Policy of the same vehicle on distances, such as one of CarRanges: its student, which sees
    pictures alone, is trained instead of learning by trial."""
    tensorboard: Path | None = None
    """Folder for TensorBoard's logs; none are written if not given."""

    def run(self) -> None:
        """Train and print evaluations as they complete."""
        from shapechanger.transfer.env_ref import env_traits
        from shapechanger.transfer.files import make_folder
        from shapechanger.transfer.learners.policy_file import save_policy
        from shapechanger.transfer.learners.sb3 import Sb3Learner, use_one_thread
        from shapechanger.transfer.learners.settings import (
            Sb3Settings,
            require_budget,
            resolve_learner,
            tuning_text,
        )
        from shapechanger.transfer.runs import learner_of

        require_seed(self.seed)
        env = driven(env_ref(self.env, self.body))
        if self.teacher is not None:
            self._train_student(env, self.teacher)
            return
        learner, settings = resolve_learner(
            self.learner or default_learner(env), settings_of(self.set)
        )
        steps = settings.steps if self.steps is None else self.steps
        require_budget(steps, settings)
        out = self.out or Path("results", "policies", env.id.split("/")[-1] + ".safetensors")
        # The policy is written last; check first that it can be.
        with opened(env) as made:
            learner_of(learner, settings).require(env, env_traits(made))
        if out.is_dir():
            raise OutputError(f"Cannot write {out}: it is a folder.")
        if self.tensorboard is not None:
            _require_tensorboard()
            make_folder(self.tensorboard)
        make_folder(out.parent)
        use_one_thread()
        console = plain_console()
        console.print(f"{learner}: {tuning_text(learner, env.id)}")

        def show(result: Evaluation) -> None:
            terms = ", ".join(f"{name} {value:.4g}" for name, value in result.terms.items())
            console.print(
                f"{result.steps:>9} steps: return {result.mean_return:.1f} "
                f"over {result.mean_length:.0f} steps an episode ({terms})"
            )

        try:
            with StudyProgress({env.id: settings.whole_updates(steps)}) as progress:
                if not isinstance(settings, Sb3Settings):
                    _learn_to_drive(env, learner, settings, steps, self.seed, out, show, progress)
                    console.print(f"wrote {out}")
                    return
                policy = Sb3Learner(
                    learner, settings, tensorboard=self.tensorboard, threads=None
                ).train(
                    env,
                    steps,
                    self.seed,
                    on_evaluation=show,
                    on_steps=lambda done: progress(env.id, done, False),
                )
        except KeyboardInterrupt:
            raise Interrupted("Stopped; a training that is cut off leaves no policy.") from None
        save_policy(policy, out)
        console.print(f"wrote {out}")

    def _train_student(self, env: EnvRef, teacher: Path) -> None:
        from shapechanger.transfer.files import make_folder
        from shapechanger.transfer.learners.policy_file import load_policy
        from shapechanger.transfer.learners.sb3 import use_one_thread
        from shapechanger.transfer.learners.student import STUDENT_STEPS, train_student

        if self.learner is not None or self.set or self.tensorboard is not None:
            raise StudyError("A student has no learner of its own: give --teacher without one.")
        steps = STUDENT_STEPS if self.steps is None else self.steps
        out = self.out or Path("results", "policies", env.id.split("/")[-1] + ".safetensors")
        if out.is_dir():
            raise OutputError(f"Cannot write {out}: it is a folder.")
        make_folder(out.parent)
        use_one_thread()
        try:
            with StudyProgress({env.id: steps}) as progress:
                policy = train_student(
                    env,
                    load_policy(teacher),
                    steps,
                    self.seed,
                    on_steps=lambda done: progress(env.id, done, False),
                )
        except KeyboardInterrupt:
            raise Interrupted("Stopped; a training that is cut off leaves no policy.") from None
        policy.described(command=shlex.join(["shapechanger", *sys.argv[1:]])).save(out)
        plain_console().print(f"wrote {out}")


def _learn_to_drive(
    env: EnvRef,
    learner: str,
    settings: CloningSettings,
    steps: int,
    seed: int,
    out: Path,
    show: Callable[[Evaluation], None],
    progress: StudyProgress,
) -> None:
    """Clone the demonstrator of an env, and write the policy and its demonstrations."""
    from shapechanger.transfer.learners import DemonstrationFile
    from shapechanger.transfer.learners.cloning import CloneLearner

    policy = CloneLearner(learner, settings).train(
        env,
        settings.whole_updates(steps),
        seed,
        demonstrations=DemonstrationFile(
            Path("results", "demonstrations", f"{env.id.split('/')[-1]}-{seed}.npz"), seed
        ),
        on_evaluation=show,
        on_steps=lambda done: progress(env.id, done, False),
    )
    policy.described(command=shlex.join(["shapechanger", *sys.argv[1:]])).save(out)


def _require_tensorboard() -> None:
    """Check that TensorBoard is installed.

    Raises:
        MissingExtra: If it is not.
    """
    try:
        import_module("torch.utils.tensorboard")
    except ImportError as error:
        raise MissingExtra("tensorboard", "learn") from error
