"""A vector env that steps its envs with a few threads."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager, nullcontext
from typing import Any, cast

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, create_empty_array
from numpy.typing import NDArray

from shapechanger.envs.checks import (
    check_actions,
    masked_options,
    one_seed_each,
    require_same_boxes,
)
from shapechanger.envs.vector.results import StepResults, SubEnv, batched, in_columns
from shapechanger.envs.vector.threads import EnvThreads
from shapechanger.errors import VectorEnvError

_Floats = NDArray[np.float64]
_Bools = NDArray[np.bool_]


class ThreadVectorEnv(VectorEnv[NDArray[Any], NDArray[Any], NDArray[Any]]):
    """Envs that are stepped together, with the results of Gymnasium's `SyncVectorEnv`.

    MuJoCo steps outside Python's lock, so threads share the cores; each has a range of neighbouring
    envs. Observations, rewards, ends and infos equal `SyncVectorEnv`'s to the last bit, with
    any number of threads and after any edit of an env's model. It differs in two ways: actions are
    checked before any env steps, and an env whose simulation diverges is terminated with
    `info["diverged"]` (see `SubEnv`).

    If an env raises, the others finish the step; on Ctrl-C, the threads finish it. The envs are
    then no longer at the same step, so the next call must be `reset` or `close`.

    `shapechanger.make_vec` makes it.

    Args:
        makers: One function per env that makes it; all envs have the same Box spaces.
        threads: Number of threads, including the caller's; at least 1. With
            `render_mode="human"` it is 1, because one thread must draw all windows.
        autoreset_mode: When to reset an env whose episode has ended; see Gymnasium's documentation.
        copy: Whether to return copies of the observations; otherwise the next step overwrites them.

    Attributes:
        envs: The envs.

    Raises:
        VectorEnvError: If there are no envs or no threads, or a space is not a Box.
        SpaceMismatch: If the spaces of two envs differ.
    """

    envs: list[gym.Env[Any, Any]]
    observation_space: gym.Space[Any]
    action_space: gym.Space[Any]
    single_observation_space: gym.Space[Any]
    single_action_space: gym.Space[Any]

    def __init__(
        self,
        makers: Sequence[Callable[[], gym.Env[Any, Any]]],
        *,
        threads: int = 1,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
        copy: bool = True,
    ) -> None:
        if not makers:
            raise VectorEnvError("A vector env needs at least one env, got 0.")
        if threads < 1:
            raise VectorEnvError(f"A vector env needs at least one thread, got {threads}.")
        self.copy = copy
        self.autoreset_mode = self._mode = autoreset_mode
        self.envs = []
        try:
            for maker in makers:
                self.envs.append(maker())
            require_same_boxes(self.envs)
        except BaseException:
            for env in self.envs:
                env.close()
            raise
        first = self.envs[0]
        self.num_envs = len(self.envs)
        self.render_mode = first.render_mode
        self.metadata = {**first.metadata, "autoreset_mode": autoreset_mode}
        self.single_observation_space = first.observation_space
        self.single_action_space = first.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._action_shape = cast("tuple[int, ...]", self.single_action_space.shape)
        self._observations = cast("Any", create_empty_array)(first.observation_space, self.num_envs)
        self._subs = [*map(SubEnv, self.envs, self._observations)]
        self._ended = np.zeros(self.num_envs, np.bool_)
        self._awaits_reset = True
        self.threads = 1 if self.render_mode == "human" else min(threads, self.num_envs)
        self._threads = EnvThreads(self.threads, self.num_envs)
        # Ends the threads of a vector env that is never closed, at the latest at exit.
        weakref.finalize(self, self._threads.stop)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Start an episode in each env.

        Args:
            seed: A number, which is the seed of the first env and counts up from there; or one seed
                or None per env. None continues with the present generators.
            options: Passed to each env. `reset_mask`, an array of one boolean per env, selects the
                envs to reset; the others are unchanged.

        Returns:
            The observations of all envs, and the infos of the envs that were reset.

        Raises:
            VectorEnvError: If there are not as many seeds as envs.
            ResetNeeded: If the mask leaves out envs before the first reset or after a failed step.
            TypeError: If the mask is not an array of booleans.
            ValueError: If the mask has another shape, or is all false.
        """
        mask, options = masked_options(options, self.num_envs)
        if mask is not None and self._awaits_reset and not mask.all():
            raise gym.error.ResetNeeded("No episode is under way: call `reset` without a mask.")
        chosen = None if mask is None else np.flatnonzero(mask).tolist()
        seeds = one_seed_each(seed, self.num_envs)
        observations, infos = self.reset_each(seeds, [options] * self.num_envs, chosen)
        return observations, batched(self, in_columns(dict(enumerate(infos))))

    def reset_each(
        self,
        seeds: Sequence[int | None],
        options: Sequence[dict[str, Any] | None],
        chosen: Iterable[int] | None = None,
    ) -> tuple[NDArray[Any], list[dict[str, Any]]]:
        """Start an episode in each env, or in the `chosen` ones, as `reset` does.

        Returns:
            The observations of all envs, and the info of each, empty if it was not reset.
        """
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        numbers = list(range(self.num_envs) if chosen is None else chosen)
        changes_bodies = any(given and "body" in given for given in options)
        # Only one thread at a time may compile a body and replace its renderer.
        compiling = threading.Lock() if changes_bodies else nullcontext()

        def start(i: int) -> None:
            with compiling:
                infos[i] = self._subs[i].reset(seeds[i], options[i])

        with self._stepping():
            if changes_bodies:
                self._at_home(start, numbers)
            else:
                self._threads.do(start, numbers)
        self._ended[numbers] = False
        return self._present_observations(), infos

    def step(self, actions: Any) -> tuple[NDArray[Any], _Floats, _Bools, _Bools, dict[str, Any]]:
        """Take one step in each env.

        Args:
            actions: One action per env; their precision is kept.

        Raises:
            BadAction: If an action has another shape or is not finite; then no env has stepped.
            ResetNeeded: If an env must be reset first.
            ClosedEnvironmentError: If the vector env is closed.
        """
        observations, results = self.step_each(actions)
        ends = results.terminated, results.truncated
        return observations, results.rewards, *ends, results.batched(self)

    def step_each(self, actions: Any) -> tuple[NDArray[Any], StepResults]:
        """Take one step as `step` does; return observations, and results with an info per env."""
        self._require_open()
        waits = self._mode is AutoresetMode.NEXT_STEP
        waiting = self._ended if waits else np.zeros(self.num_envs, np.bool_)
        given = check_actions(actions, self.num_envs, self._action_shape, waiting)
        if self._awaits_reset:
            raise gym.error.ResetNeeded("These envs are not at the same step: call `reset` first.")
        if self._mode is AutoresetMode.DISABLED and self._ended.any():
            numbers = ", ".join(str(i) for i in np.flatnonzero(self._ended))
            raise gym.error.ResetNeeded(
                f"The episodes of envs {numbers} have ended, and this mode does not reset them: "
                "call `reset` with options={'reset_mask': terminations | truncations}."
            )
        results = StepResults(self.num_envs)
        with self._stepping():
            self._advance(given, waiting.tolist(), results)
        self._ended = results.terminated | results.truncated
        return self._present_observations(), results

    def _advance(self, actions: NDArray[Any], waiting: list[bool], results: StepResults) -> None:
        """Reset the envs that wait for a reset, and step the others.

        Envs whose physics can be stepped separately step their physics first; their results are
        computed together when all threads are done. The other envs take their whole step.
        """
        # For each env whose physics has stepped: its binding, and its state before the physics.
        moved: list[Any] = [None] * self.num_envs

        def advance(i: int) -> None:
            sub = self._subs[i]
            if waiting[i]:
                results.put(i, (0.0, False, False, sub.reset()))
                return
            bound = None if sub.tuned is None else sub.tuned.ready_together()
            if bound is None:
                results.put(i, sub.step(actions[i]))
                return
            moved[i] = bound, bound.remember()
            bound.ctrl[:] = actions[i]
            bound.move()

        # Envs that may draw must stay in their thread.
        others = [i for i, sub in enumerate(self._subs) if sub.tuned is None]
        tuned = [i for i, sub in enumerate(self._subs) if sub.tuned is not None]
        self._threads.do(advance, others, anywhere=tuned)
        kinds: dict[str, list[int]] = {}
        for i, one in enumerate(moved):
            if one is not None:
                kinds.setdefault(one[0].kind, []).append(i)
        diverged: set[int] = set()
        for numbers in kinds.values():
            diverged.update(self._conclude(numbers, moved, actions, results))
        # Observations that are not finite end episodes, even without a warning of MuJoCo.
        finite = np.isfinite(self._observations)
        if not np.logical_and.reduce(finite, axis=None):
            rows = finite.reshape(self.num_envs, -1).all(axis=1)
            diverged.update(np.flatnonzero(~rows).tolist())
        for i in diverged:
            info = results.of_each()[i]
            results.put(i, self._subs[i].diverged(bool(results.truncated[i]), info))
        if self._mode is AutoresetMode.SAME_STEP:

            def restart(i: int) -> None:
                sub = self._subs[i]
                results.restarts[i] = sub.row.copy(), sub.reset()

            ended = np.flatnonzero(results.terminated | results.truncated).tolist()
            self._threads.do(restart, ended)

    def _conclude(
        self, numbers: list[int], moved: list[Any], actions: NDArray[Any], results: StepResults
    ) -> list[int]:
        """Compute the results of envs of one kind whose physics has stepped; see `_advance`.

        Return the numbers of the envs whose simulation has diverged.
        """
        everyone = len(numbers) == self.num_envs
        where: Any = slice(None) if everyone else numbers
        bounds, before = zip(*[moved[i] for i in numbers], strict=True)
        subs = [self._subs[i] for i in numbers]
        observations, rewards, terminated, infos = cast("Any", subs[0].tuned).conclude(
            bounds, before, actions[where], self._observations if everyone else None
        )
        if not everyone:
            self._observations[where] = observations
        truncated = [sub.tick() for sub in subs]
        results.put_columns(numbers, rewards, terminated, truncated, infos)
        warnings = np.concatenate([bound.warnings for bound in bounds])
        if not warnings.any():
            return []
        bad = warnings.reshape(len(subs), -1).any(axis=1)
        return [numbers[place] for place in np.flatnonzero(bad)]

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The seed of each env's generator."""
        return self.get_attr("np_random_seed")

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Each env's generator."""
        return self.get_attr("np_random")

    def render(self) -> tuple[Any, ...]:
        """Return one frame per env."""
        self._require_open()
        return self._of_each(lambda i: cast("Any", self.envs[i]).render())

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method of each env with the given arguments, or read an attribute."""

        def ask(i: int) -> Any:
            found = self.envs[i].get_wrapper_attr(name)
            return found(*args, **kwargs) if callable(found) else found

        return self._of_each(ask)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of each env."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of each env.

        Args:
            name: Name of the attribute.
            values: A list or tuple with one value per env, or one value for all.

        Raises:
            VectorEnvError: If the numbers of values and envs differ.
        """
        several = isinstance(values, list | tuple)
        each = cast("Sequence[Any]", values if several else [values] * self.num_envs)
        if len(each) != self.num_envs:
            raise VectorEnvError(f"There are {self.num_envs} envs and {len(each)} values.")
        self._of_each(lambda i: self.envs[i].set_wrapper_attr(name, each[i]))

    def close_extras(self, **kwargs: Any) -> None:
        """Close each env and end the threads."""
        try:
            self._at_home(lambda i: self.envs[i].close(), range(self.num_envs))
        finally:
            self._threads.stop()

    def _at_home(self, work: Callable[[int], object], numbers: Iterable[int]) -> None:
        """Do `work` for some envs in the thread that owns their OpenGL contexts.

        If the physics of all envs can be stepped separately, no env draws while it steps, and the
        caller's thread draws them. Otherwise each env's contexts belong to its own thread.
        """
        drawn_here = self.closed or all(sub.tuned is not None for sub in self._subs)
        self._threads.do(work, numbers, alone=drawn_here)

    def _of_each(self, work: Callable[[int], Any]) -> tuple[Any, ...]:
        found: list[Any] = [None] * self.num_envs

        def ask(i: int) -> None:
            found[i] = work(i)

        self._at_home(ask, range(self.num_envs))
        return tuple(found)

    def _require_open(self) -> None:
        if self.closed:
            raise gym.error.ClosedEnvironmentError("This vector env is closed: make another one.")

    @contextmanager
    def _stepping(self) -> Generator[None]:
        """Let the threads work on an open vector env; if that fails, the envs must be reset."""
        self._require_open()
        self._awaits_reset = True
        try:
            yield
        finally:
            # Closing envs that threads still work on is not safe.
            self.closed = self._threads.lost
        self._awaits_reset = False

    def _present_observations(self) -> NDArray[Any]:
        return self._observations.copy() if self.copy else self._observations
