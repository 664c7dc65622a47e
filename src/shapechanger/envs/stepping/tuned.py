"""The fast step of ants and single pendulums, bit-equal to Gymnasium's."""

from __future__ import annotations

import ctypes
import hashlib
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from operator import attrgetter
from typing import Any, ClassVar, Final, Literal, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.reshapable import BAD_STATE, Reshapable
from shapechanger.envs.stepping.fast_model import find_fast_model
from shapechanger.morphology.pose import StartRules

# Result of `step`; Gymnasium's own steps promise that they never truncate.
StepResult = tuple[NDArray[np.float64], Any, bool, Literal[False], dict[str, Any]]

NO_WARNINGS: Final = [0, 0, 0]
"""`Binding.warnings` of a simulation that has not diverged."""

_searching: Final = threading.Lock()

Outcomes = tuple[NDArray[np.float64], NDArray[Any], NDArray[np.bool_], dict[str, Any]]
"""Results of one step of n envs of one kind: observations, shape (n, size); rewards and ends, shape
(n,); and one value per env for each key of an info."""


class PausedClock:
    """Steps the physics while MuJoCo's profiling clock is paused, for all threads.

    A step of an ant reads the clock hundreds of times to fill `data.timer`, on which no other
    number depends. `mujoco.set_mjcb_time(None)` installs the clock again, so the pointer to the
    clock is set to None directly. A clock that a user installs is kept.
    """

    def __init__(self, clock: ctypes.c_void_p) -> None:
        self._clock = clock
        self._usual = clock.value
        self._inside = 0
        self._lock = threading.Lock()

    def step(self, model: mujoco.MjModel, data: mujoco.MjData, frame_skip: int) -> None:
        """Step the physics, as `Binding.move` does."""
        with self._lock:
            self._inside += 1
            if self._clock.value == self._usual:
                self._clock.value = None
        try:
            mujoco.mj_step(model, data, frame_skip)
            mujoco.mj_rnePostConstraint(model, data)
        finally:
            with self._lock:
                self._inside -= 1
                if not self._inside and self._clock.value is None:
                    self._clock.value = self._usual


@cache
def paused_clock() -> PausedClock | None:
    """Return MuJoCo's clock if it can be paused; None if a user has installed another."""
    if mujoco.get_mjcb_time() is not None:
        return None
    try:
        bindings = ctypes.CDLL(cast("Any", mujoco)._callbacks.__file__)
        return PausedClock(ctypes.c_void_p.in_dll(bindings, "mjcb_time"))
    except (AttributeError, OSError, ValueError):  # pragma: no cover  # Another MuJoCo build.
        return None


# Arrays closer than this in memory, bytes, are compared together with the bytes between them.
_APART: Final = 64
# Numbers of the options that lie before their first array in memory. A test changes every number of
# a model, so it finds one that is neither here nor between arrays.
_outside: Final = attrgetter(
    *("timestep", "impratio", "tolerance", "ls_tolerance", "noslip_tolerance", "ccd_tolerance"),
    "sleep_tolerance",
)


@dataclass(eq=False)
class Shared:
    """Data that all watches of models with equal digests share.

    Attributes:
        parts: The bytes of each watched region of memory: shared, they stay in the caches of a core
            while many envs compare their models with them.
        steps: Steps that all envs with such a model have taken without a fast model.
        searched: Whether a fast model has been searched.
        fast: The fast model; None if no bit-equal model is known.
    """

    parts: list[bytearray] | None = None
    steps: int = 0
    searched: bool = False
    fast: mujoco.MjModel | None = None


@lru_cache(maxsize=32)
def shared_by(digest: bytes) -> Shared:
    """Return the shared data of models with a digest; a few recent ones are kept."""
    return Shared()


class ModelWatch:
    """Detects whether a model has changed since the watch was created.

    It compares all options and statistics, and the memory of every array except the pixels of
    textures, which do not affect the physics. So no field can be forgotten, and restoring a field
    is detected too. The model is kept alive because the memory of its arrays is read.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self._options = model.opt
        # Options and statistics come first, so that equal models have equal digests wherever they
        # are in memory.
        views = [*_views(sys.maxsize, model.opt, model.stat), *_views(_APART, model)]
        # A bytearray compares itself with any buffer by memcmp; bytes would not.
        parts = [bytearray(view) for view in views]
        self._numbers = _outside(self._options)
        self.timestep = float(self._numbers[0])
        total = hashlib.blake2b(repr(self._numbers).encode(), digest_size=16)
        for part in parts:
            total.update(part)
        self.digest = total.digest()
        self.shared = shared_by(self.digest)
        self.shared.parts = parts = self.shared.parts or parts
        self._parts = list(zip(parts, views, strict=True))

    def unedited(self) -> bool:
        """Return whether every watched number of the model is unchanged, to the last bit."""
        if _outside(self._options) != self._numbers:
            return False
        for before, now in self._parts:  # noqa: SIM110  # `all` takes twice as long.
            if before != now:
                return False
        return True


class Binding:
    """Views of one `MjData`, and the model that steps it.

    Attributes:
        stepping: The model that steps the data: the public model or its fast model.
        has_fast_model: Whether `stepping` is a fast model; None until the search for one.
        dt: Duration of a step while the model is unedited, s.
        warnings: View of MuJoCo's counts of bad positions, velocities and accelerations, (3,).
        kind: One call of `conclude` serves all envs of the same kind; empty for an env that must
            step by itself, None until it is known. It is renewed after each reset.
    """

    def __init__(self, watch: ModelWatch, env: TunedStep) -> None:
        self.watch = watch
        self.unedited = watch.unedited
        self.model = self.stepping = watch.model
        self.data = data = env.data
        self.has_fast_model: bool | None = None
        self.shape = (int(watch.model.nu),)
        self.frame_skip = env.frame_skip
        self.dt = watch.timestep * env.frame_skip
        self.ctrl, self.qpos, self.qvel = data.ctrl, data.qpos, data.qvel
        self.warnings: NDArray[np.int32] = cast("Any", data.warning).number[BAD_STATE]
        self.kind: str | None = None
        self._clock = paused_clock() if env.fast_model else None
        if env.fast_model and watch.shared.fast is not None:
            self.step_with(watch.shared.fast)

    def step_with(self, fast: mujoco.MjModel | None) -> None:
        """Step with a fast model from now on; with None, the public model keeps stepping."""
        self.has_fast_model = fast is not None
        self.stepping = fast or self.model

    def move(self) -> None:
        """Step the physics."""
        if self._clock is not None:
            self._clock.step(self.stepping, self.data, self.frame_skip)
            return
        mujoco.mj_step(self.stepping, self.data, self.frame_skip)
        mujoco.mj_rnePostConstraint(self.stepping, self.data)


class TunedStep(Reshapable):
    """Mixin that speeds up the step of a Gymnasium MuJoCo env, with bit-equal results.

    Once a fast model steps, each step checks that the public `model` is unedited; Gymnasium's own
    methods step an edited one. They also step if `model` has been replaced or its timestep edited,
    or if a method in `replaced` is overridden.

    To step many envs together, call `ready_together` of each env and `remember` of its binding, set
    the controls, call `move` of each binding, and then `conclude` once for all bindings of one
    `kind`. Whether a simulation has diverged is in the `warnings` of its binding.

    Attributes:
        replaced: Methods and properties that `_advance` replaces; `tuned` is the class that it was
            written for.
        patience: Steps with a body, summed over all envs that have it, before a fast model is
            searched. The search takes as long as many steps, so it would not pay off for a body
            that soon changes. Results do not depend on the time of the search.
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
        self._rules = self._bound = None

    def start_rules(self) -> StartRules:
        """Return the rules that make a start pose feasible, for the present model."""
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
        """Return a frame, or None if a window shows it; the env must have been reset."""
        self._require_reset("render")
        return cast("Any", super()).render()

    def step(self, action: Any) -> StepResult:
        """Take one step with an action, shape (nu,), finite; a refused action changes nothing."""
        bound = self._ready()
        return super().step(action) if bound is None else self._advance(bound, action)

    def ready_together(self) -> Any:
        """Return the binding for a step together with other envs; None if `step` must be called."""
        if type(self).step is not TunedStep.step or "step" in vars(self):
            return None  # `step` is overridden.
        bound = self._ready()
        if bound is None:
            return None
        if bound.kind is None:
            bound.kind = self._kind_of(bound)
        return bound if bound.kind else None

    def _kind_of(self, bound: Any) -> str:
        """Return a key of the numbers that `conclude` reads once for all envs; "" to step alone.

        Numbers that `conclude` reads for each env are updated in the binding.
        """
        return ""

    def conclude(
        self,
        bounds: Sequence[Any],
        before: Sequence[Any],
        actions: NDArray[Any],
        out: NDArray[np.float64] | None,
    ) -> Outcomes:
        """Compute the results of envs of this kind after their physics has stepped.

        `before` has the result of `remember` of each binding before the step, and `actions` has a
        row per env. Observations are written into `out` unless it is None.
        """
        raise NotImplementedError

    def _advance(self, bound: Any, action: Any) -> StepResult:
        raise NotImplementedError

    def _ready(self) -> Any:
        """Return the binding to step with; None if Gymnasium's methods must step."""
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
            shared = bound.watch.shared
            shared.steps += 1
            if shared.steps > self.patience and bound.unedited():
                with _searching:  # If several threads have the same body, only one searches.
                    if not shared.searched:
                        shared.fast = find_fast_model(self.model, self.body_spec)
                        shared.searched = True
                bound.step_with(shared.fast)
        # The public model itself steps; of its numbers, the binding has copied only the timestep.
        return bound if bound.dt == self.dt else None

    def _new_binding(self) -> Any:
        """Return a new binding; None if the model or a method in `replaced` was changed."""
        self._require_reset("step")
        self._bound = None
        watch, mine = self._watch, type(self)
        if watch is None or watch.model is not self.model:
            return None
        for name in self.replaced:
            if getattr(mine, name) is not getattr(self.tuned, name) or name in vars(self):
                return None
        self._bound = self.binding(watch, self)
        return self._bound


def _views(apart: int, *owners: Any) -> list[Any]:
    """Return views of the memory of all arrays; arrays closer than `apart` bytes share one."""
    arrays = [getattr(owner, name) for owner in owners for name in _array_names(owner.__class__)]
    # An array that owns its memory is a temporary copy.
    spans = [
        (int(array.ctypes.data), int(array.nbytes))
        for array in arrays
        if array.size and not array.flags.owndata
    ]
    regions: list[tuple[int, int]] = []
    for start, size in sorted(spans):
        if regions and start - sum(regions[-1]) < apart:
            first, former = regions.pop()
            start, size = first, max(former, start + size - first)
        regions.append((start, size))
    return [(ctypes.c_char * size).from_address(start) for start, size in regions]


@cache
def _array_names(kind: type[Any]) -> list[str]:
    """Return the names of the arrays of a kind of object of MuJoCo, except `tex_data`."""
    blank: Any = mujoco.MjSpec().compile() if kind is mujoco.MjModel else kind()
    names = (name for name in dir(kind) if type(getattr(blank, name)) is np.ndarray)
    return [name for name in names if name != "tex_data"]
