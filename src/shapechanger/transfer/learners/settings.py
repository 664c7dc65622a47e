"""Settings of the learners of Stable-Baselines3 and rsl-rl."""

from __future__ import annotations

from typing import Any, ClassVar, Final, Literal, Self

import msgspec

from shapechanger.errors import StudyError
from shapechanger.transfer.learners import LearnerSettings, Takes

_RSL: Final = ("rsl-rl-lib", "mujoco-warp", "warp-lang")


class Sb3Settings(LearnerSettings, msgspec.Struct, frozen=True, kw_only=True):
    """Settings that all learners of Stable-Baselines3 share.

    Attributes:
        eval_every: Env steps between two evaluations, at least `update_steps`.
    """

    algorithm: str
    n_envs: int = 1
    net_arch: tuple[int, ...] = (64, 64)
    normalise: bool = False
    steps: int
    source_steps: int = 0
    eval_every: int
    eval_episodes: int = 5

    takes = frozenset[Takes]({"trial", "callback"})
    learner = "shapechanger.transfer.learners.sb3:Sb3Learner"
    last_k = 3
    episode_limit = None
    policy_class: ClassVar[str] = "MlpPolicy"
    """Class of the policies: a name that Stable-Baselines3 defines, or `module:class`."""

    # Name of the setting for the number of steps of each env between two updates.
    _steps_per_update: ClassVar[str]
    # Settings of a subclass that are not arguments of the algorithm's class.
    _ours: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        if min(self.n_envs, self.update_steps, self.eval_episodes) < 1:
            raise StudyError("A learner needs at least one env, one step and one episode.")
        if self.eval_every < self.update_steps:
            raise StudyError(
                f"eval_every must be at least {self.update_steps}, the steps of one update, got "
                f"{self.eval_every}."
            )

    @property
    def update_steps(self) -> int:
        """Env steps between two updates; budgets are rounded up to a multiple of this number."""
        return self.n_envs * getattr(self, self._steps_per_update)

    @property
    def model_arguments(self) -> dict[str, Any]:
        """Arguments of the algorithm's class except policy, env and seed."""
        left_out = {*Sb3Settings.__struct_fields__, *self._ours}
        own = {n: getattr(self, n) for n in self.__struct_fields__ if n not in left_out}
        return {"policy_kwargs": self._policy_arguments(), **own}

    def _policy_arguments(self) -> dict[str, Any]:
        raise NotImplementedError

    def whole_updates(self, steps: int) -> int:
        """Round `steps` up to whole updates."""
        return -(-steps // self.update_steps) * self.update_steps

    def for_one_env(self) -> Self:
        """Return settings for a single env, with the same number of steps per update."""
        changed: dict[str, Any] = {"n_envs": 1, self._steps_per_update: self.update_steps}
        return msgspec.structs.replace(self, **changed)

    def for_model(self) -> Self:
        """Return the settings of the model, which has a single env if worlds are on a device."""
        return self.for_one_env() if "device" in self.takes else self

    def for_budget(self, steps: int) -> Self:
        """Return settings for a shorter budget: four or more evaluations, half of it as source."""
        every = min(self.eval_every, self.whole_updates(steps // 4))
        return msgspec.structs.replace(self, eval_every=every, source_steps=0)

    def rhythm(self) -> str:
        """Return when policies are evaluated, and whether the training data is normalised."""
        seen = (
            "Observations and rewards are normalised for the learner by running estimates of their "
            "standard deviation. Returns in this report never are."
            if self.normalise
            else "Observations and rewards reach the learner as they are."
        )
        return f"{super().rhythm()} {seen}"


class PpoSettings(Sb3Settings, frozen=True, kw_only=True, tag="ppo"):
    """Settings of Stable-Baselines3's PPO, with its names.

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

    takes = Sb3Settings.takes | {"on-policy"}
    _steps_per_update = "n_steps"
    _ours = ("log_std_init",)

    def _policy_arguments(self) -> dict[str, Any]:
        return {
            "net_arch": list(self.net_arch),
            "log_std_init": self.log_std_init,
            # The epsilon is Stable-Baselines3's default for PPO. `foreach` makes fewer calls from
            # Python, with equal results.
            "optimizer_kwargs": {"eps": 1e-5, "foreach": True},
        }


class LimbSettings(PpoSettings, frozen=True, kw_only=True, tag="ppo-limbs"):
    """Settings of PPO with a policy that sees a body as a trunk and limbs.

    Attributes:
        network: "limbs" for a network that fits any number of limbs; "padded" for a plain network
            of `net_arch` on `room` limbs, with zeros for missing limbs.
        room: Number of limbs that have rows; 0 for as many as the bodies have.
    """

    network: Literal["limbs", "padded"] = "limbs"
    room: int = 0

    takes = frozenset[Takes]({"trial", "callback", "many bodies"})
    learner = "shapechanger.transfer.limbs.envs:LimbLearner"
    policy_class = "shapechanger.transfer.limbs.policy:LimbPolicy"
    _ours = (*PpoSettings._ours, "network", "room")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.network == "padded" and self.room < 1:
            raise StudyError("A padded network needs room for limbs, such as --set room=12.")

    def _policy_arguments(self) -> dict[str, Any]:
        policy = super()._policy_arguments()
        return {"hidden": policy.pop("net_arch"), "network": self.network, **policy}


class RslPpoSettings(PpoSettings, frozen=True, kw_only=True, tag="rsl-ppo"):
    """Settings of rsl-rl's PPO on worlds of one device, with Stable-Baselines3's names.

    Attributes:
        device: Name of the device, such as `cuda:0` or `cpu`; empty for the first GPU, or the CPU
            if there is no GPU.
    """

    device: str = ""

    takes = frozenset[Takes]({"trial", "device"})
    learner = "shapechanger.transfer.learners.rsl:RslLearner"
    packages = _RSL
    _ours = (*PpoSettings._ours, "device")


class RslLimbSettings(LimbSettings, frozen=True, kw_only=True, tag="rsl-limbs"):
    """Settings of rsl-rl's PPO with a policy of limbs, on worlds of one device.

    Attributes:
        device: Name of the device, see `RslPpoSettings`.
    """

    device: str = ""

    takes = frozenset[Takes]({"trial", "device", "many bodies"})
    learner = "shapechanger.transfer.limbs.device:RslLimbLearner"
    packages = _RSL
    _ours = (*LimbSettings._ours, "device")


class OffPolicySettings(Sb3Settings, frozen=True, kw_only=True, tag="off-policy"):
    """Settings of SAC of Stable-Baselines3, or TQC of sb3-contrib, with their names.

    Attributes:
        algorithm: SAC or TQC.
        net_arch: Widths of the hidden layers of the actor, and of each critic.
        learning_rate: Learning rate of Adam.
        batch_size: Transitions in a batch.
        buffer_size: Transitions that the replay buffer keeps.
        learning_starts: Env steps before the first update, with random actions or, in transfer,
            with the transplanted policy's actions.
        train_freq: Steps of each env between two updates.
        gradient_steps: Gradient steps of an update; -1 for as many as env steps.
        gamma: Discount.
        tau: Coefficient of the soft update of the target critics at each gradient step.
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

    takes = Sb3Settings.takes | {"off-policy"}
    _steps_per_update = "train_freq"

    def _policy_arguments(self) -> dict[str, Any]:
        return {"net_arch": list(self.net_arch), "optimizer_kwargs": {"foreach": True}}


class ImportedSettings(Sb3Settings, frozen=True, kw_only=True, tag="imported"):
    """Settings of any class that is compatible with Stable-Baselines3, or of a function.

    Attributes:
        algorithm: The class as `module:Class`, called as `Class("MlpPolicy", envs, seed=seed,
            device="cpu", tensorboard_log=folder, **arguments)`; or a function
            `module:function(envs, seed, **arguments)` that returns a model.
        steps_per_update: Steps of each env between two updates, which the class calls `n_steps` or
            `train_freq`.
        arguments: Arguments of the class or function.
    """

    algorithm: str
    steps_per_update: int = 1
    steps: int = 100_000
    eval_every: int = 10_000
    arguments: dict[str, Any] = {}

    _steps_per_update = "steps_per_update"

    @property
    def model_arguments(self) -> dict[str, Any]:
        """Arguments of the class or function except policy, env and seed."""
        return self.arguments

    def for_one_env(self) -> Self:
        """Return the settings; StudyError unless they already have a single env."""
        if self.n_envs > 1:
            raise StudyError(
                f"Only one instance of this env can exist: set n_envs=1, not {self.n_envs}."
            )
        return self


def study_budgets(
    settings: LearnerSettings, steps: int | None, source_steps: int | None, *, is_given: bool
) -> tuple[int, int]:
    """Return the budgets in the target and in the source, as whole updates."""
    wanted = settings.steps if steps is None else steps
    settings.require_budget(wanted, "target")
    budget = settings.whole_updates(wanted)
    before = source_steps
    if before is None:
        before = settings.source_steps or settings.whole_updates(budget // 2)
    if not is_given or source_steps:
        settings.require_budget(before, "source")
    return budget, settings.whole_updates(before)
