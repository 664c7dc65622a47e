"""Learner settings: Stable-Baselines3's, cloning, and SAC from a camera; the shipped sets."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, Final, Literal, Self, TypeVar

import msgspec

from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.errors import StudyError, UnknownName
from shapechanger.transfer.files import place_of


class _Sb3Base(msgspec.Struct, frozen=True, kw_only=True):
    """Settings that all learners of Stable-Baselines3 share.

    Attributes:
        algorithm: The class that learns: "PPO", "SAC", "TQC", or `module:name`.
        n_envs: Number of parallel envs.
        net_arch: Widths of the hidden layers, of actor and critic each.
        normalise: Whether observations and rewards are divided by running estimates of their
            standard deviation (`VecNormalize`).
        steps: Default env steps of a training.
        source_steps: Default env steps of a source policy; 0 for half as many as on the target, so
            that total steps leave something to compare.
        eval_every: Target steps between two evaluations, at least `update_steps`.
        eval_episodes: Episodes of an evaluation, with the policy's mean actions.
    """

    algorithm: str
    n_envs: int = 1
    net_arch: tuple[int, ...] = (64, 64)
    normalise: bool = False
    steps: int
    source_steps: int = 0
    eval_every: int
    eval_episodes: int = 5

    # Name of the setting that is the steps of each env between two updates.
    _steps_per_update: ClassVar[str]

    def __post_init__(self) -> None:
        if min(self.n_envs, self.update_steps, self.eval_episodes) < 1:
            raise StudyError("A learner needs at least one env, one step and one episode.")
        if self.eval_every < self.update_steps:
            raise StudyError(
                f"An evaluation every {self.eval_every} steps is more often than an update, "
                f"which takes {self.update_steps}."
            )

    @property
    def update_steps(self) -> int:
        """Env steps between two updates; budgets are rounded up to a multiple of it."""
        return self.n_envs * getattr(self, self._steps_per_update)

    @property
    def model_arguments(self) -> dict[str, Any]:
        """Arguments of the class besides policy, env and seed."""
        raise NotImplementedError

    @property
    def last_k(self) -> int:
        """Number of final evaluations that count as the end of a run."""
        return 3

    @property
    def episode_limit(self) -> int | None:
        """Steps after which an evaluation episode is truncated; None for the env's own limit."""
        return None

    def whole_updates(self, steps: int) -> int:
        """Round `steps` up to whole updates."""
        return -(-steps // self.update_steps) * self.update_steps

    def for_one_env(self) -> Self:
        """Return settings with as many steps per update in a single env.

        Raises:
            StudyError: If that is not possible.
        """
        changed: dict[str, Any] = {"n_envs": 1, self._steps_per_update: self.update_steps}
        return msgspec.structs.replace(self, **changed)

    def for_budget(self, steps: int) -> Self:
        """Return the settings for a shorter budget: four evaluations, no source default."""
        every = min(self.eval_every, self.whole_updates(steps // 4))
        return msgspec.structs.replace(self, eval_every=every, source_steps=0)

    def _own(self) -> dict[str, Any]:
        """The settings that not all learners share, by name."""
        shared = _Sb3Base.__struct_fields__
        return {name: getattr(self, name) for name in self.__struct_fields__ if name not in shared}


class PpoSettings(_Sb3Base, frozen=True, kw_only=True, tag="ppo"):
    """Settings of Stable-Baselines3's PPO, under its names.

    Attributes:
        n_steps: Steps of each env between two updates.
        batch_size: Steps in a minibatch.
        n_epochs: Passes over the steps of an update.
        learning_rate: Learning rate of Adam.
        gamma: Discount.
        gae_lambda: Lambda of generalised advantage estimation.
        clip_range: Clipping range of the policy ratio.
        ent_coef: Weight of the entropy.
        log_std_init: Initial logarithm of the standard deviation of the actions.
    """

    algorithm: Literal["PPO"] = "PPO"
    n_steps: int
    batch_size: int
    n_epochs: int
    learning_rate: float
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    ent_coef: float = 0.0
    log_std_init: float = 0.0

    _steps_per_update = "n_steps"

    @property
    def model_arguments(self) -> dict[str, Any]:
        """Arguments of the class besides policy, env and seed."""
        arguments = self._own()
        arguments["policy_kwargs"] = {
            "net_arch": list(self.net_arch),
            "log_std_init": arguments.pop("log_std_init"),
            # Stable-Baselines3's own epsilon for PPO; `foreach` makes fewer calls from Python, for
            # equal numbers.
            "optimizer_kwargs": {"eps": 1e-5, "foreach": True},
        }
        return arguments


class RslPpoSettings(PpoSettings, frozen=True, kw_only=True, tag="rsl-ppo"):
    """Settings of rsl-rl's PPO on worlds of one device, under Stable-Baselines3's names.

    Attributes:
        device: Name of the device, such as `cuda:0` or `cpu`; empty for the first GPU, or the CPU
            where there is none.
    """

    device: str = ""

    @property
    def model_arguments(self) -> dict[str, Any]:
        """Arguments of Stable-Baselines3's class, which holds the policy between updates."""
        arguments = super().model_arguments
        del arguments["device"]
        return arguments


class OffPolicySettings(_Sb3Base, frozen=True, kw_only=True, tag="off-policy"):
    """Settings of SAC of Stable-Baselines3, or TQC of sb3-contrib, under their names.

    Attributes:
        algorithm: SAC or TQC.
        net_arch: Widths of the hidden layers, of actor and critics each.
        learning_rate: Learning rate of Adam.
        batch_size: Transitions in a batch.
        buffer_size: Transitions that the replay buffer keeps.
        learning_starts: Env steps before the first update, with random actions. A transplanted
            policy acts itself in these.
        train_freq: Steps of each env between two updates.
        gradient_steps: Gradient steps of an update; -1 for as many as env steps.
        gamma: Discount.
        tau: Share of the critics that moves into their targets at each gradient step.
        ent_coef: Weight of the entropy; "auto" to learn it.
    """

    algorithm: Literal["SAC", "TQC"]
    net_arch: tuple[int, ...] = (256, 256)
    learning_rate: float = 3e-4
    batch_size: int = 256
    buffer_size: int = 1_000_000
    learning_starts: int = 10_000
    train_freq: int = 1
    gradient_steps: int = -1
    gamma: float = 0.99
    tau: float = 0.005
    ent_coef: float | str = "auto"

    _steps_per_update = "train_freq"

    @property
    def model_arguments(self) -> dict[str, Any]:
        """Arguments of the class besides policy, env and seed."""
        policy = {"net_arch": list(self.net_arch), "optimizer_kwargs": {"foreach": True}}
        return {"policy_kwargs": policy, **self._own()}


class ImportedSettings(_Sb3Base, frozen=True, kw_only=True, tag="imported"):
    """Settings of any class that is compatible with Stable-Baselines3, or of a function.

    Attributes:
        algorithm: The class as `module:Class`, called as `Class("MlpPolicy", envs, seed=seed,
            **arguments)`; or a function `module:function(envs, seed, **arguments)` that returns a
            model.
        steps_per_update: Steps of each env between two updates, which the class calls `n_steps` or
            `train_freq`.
        arguments: Its arguments.
    """

    algorithm: str
    steps_per_update: int = 1
    steps: int = 100_000
    eval_every: int = 10_000
    arguments: dict[str, Any] = {}

    _steps_per_update = "steps_per_update"

    @property
    def model_arguments(self) -> dict[str, Any]:
        """Arguments of the class or function besides policy, env and seed."""
        return self.arguments

    def for_one_env(self) -> Self:
        """Refuse more than one env: the argument that sets the steps of an update is not known."""
        if self.n_envs > 1:
            raise StudyError(
                f"Only one instance of this env can exist: set n_envs=1, not {self.n_envs}."
            )
        return self


class CloningSettings(msgspec.Struct, frozen=True, kw_only=True, tag="cloning"):
    """Settings of behavioural cloning, in which a step is a demonstrated step.

    Attributes:
        budgets: Numbers of demonstrated steps; a policy is trained on each, from the same start.
        episode_steps: Steps of a demonstration; the next begins on another course.
        eval_episodes: Episodes of an evaluation.
        eval_steps: Steps of each of them.
        clone: Settings of each training.
    """

    budgets: tuple[int, ...]
    episode_steps: int
    eval_episodes: int
    eval_steps: int
    clone: CloneSettings = CloneSettings()

    def __post_init__(self) -> None:
        if self.eval_episodes < 1 or min(self.episode_steps, self.eval_steps) < 1:
            raise StudyError("A learner needs at least one episode, of at least one step.")
        if (
            not self.budgets
            or self.budgets[0] < 1
            or any(a >= b for a, b in pairwise(self.budgets))
        ):
            raise StudyError(f"Budgets are numbers of steps that grow, got {self.budgets}.")

    @property
    def steps(self) -> int:
        """Default number of demonstrated steps."""
        return self.budgets[-1]

    @property
    def eval_every(self) -> int:
        """The first budget; later ones are farther apart."""
        return self.budgets[0]

    def whole_updates(self, steps: int) -> int:
        """Round `steps` up to a budget; the largest if all are smaller."""
        return next((budget for budget in self.budgets if budget >= steps), self.budgets[-1])

    @property
    def last_k(self) -> int:
        """Number of final evaluations that count: each one is of another clone."""
        return 1

    @property
    def episode_limit(self) -> int | None:
        """Steps after which an evaluation episode is truncated; None for the env's own limit."""
        return self.eval_steps

    @property
    def source_steps(self) -> int:
        """Default steps of a source policy: none of its own."""
        return 0

    def for_budget(self, steps: int) -> CloningSettings:
        """Return the settings for a shorter budget: the same."""
        return self

    def within(self, steps: int) -> tuple[int, ...]:
        """Return the budgets up to `steps`."""
        return tuple(budget for budget in self.budgets if budget <= steps)


Sb3Settings = PpoSettings | RslPpoSettings | OffPolicySettings | ImportedSettings
"""The settings of any learner of Stable-Baselines3."""

Settings = Sb3Settings | CloningSettings
"""The settings of any learner."""

_Kind = TypeVar("_Kind", bound=msgspec.Struct)


def require_budget(steps: int, settings: Settings, which: str = "") -> None:
    """Refuse a budget that ends before the first evaluation.

    Args:
        steps: The budget.
        settings: Settings of the learner.
        which: "target" or "source", where there are two budgets.

    Raises:
        StudyError: If it does.
    """
    if steps < settings.eval_every:
        budget = f"{steps} {which} steps" if which else f"{steps} steps"
        raise StudyError(
            f"A budget of {budget} is smaller than one evaluation, which comes every "
            f"{settings.eval_every} steps: give at least that."
        )


# Tuned on the reaching finger only: each of four seeds ends with 200 of 200
# targets reached (`python -m benchmarks.run finger-learned`).
_FINGER: Final = PpoSettings(
    n_envs=16,
    n_steps=128,
    batch_size=256,
    n_epochs=10,
    learning_rate=5e-4,
    gamma=0.95,
    gae_lambda=0.9,
    log_std_init=-0.5,
    net_arch=(128, 128),
    normalise=True,
    steps=307_200,
    eval_every=30_720,
    eval_episodes=20,
)

# `ppo-balance` was tuned on InvertedPendulum and BigInvertedPendulum: within 24,576 steps the
# latter ends at 1,000 on 5 of 5 seeds (benchmarks/results/demo.json). SmallInvertedPendulum is
# harder: both of two seeds reach 1,000, and one has dropped to 744 at the end.
# `ppo-run` was tuned on the ant, seed 0: three seeds walk at 2.1, 2.0 and 1.5 m/s after 1,048,576
# steps (the sources in benchmarks/results/atlas-ants-runs.json). `ppo-planar` has four times as
# many updates and more exploration noise at the start, with which half cheetahs end lower. The
# results are in `transfer/references`, and the reasons in docs/decisions.md.
LEARNERS: Final[dict[str, Settings]] = {
    "ppo-balance": PpoSettings(
        n_envs=16,
        n_steps=64,
        batch_size=128,
        n_epochs=10,
        learning_rate=1e-3,
        steps=24_576,
        eval_every=3072,
    ),
    "ppo-run": PpoSettings(
        n_envs=64,
        n_steps=128,
        batch_size=2048,
        n_epochs=10,
        learning_rate=3e-4,
        log_std_init=-1.0,
        normalise=True,
        steps=1_048_576,
        eval_every=65_536,
    ),
    # The numbers of `ppo-run`, for which no GPU was there to tune others.
    "rsl-ppo": RslPpoSettings(
        n_envs=64,
        n_steps=128,
        batch_size=2048,
        n_epochs=10,
        learning_rate=3e-4,
        log_std_init=-1.0,
        normalise=True,
        steps=1_048_576,
        eval_every=65_536,
    ),
    "ppo-planar": PpoSettings(
        n_envs=16,
        n_steps=128,
        batch_size=256,
        n_epochs=10,
        learning_rate=3e-4,
        normalise=True,
        steps=1_048_576,
        eval_every=65_536,
    ),
    # A humanoid takes actions up to 0.4, so it explores with less noise, in smaller batches: it
    # ends at 653, and with `ppo-run` at 468. With both it falls after two seconds, before it walks.
    "ppo-humanoid": PpoSettings(
        n_envs=16,
        n_steps=256,
        batch_size=256,
        n_epochs=5,
        learning_rate=1e-4,
        gae_lambda=0.9,
        log_std_init=-2.0,
        net_arch=(256, 256),
        normalise=True,
        steps=524_288,
        eval_every=65_536,
    ),
    # A swimming stroke takes longer than a stride, so the discount is closer to 1.
    "ppo-swim": PpoSettings(
        n_envs=16,
        n_steps=512,
        batch_size=512,
        n_epochs=10,
        learning_rate=6e-4,
        gamma=0.9999,
        gae_lambda=0.98,
        normalise=True,
        steps=1_048_576,
        eval_every=65_536,
    ),
    "ppo-finger": _FINGER,
    # Ten minutes of motion of the rig; source steps are simulated, and so cheap.
    "ppo-rig": msgspec.structs.replace(
        _FINGER, steps=30_720, source_steps=307_200, eval_every=6144
    ),
    "ppo-drive": PpoSettings(
        n_envs=16,
        n_steps=128,
        batch_size=256,
        n_epochs=10,
        learning_rate=3e-4,
        log_std_init=-0.5,
        normalise=True,
        steps=81_920,
        eval_every=20_480,
    ),
    # Half a minute, and 1, 2, 5 and 10 minutes, at 20 steps a second.
    "cloning": CloningSettings(
        budgets=(600, 1200, 2400, 6000, 12_000),
        episode_steps=200,  # So that half a minute already covers three courses.
        eval_episodes=4,
        eval_steps=400,
        # Early stopping on few held-out pictures is unreliable: it stopped after 150 steps.
        clone=CloneSettings(held_out=0.0),
    ),
    # 5, 15, 30 and 60 s of a target, and 6 minutes of a source. Each evaluation is of about 500 m,
    # so that a collision more or less decides nothing.
    "waypoint": CloningSettings(
        budgets=(100, 300, 600, 1200, 7200),
        episode_steps=200,
        eval_episodes=12,
        eval_steps=500,
        # A share of 0.5 or 0.8 of the source's demonstrations drives alike: docs/vehicles.md.
        clone=CloneSettings(held_out=0.0, passes=50.0, most_steps=3000, rehearsal=0.5),
    ),
    # Small networks and few random steps: a pole of 0.6 m is balanced after 12,000 steps.
    "sac-balance": OffPolicySettings(
        algorithm="SAC",
        net_arch=(64, 64),
        learning_rate=1e-3,
        batch_size=128,
        buffer_size=100_000,
        learning_starts=1000,
        steps=16_000,
        source_steps=16_000,
        eval_every=2000,
    ),
    # The settings that the papers of SAC and TQC share, and Stable-Baselines3's defaults.
    "sac": OffPolicySettings(algorithm="SAC", steps=200_000, eval_every=20_000),
    "tqc": OffPolicySettings(algorithm="TQC", steps=200_000, eval_every=20_000),
}


TUNED_ON: Final[dict[str, tuple[str, ...]]] = {
    "ppo-balance": ("InvertedPendulum", "BigInvertedPendulum", "SmallInvertedPendulum"),
    "ppo-run": ("Ant", "AmputatedAnt", "BigAnt", "ExtendedAnt", "HalfCheetah"),
    "ppo-swim": ("Swimmer",),
    "ppo-planar": ("Hopper", "Walker2d", "InvertedDoublePendulum"),
    "ppo-humanoid": ("Humanoid",),
    "ppo-finger": ("Finger", "FingerTrack"),
    "ppo-rig": ("Finger",),
    "ppo-drive": ("CarRanges",),
    "cloning": ("Car", "Tank", "Truck", "Boat"),
    "waypoint": ("CarWaypoint", "TankWaypoint", "TruckWaypoint"),
    "sac-balance": ("InvertedPendulum",),
    "rsl-ppo": (),
    "sac": (),
    "tqc": (),
}
"""The envs that the settings of each learner were tuned on.

Settings count as tuned on another body of the same family if a policy that ships, or a benchmark,
reached its target there with them as they are: `shapechanger policies list --references`, and the
rows `finger-learned`, `vehicles-clone` and `vehicles-waypoints`.
"""


def tuning_text(learner: str, env: str) -> str:
    """State whether the settings of a learner were tuned on an env.

    Args:
        learner: Name of the learner.
        env: Id of the env.
    """
    if not TUNED_ON.get(learner):
        return "It is not stated what these settings were tuned on."
    name = env.rpartition("/")[2].removesuffix("-v1")
    *first, last = TUNED_ON[learner]
    tuned = f"{', '.join(first)} and {last}" if first else last
    if name in TUNED_ON[learner]:
        return f"The settings were tuned on {tuned}."
    return f"The settings were tuned on {tuned}, not on {name}."


def learner_settings(name: str) -> Settings:
    """Return the shipped settings of a learner.

    Raises:
        UnknownName: If no learner has this name.
    """
    if name not in LEARNERS:
        raise UnknownName("learner", name, LEARNERS)
    return LEARNERS[name]


def resolve_learner(learner: str, changed: Mapping[str, Any]) -> tuple[str, Settings]:
    """Return the name and the settings of a learner, with some of them replaced.

    Args:
        learner: Name of shipped settings; a TOML file; or `module:name`, a class of models that is
            compatible with Stable-Baselines3, or a function that builds one.
        changed: New values by name, as TOML or JSON hold them. With `module:name`, those that are
            no settings of ours are arguments of the class or function.

    Raises:
        UnknownName: If there is no such learner, or it has no such setting.
        StudyError: If a value is of the wrong type, or impossible, or the file cannot be read.
    """
    if learner.endswith(".toml"):
        return _read_learner(Path(learner), changed)
    if ":" in learner:
        return learner, _imported(learner, changed)
    return learner, _changed(learner, learner_settings(learner), changed)


def _read_learner(path: Path, changed: Mapping[str, Any]) -> tuple[str, Settings]:
    """Read a TOML file that names a preset or an algorithm, and changes some of its settings."""
    try:
        text = path.read_text(encoding="utf-8")
        given = tomllib.loads(text)
    except FileNotFoundError:
        raise UnknownName("learner", str(path), LEARNERS) from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise StudyError(f"The learner {path} cannot be read: {error}.") from error
    start = given.pop("preset", None) or given.pop("algorithm", None)
    if not isinstance(start, str) or start.endswith(".toml"):
        raise StudyError(
            f"{path} must name what it starts from: `preset` is one of {', '.join(LEARNERS)}, or "
            "`algorithm` is a class or function as module:name."
        )
    try:
        _, settings = resolve_learner(start, {**given, **changed})
    except (StudyError, UnknownName) as error:
        raise StudyError(f"{path}{place_of(text, error)}: {error}") from error
    return path.stem, settings


def _imported(algorithm: str, changed: Mapping[str, Any]) -> Settings:
    from shapechanger.transfer.learners.algorithms import checked_settings

    ours = {field.name for field in msgspec.structs.fields(ImportedSettings)}
    own = {name: value for name, value in changed.items() if name in ours}
    own["arguments"] = {name: value for name, value in changed.items() if name not in ours}
    return checked_settings(
        _converted(algorithm, ImportedSettings, {"algorithm": algorithm, **own})
    )


def _changed(name: str, settings: Settings, changed: Mapping[str, Any]) -> Settings:
    known: dict[str, Any] = msgspec.structs.asdict(settings)
    for setting in changed:
        if setting not in known:
            raise UnknownName(f"setting of {name}", setting, known)
    values: dict[str, Any] = {**msgspec.to_builtins(settings), **changed}
    return _converted(name, type(settings), values)


def _converted(name: str, kind: type[_Kind], values: dict[str, Any]) -> _Kind:
    try:
        return msgspec.convert(values, kind, strict=True)
    except msgspec.ValidationError as error:
        raise StudyError(f"The settings of {name} are wrong: {str(error).rstrip('.')}.") from None
