"""What the tuned steps of ants and pendulums have in common."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any, ClassVar, Final, Literal, NamedTuple, cast
from weakref import WeakValueDictionary

import gymnasium as gym
import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.reshapable import Reshapable
from shapechanger.envs.stepping.stopwatch import resting_stopwatch
from shapechanger.envs.stepping.twin import demand_for, find_twin, known_twin
from shapechanger.envs.stepping.watch import ModelWatch
from shapechanger.morphology.pose import StartRules

__all__ = ["Binding", "Kind", "Outcomes", "StepResult", "TunedStep"]

# What `step` gives; Gymnasium's own steps promise that they never truncate.
StepResult = tuple[NDArray[np.float64], Any, bool, Literal[False], dict[str, Any]]


class Outcomes(NamedTuple):
    """What n envs of one kind see and are given for a step.

    Attributes:
        observations: Shape (n, size of one).
        rewards: (n,).
        terminated: Whether the step ended the episode of each.
        infos: For each key of an info the value of each env.
        diverged: Places of the envs whose simulation MuJoCo found bad.
    """

    observations: NDArray[np.float64]
    rewards: NDArray[Any]
    terminated: NDArray[np.bool_]
    infos: dict[str, NDArray[Any] | list[Any]]
    diverged: Sequence[int]


# What a step among others relies on.
_COUNTS: Final = frozenset({"model", "data", "frame_skip"})


class Kind:
    """Stands for all that envs must have in common to be concluded together; found by identity."""

    __slots__ = ("__weakref__",)


_kinds: WeakValueDictionary[Hashable, Kind] = WeakValueDictionary()


def _kind(common: Hashable) -> Kind | None:
    return None if common is None else _kinds.setdefault(common, Kind())


class Binding:
    """Views of one `MjData`, and the model that steps it.

    Attributes:
        watch: Watches the public model.
        data: The public data.
        stepping: The model that steps: the public one, or its twin.
        has_twin: Whether it is the twin; else None while nobody has looked for one.
        demand: How much a twin would be used.
        shape: Shape of an action.
        stopwatch: A context in which MuJoCo's stopwatch may rest.
        dt: Time of a step as long as the model is unedited, s.
        trouble: Not 0 where MuJoCo found the pose, the velocity or the acceleration bad, (3,).
        before: What `conclude` needs to know of the time before a step, in arrays of float64.
        after: And of the time after it; items of 8 bytes.
        kind: Envs whose bindings have the same may be concluded together after `ready_together`;
            None for one that steps alone.
        kind_known: Whether the kind has been found out since the last reset.
    """

    def __init__(self, watch: ModelWatch, data: mujoco.MjData, frame_skip: int) -> None:
        model = watch.model
        self.watch = watch
        self.unedited = watch.unedited
        self.model = model
        self.data = data
        self.stepping = model
        self.has_twin: bool | None = None
        self.demand = demand_for(watch)
        self.stopwatch: AbstractContextManager[None] = nullcontext()
        self.shape = (int(model.nu),)
        self.frame_skip = frame_skip
        self.dt = model.opt.timestep * frame_skip
        self.ctrl = data.ctrl
        self.qpos = data.qpos
        self.qvel = data.qvel
        self.trouble = trouble(data)
        self.before: list[NDArray[np.float64]] = []
        self.after: list[NDArray[Any]] = []
        self.kind: Kind | None = None
        self.kind_known = False

    def move(self) -> None:
        """Step the physics alone; to be called with the stopwatch."""
        mujoco.mj_step(self.stepping, self.data, self.frame_skip)
        mujoco.mj_rnePostConstraint(self.stepping, self.data)


def trouble(data: mujoco.MjData) -> NDArray[np.int64]:
    """A view that is not 0 where MuJoCo has found pose, velocity or acceleration bad, (3,).

    Each is the two numbers of an `mjWarningStat`: how often, and where the last time.
    """
    first = int(mujoco.mjtWarning.mjWARN_BADQPOS)
    last = int(mujoco.mjtWarning.mjWARN_BADQACC)
    wheres = cast("Any", data.warning).lastinfo[first : last + 1]
    pairs = np.lib.stride_tricks.as_strided(wheres, (wheres.size, 2), (wheres.strides[0], 4))
    return pairs.reshape(-1).view(np.int64)


class TunedStep(Reshapable):
    """Mixed in before one of Gymnasium's MuJoCo envs: the same step for less.

    Every number that `step` gives is to the last bit the one that Gymnasium's methods would give.
    The public `model` is the one that counts: in every step it is compared with what was compiled,
    and while anything is edited, Gymnasium's own methods step it. Those are also used when a
    subclass overrides one of them, or another model has been put in its place.

    Subclasses implement `_advance`, name in `replaced` what it stands for, and set `tuned`.

    Many envs may be stepped together: each `ready_together`, then the physics of each, then
    `conclude` for all that are of one `kind`. In such a step the model is not compared again: that
    was done at the first step after the reset, and an edit in the middle of an episode counts from
    the next reset on.

    Attributes:
        replaced: Methods and properties that `_advance` does the work of.
        tuned: The class that `_advance` was written for.
        fast_model: Whether a twin of the model, which moves to the last bit like it, may step, and
            MuJoCo's stopwatch may rest.
        patience: Steps with a body, of all envs that have it, before a twin is looked for. To find
            an ant's takes 20 ms, and it saves 0.05 ms in each step: a body that is changed sooner
            would not pay for it. The step at which the twin takes over cannot be seen.
        distrusted: Called whenever a step among others must compare the model again, as after a
            reset.
    """

    replaced: ClassVar[tuple[str, ...]] = ()
    tuned: ClassVar[type[TunedStep]]
    patience: ClassVar[int] = 400

    fast_model: bool = True
    distrusted: tuple[Callable[[], None], ...] = ()
    _bound: Any = None
    _watch: ModelWatch | None = None
    _rules: StartRules | None = None
    _started: bool = False
    _trusted: bool = False

    def _follow_body(self) -> None:
        super()._follow_body()
        self._watch = ModelWatch(self.model)
        self._rules = None
        self._bound = None
        self._distrust()

    def _start_rules(self) -> StartRules:
        watch = self._watch
        if watch is None or watch.model is not self.model or not watch.unedited():
            return super()._start_rules()
        if self._rules is None:
            self._rules = super()._start_rules()
        return self._rules

    def set_state(self, qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> None:
        """Put the body at a pose (nq,) with velocities (nv,)."""
        super().set_state(qpos, qvel)
        self._started = True
        self._distrust()
        if self._bound is not None:
            self._bound.kind_known = False

    def __setattr__(self, name: str, value: Any) -> None:
        """Another model, other data or a longer step in the place of the old one is noticed."""
        super().__setattr__(name, value)
        if name in _COUNTS:
            self._distrust()

    def _distrust(self) -> None:
        """Have a step among others compare the model again."""
        self._trusted = False
        for tell in self.distrusted:
            tell()

    def render(self) -> Any:
        """A frame, or None where a window shows it.

        Raises:
            ResetNeeded: If the env has not been reset.
            RenderError: If nothing can be drawn here.
        """
        self._require_reset("render")
        return cast("Any", super()).render()

    def step(self, action: Any) -> StepResult:
        """Act for one step.

        Args:
            action: Shape (nu,), finite.

        Raises:
            ResetNeeded: If the env has not been reset.
            BadAction: If the action is none; nothing has moved then.
        """
        bound = self._ready()
        if bound is None:
            return super().step(action)
        return self._advance(bound, action, None)

    def step_into(
        self, action: Any, observation: NDArray[np.float64]
    ) -> tuple[Any, bool, bool, dict[str, Any]]:
        """Act for one step, as `step`, and write what is observed; see `Reshapable`."""
        bound = self.ready_together()
        if bound is None:
            return super().step_into(action, observation)
        return self._advance(bound, action, observation)[1:]

    def ready_together(self) -> Any:
        """The binding for a step among others; None where `step` must do it.

        Raises:
            ResetNeeded: If the env has not been reset.
        """
        if self._trusted:
            return self._bound
        if not self._steps_as_written():
            return None
        bound = self._ready()
        if bound is not None:
            if not bound.kind_known:
                bound.kind = _kind(self._kind_of(bound))
                bound.kind_known = True
            self._trusted = bool(bound.has_twin)
        return bound

    def _kind_of(self, bound: Any) -> Hashable:
        """All that `conclude` takes from one env for all of them; None for one that steps alone.

        What it takes from each is brought up to date in the binding.
        """
        return None

    def conclude(
        self, before: NDArray[np.float64], after: NDArray[np.float64], actions: NDArray[Any]
    ) -> Outcomes:
        """What envs of this one's kind see and are given after their physics has stepped.

        Args:
            before: For each env what its binding named under `before`, a row each.
            after: And under `after`.
            actions: What each did, a row each.
        """
        raise NotImplementedError

    def _advance(self, bound: Any, action: Any, out: NDArray[np.float64] | None) -> StepResult:
        """One step, with the observation written to `out` if there is one."""
        raise NotImplementedError

    def _bind(self, watch: ModelWatch) -> Binding:
        """Views of the present data."""
        return Binding(watch, self.data, self.frame_skip)

    def _ready(self) -> Any:
        """The binding to step with; None where Gymnasium's methods must step."""
        bound = self._bound
        if (
            bound is None
            or bound.data is not self.data
            or bound.model is not self.model
            or bound.frame_skip != self.frame_skip
        ):
            bound = self._new_binding()
            if bound is None:
                return None
        if not bound.has_twin:
            if not self.fast_model or bound.has_twin is False:
                return bound if self._fresh(bound) else None
            bound.demand.steps += 1
            if bound.demand.steps <= self.patience:
                return bound if self._fresh(bound) else None
            if not bound.unedited():
                return None
            self._take_twin(bound, find_twin(bound.watch, self.body_spec))
            return bound
        return bound if bound.unedited() else None

    def _fresh(self, bound: Binding) -> bool:
        """Whether what was read from the public model still holds; all else is in its arrays."""
        return bound.dt == self.dt

    def _new_binding(self) -> Any:
        self._require_reset("step")
        watch = self._watch
        self._bound = None
        if watch is None or watch.model is not self.model or not self._is_as_written():
            return None
        bound = self._bound = self._bind(watch)
        if not self.fast_model:
            return bound
        bound.stopwatch = resting_stopwatch()
        if (twin := known_twin(watch)) is not None:
            self._take_twin(bound, twin)
            if not bound.unedited():
                return None
        return bound

    def _is_as_written(self) -> bool:
        """Whether nobody has overridden what `_advance` does the work of."""
        mine, known = type(self), self.tuned
        return all(
            getattr(mine, name) is getattr(known, name) and name not in vars(self)
            for name in self.replaced
        )

    def _steps_as_written(self) -> bool:
        """Whether nobody has overridden `step` itself."""
        return type(self).step is TunedStep.step and "step" not in vars(self)

    @staticmethod
    def _take_twin(bound: Binding, twin: mujoco.MjModel | None) -> None:
        bound.has_twin = twin is not None
        if twin is not None:
            bound.stepping = twin

    def _require_reset(self, word: str) -> None:
        if not self._started:
            raise gym.error.ResetNeeded(
                f"Cannot call env.{word}() before calling env.reset(): "
                f"{type(self).__name__} has no state yet."
            )
