"""The fast step of ants and pendulums: bit-equal to Gymnasium's, with each number computed once."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any, ClassVar, Final, Literal, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.reshapable import BAD_STATE, Reshapable
from shapechanger.envs.stepping.fast_model import find_fast_model
from shapechanger.envs.stepping.watch import ModelWatch
from shapechanger.morphology.pose import StartRules

# Result of `step`; Gymnasium's own steps promise that they never truncate.
StepResult = tuple[NDArray[np.float64], Any, bool, Literal[False], dict[str, Any]]

NO_WARNINGS: Final = [0, 0, 0]
"""`Binding.warnings` of a simulation that has not diverged."""

_searching: Final = threading.Lock()


Outcomes = tuple[NDArray[np.float64], NDArray[Any], NDArray[np.bool_], dict[str, Any]]
"""Results of one step of n envs of one kind: observations, shape (n, size); rewards and ends, shape
(n,); and one value per env for each key of an info."""


class Binding:
    """Views of one `MjData`, and the model that steps it.

    Args:
        watch: Watch of the public model.
        env: The env.

    Attributes:
        model: The public model.
        stepping: The model that steps the data: the public model or its fast model.
        has_fast_model: Whether `stepping` is a fast model; None until one has been looked for.
        shape: Shape of an action.
        dt: Duration of a step while the model is unedited, s.
        warnings: View of MuJoCo's counts of bad positions, velocities and accelerations, (3,).
        kind: Envs with the same kind are concluded together; empty for an env that steps by
            itself, None until it is known. It is renewed after each reset.
    """

    def __init__(self, watch: ModelWatch, env: TunedStep) -> None:
        model, data, frame_skip = watch.model, env.data, env.frame_skip
        self.watch = watch
        self.unedited = watch.unedited
        self.model = model
        self.data = data
        self.stepping = model
        self.has_fast_model: bool | None = None
        self.shape = (int(model.nu),)
        self.frame_skip = frame_skip
        self.dt = watch.timestep * frame_skip
        self.ctrl = data.ctrl
        self.qpos = data.qpos
        self.qvel = data.qvel
        self.warnings: NDArray[np.int32] = cast("Any", data.warning).number[BAD_STATE]
        self.kind: str | None = None

    def step_with(self, fast: mujoco.MjModel | None) -> None:
        """Step with a fast model from now on; with None, the public model keeps stepping."""
        self.has_fast_model = fast is not None
        self.stepping = self.model if fast is None else fast

    def move(self) -> None:
        """Step the physics."""
        mujoco.mj_step(self.stepping, self.data, self.frame_skip)
        mujoco.mj_rnePostConstraint(self.stepping, self.data)


class TunedStep(Reshapable):
    """Mixin that speeds up the step of a Gymnasium MuJoCo env without changing a bit of it.

    Each step compares the public `model` with the compiled one. While it is edited, Gymnasium's own
    methods step it. They also step if a subclass overrides one of the methods in `replaced`, or if
    `model` has been replaced.

    Subclasses implement `_advance`, list in `replaced` what it stands for, and set `tuned` and
    `binding`.

    To step many envs together, call `ready_together` of each, set their controls, call `move` of
    each binding, and then `conclude` once for all bindings of one `kind`. Whether a simulation has
    diverged is in the `warnings` of its binding.

    Attributes:
        replaced: Methods and properties that `_advance` stands for.
        tuned: The class that `_advance` was written for.
        binding: Class of its bindings.
        patience: Steps with a body, summed over all envs that have it, before a fast model is
            looked for. Finding an ant's takes 20 ms and saves 0.05 ms a step, so it would not pay
            for a body that soon changes. Results do not depend on when the fast model takes over.
    """

    replaced: ClassVar[tuple[str, ...]] = ()
    tuned: ClassVar[type[TunedStep]]
    binding: ClassVar[type[Binding]]
    patience: ClassVar[int] = 400

    fast_model: bool = True
    _bound: Any = None
    _watch: ModelWatch | None = None
    _rules: StartRules | None = None

    def _follow_body(self) -> None:
        super()._follow_body()
        self._watch = ModelWatch(self.model)
        self._rules = None
        self._bound = None

    def start_rules(self) -> StartRules:
        """Return the rules that make a start pose feasible, for the model as it is now."""
        watch = self._watch
        if watch is None or watch.model is not self.model or not watch.unedited():
            return super().start_rules()
        if self._rules is None:
            self._rules = super().start_rules()
        return self._rules

    def set_state(self, qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> None:
        """Set the pose (nq,) and the velocities (nv,)."""
        super().set_state(qpos, qvel)
        if self._bound is not None:
            self._bound.kind = None

    def render(self) -> Any:
        """Return a frame, or None where a window shows it.

        Raises:
            ResetNeeded: If the env has not been reset.
            RenderError: If nothing can be drawn here.
        """
        self._require_reset("render")
        return cast("Any", super()).render()

    def step(self, action: Any) -> StepResult:
        """Take one step.

        Args:
            action: Shape (nu,), finite.

        Raises:
            ResetNeeded: If the env has not been reset.
            BadAction: If the action has another shape or is not finite; nothing has moved then.
        """
        bound = self._ready()
        if bound is None:
            return super().step(action)
        return self._advance(bound, action, None)

    def step_into(
        self, action: Any, observation: NDArray[np.float64]
    ) -> tuple[Any, bool, bool, dict[str, Any]]:
        """Take one step and write the observation into an array; see `Reshapable`."""
        bound = self._ready() if self._steps_as_written() else None
        if bound is None:
            return super().step_into(action, observation)
        return self._advance(bound, action, observation)[1:]

    def ready_together(self) -> Any:
        """Return the binding for a step together with other envs; None if `step` must do it.

        Raises:
            ResetNeeded: If the env has not been reset.
        """
        bound = self._ready() if self._steps_as_written() else None
        if bound is None:
            return None
        if bound.kind is None:
            bound.kind = self._kind_of(bound)
        return bound if bound.kind else None

    def _kind_of(self, bound: Any) -> str:
        """Describe all that `conclude` takes from one env for all; empty to step by itself.

        What `conclude` takes from each env is updated in the binding.
        """
        return ""

    def conclude(
        self,
        bounds: Sequence[Any],
        before: Sequence[Any],
        actions: NDArray[Any],
        out: NDArray[np.float64] | None,
    ) -> Outcomes:
        """Compute the results of envs of this one's kind after their physics has stepped.

        Args:
            bounds: The binding of each env.
            before: What `remember` of each binding returned before the step.
            actions: The action of each env, a row each.
            out: Array to write the observations into; None for a new one.
        """
        raise NotImplementedError

    def _advance(self, bound: Any, action: Any, out: NDArray[np.float64] | None) -> StepResult:
        """Take one step, with the observation written to `out` if given."""
        raise NotImplementedError

    def _ready(self) -> Any:
        """Return the binding to step with; None where Gymnasium's methods must step."""
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
        if bound.has_fast_model:
            return bound if bound.unedited() else None
        if bound.has_fast_model is None and self.fast_model:
            snapshot = bound.watch.snapshot
            snapshot.steps += 1
            if snapshot.steps > self.patience and bound.unedited():
                with _searching:  # Of several threads with the same body, one searches.
                    if not snapshot.searched:
                        snapshot.fast = find_fast_model(self.model, self.body_spec)
                        snapshot.searched = True
                bound.step_with(snapshot.fast)
        # Without a fast model the public one steps; only its timestep was copied.
        return bound if bound.dt == self.dt else None

    def _new_binding(self) -> Any:
        self._require_reset("step")
        self._bound = None
        watch = self._watch
        if watch is None or watch.model is not self.model or not self._is_as_written():
            return None
        bound = self._bound = self.binding(watch, self)
        if self.fast_model and watch.snapshot.fast is not None:
            bound.step_with(watch.snapshot.fast)
        return bound

    def _is_as_written(self) -> bool:
        """Return whether none of the methods that `_advance` stands for is overridden."""
        mine, known = type(self), self.tuned
        return all(
            getattr(mine, name) is getattr(known, name) and name not in vars(self)
            for name in self.replaced
        )

    def _steps_as_written(self) -> bool:
        """Return whether `step` itself is not overridden."""
        return type(self).step is TunedStep.step and "step" not in vars(self)
