"""A vector env whose envs are stepped by a few threads."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, cast

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from shapechanger.envs.actions import checked
from shapechanger.envs.vector.batch import BatchStep
from shapechanger.envs.vector.checks import (
    masked_options,
    one_seed_each,
    require_boxes,
    require_same_spaces,
)
from shapechanger.envs.vector.infos import Restart, Results, SubEnv, batched, in_columns
from shapechanger.envs.vector.threads import Crew, Failures, work_through
from shapechanger.errors import VectorEnvError

__all__ = ["EnvAccess", "ThreadVectorEnv"]


class EnvAccess(VectorEnv[NDArray[Any], NDArray[Any], NDArray[Any]]):
    """What a vector env passes on to its envs, as Gymnasium's `SyncVectorEnv` does.

    Attributes:
        envs: The envs.
    """

    envs: list[gym.Env[Any, Any]]
    observation_space: gym.Space[Any]
    action_space: gym.Space[Any]
    single_observation_space: gym.Space[Any]
    single_action_space: gym.Space[Any]

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The seed of each env's generator."""
        return self.get_attr("np_random_seed")

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Each env's generator."""
        return self.get_attr("np_random")

    def render(self) -> tuple[Any, ...]:
        """One frame per env."""
        self._require_open()
        return self._of_each(lambda i: cast("Any", self.envs[i]).render())

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method of each env, or read an attribute.

        Args:
            name: Its name.
            *args: Arguments of the method.
            **kwargs: Named arguments of the method.
        """

        def ask(i: int) -> Any:
            found = self.envs[i].get_wrapper_attr(name)
            return found(*args, **kwargs) if callable(found) else found

        return self._of_each(ask)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each env."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of each env.

        Args:
            name: Its name.
            values: A list or tuple with one value per env, or one value for all.

        Raises:
            VectorEnvError: If there are not as many values as envs.
        """
        each = cast("Sequence[Any]", values) if isinstance(values, list | tuple) else None
        if each is not None and len(each) != self.num_envs:
            raise VectorEnvError(f"There are {self.num_envs} envs and {len(each)} values.")
        self._of_each(
            lambda i: self.envs[i].set_wrapper_attr(name, values if each is None else each[i])
        )

    def _of_each(self, work: Callable[[int], Any]) -> tuple[Any, ...]:
        """What `work` gives for the number of each env, where that env is at home."""
        raise NotImplementedError

    def _require_open(self) -> None:
        """Refuse to go on after `close`.

        Raises:
            ClosedEnvironmentError: If there is nothing to go on with.
        """
        if self.closed:
            raise gym.error.ClosedEnvironmentError("This vector env is closed: make another one.")


_Floats = NDArray[np.float64]
_Bools = NDArray[np.bool_]


class ThreadVectorEnv(EnvAccess):
    """Envs of one class, stepped together, with the numbers of Gymnasium's `SyncVectorEnv`.

    MuJoCo steps outside Python's lock, so threads share the cores: each has a row of neighbouring
    envs of its own, and is given work once a step. Observations, rewards, ends and infos are those
    of `SyncVectorEnv` to the last bit, with any number of threads. Two things are better told:
    actions are looked at before any env steps, and an env whose simulation diverges is terminated
    with `info["diverged"]` (see `SubEnv`).

    If an env raises, the others finish the step; if somebody presses Ctrl-C, the threads do. Both
    leave the envs apart in time, so the next call must be `reset` or `close`.

    Args:
        makers: For each env a function that makes it; their spaces are boxes, and the same.
        threads: How many threads step, with that of the caller; at least one. Windows are drawn by
            one thread, so with `render_mode="human"` it is one.
        autoreset_mode: When an env that has ended starts again, as Gymnasium's vector envs.
        copy: Whether observations are copies; else the next step writes into them.

    Raises:
        VectorEnvError: If there are no envs, no threads, or spaces that are not boxes.
        SpaceMismatch: If the spaces of two envs differ.
    """

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
        self.envs: list[gym.Env[Any, Any]] = []
        try:
            for maker in makers:
                self.envs.append(maker())
            require_boxes(self.envs[0])
            require_same_spaces(self.envs)
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
        space = self.observation_space
        self._observations = np.zeros(cast("tuple[int, ...]", space.shape), space.dtype)
        self._members = [
            SubEnv(env, row) for env, row in zip(self.envs, self._observations, strict=True)
        ]
        self._ended = np.zeros(self.num_envs, np.bool_)
        self._nowhere = np.zeros(self.num_envs, np.bool_)
        self._awaits_reset = True
        threads = 1 if self.render_mode == "human" else min(threads, self.num_envs)
        self._crew = Crew(threads, self.num_envs)
        # Ends the threads of a vector env that nobody closes, and at the end of the program.
        weakref.finalize(self, self._crew.stop)

    @property
    def threads(self) -> int:
        """How many threads step, with that of the caller."""
        return self._crew.threads

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Start an episode in each env.

        Args:
            seed: A number, which is the seed of the first env, the next of the next; or one seed or
                None per env; None goes on with the present generators.
            options: Handed to each env. `reset_mask`, an array of one boolean per env, says which
                envs start again; the others stay as they are.

        Returns:
            The observations of all envs, and the infos of those that started again.

        Raises:
            VectorEnvError: If there are not as many seeds as envs.
            ResetNeeded: If the mask leaves envs out that have never been reset.
            TypeError: If the mask is not an array of booleans.
            ValueError: If the mask has another shape, or is true nowhere.
        """
        self._require_open()
        seeds = one_seed_each(seed, self.num_envs)
        mask, options = masked_options(options, self.num_envs)
        if mask is not None and self._awaits_reset and not mask.all():
            raise gym.error.ResetNeeded("No episode is under way: call `reset` without a mask.")
        chosen = range(self.num_envs) if mask is None else [int(i) for i in np.flatnonzero(mask)]
        observations, infos = self.reset_each(seeds, [options] * self.num_envs, chosen)
        everybody = range(self.num_envs)
        return observations, batched(in_columns(everybody, infos), self.num_envs)

    def reset_each(
        self,
        seeds: Sequence[int | None],
        options: Sequence[dict[str, Any] | None],
        chosen: Sequence[int] | None = None,
    ) -> tuple[NDArray[Any], list[dict[str, Any]]]:
        """Start an episode in each env, as `reset`; what came of it is told env by env.

        Args:
            seeds: The seed of each env.
            options: The options of each env.
            chosen: Numbers of the envs that start again; None for all.

        Returns:
            The observations of all envs, and for each its info, empty where none started.
        """
        self._require_open()
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        numbers = range(self.num_envs) if chosen is None else chosen

        def start(i: int) -> None:
            infos[i] = self._members[i].reset(seeds[i], options[i])

        if any(given and "body" in given for given in options):
            # Another body is compiled by one thread at a time, and its pictures are drawn anew.
            compiling = threading.Lock()

            def start_in_turn(i: int) -> None:
                with compiling:
                    start(i)

            self._guarded(lambda: self._at_home(start_in_turn, numbers))
        else:
            self._guarded(lambda: self._crew.do(start, numbers))
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
        return (
            observations,
            results.rewards,
            results.terminated,
            results.truncated,
            results.batched(),
        )

    def step_each(self, actions: Any) -> tuple[NDArray[Any], Results]:
        """Take one step in each env, as `step`; what came of it can be told env by env.

        Returns:
            The observations of all envs, and all else.
        """
        self._require_open()
        waits = self._ended if self._mode is AutoresetMode.NEXT_STEP else self._nowhere
        given = checked(actions, self.num_envs, self._action_shape, waits)
        self._require_running()
        results = Results(self.num_envs)
        restart = partial(self._restart, results) if self._starts_at_once else None
        step = BatchStep(
            self._members, given, self._observations, results, restart, self._crew.threads
        )
        self._guarded(lambda: self._advance(waits.tolist(), step, results))
        self._ended = results.terminated | results.truncated
        return self._present_observations(), results

    def _advance(self, waiting: list[bool], stride: BatchStep, results: Results) -> None:
        """Start again who waits for it, and step the others."""

        def start(i: int) -> None:
            results.tell(i, (0.0, False, False, self._members[i].reset()))

        def work(thread: int, failures: Failures) -> None:
            own = self._crew.parts[thread]
            begin = [i for i in own if waiting[i]]
            # What draws may not change threads.
            work_through(start, [i for i in begin if self._members[i].tuned is None], failures)
            anywhere = [i for i in begin if self._members[i].tuned is not None]
            stride.advance(
                thread,
                [i for i in own if not waiting[i]],
                [(i, partial(start, i)) for i in anywhere],
                failures,
            )

        self._crew.share([partial(work, thread) for thread in range(self.threads)])
        stride.conclude()
        self._end_diverged(results)
        if self._starts_at_once:
            ends = np.flatnonzero(results.terminated | results.truncated).tolist()
            ended = [i for i in ends if i not in results.restarts]
            if ended:
                self._crew.do(partial(self._restart, results), ended)

    def close_extras(self, **kwargs: Any) -> None:
        """Close each env and end the threads."""
        try:
            self._at_home(lambda i: self.envs[i].close(), range(self.num_envs))
        finally:
            self._crew.stop()

    def _at_home(self, work: Callable[[int], None], numbers: Iterable[int]) -> None:
        """Do `work` for the envs `numbers`, where they draw.

        Those that step their physics apart draw nothing by the way, so whoever asks them for a
        picture draws it. Others may: what they draw with belongs to their thread.
        """
        drawn_here = self.closed or all(member.tuned is not None for member in self._members)
        self._crew.do(work, numbers, alone=drawn_here)

    def _of_each(self, work: Callable[[int], Any]) -> tuple[Any, ...]:
        found: dict[int, Any] = {}

        def ask(i: int) -> None:
            found[i] = work(i)

        self._at_home(ask, range(self.num_envs))
        return tuple(found[i] for i in range(self.num_envs))

    def _require_running(self) -> None:
        """Refuse to step envs that are not under way.

        Raises:
            ResetNeeded: If one must be reset first.
        """
        if self._awaits_reset:
            raise gym.error.ResetNeeded("These envs are not at the same step: call `reset` first.")
        if self._mode is AutoresetMode.DISABLED and self._ended.any():
            numbers = ", ".join(str(i) for i in np.flatnonzero(self._ended))
            raise gym.error.ResetNeeded(
                f"The episodes of envs {numbers} have ended, and nothing resets them in this mode: "
                "call `reset` with options={'reset_mask': terminations | truncations}."
            )

    def _guarded(self, work: Callable[[], None]) -> None:
        """Let the threads work; if that fails their envs are to be reset."""
        self._awaits_reset = True
        try:
            work()
        finally:
            # Threads that are still at work would find their envs closed.
            self.closed = self._crew.lost
        self._awaits_reset = False

    @property
    def _starts_at_once(self) -> bool:
        return self._mode is AutoresetMode.SAME_STEP

    def _restart(self, results: Results, i: int) -> None:
        """Reset an env whose episode has ended; if its last observation is bad, say why."""
        member = self._members[i]
        if not np.isfinite(member.row).all():
            results.tell_diverged(i, member)
        results.restarts[i] = Restart(member.row.copy(), member.reset())

    def _end_diverged(self, results: Results) -> None:
        """End the episodes whose observation is not finite, though nobody has noticed before."""
        finite = np.isfinite(self._observations)
        if not np.logical_and.reduce(finite, axis=None):
            bad = ~finite.reshape(self.num_envs, -1).all(axis=1)
            for i in np.flatnonzero(bad).tolist():
                if i not in results.restarts:
                    results.tell_diverged(i, self._members[i])

    def _present_observations(self) -> NDArray[Any]:
        return self._observations.copy() if self.copy else self._observations
