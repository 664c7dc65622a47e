"""A vector env whose envs are stepped by a few threads."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from shapechanger.envs.vector.access import Access
from shapechanger.envs.vector.actions import checked
from shapechanger.envs.vector.crew import Crew, Failures, work_through
from shapechanger.envs.vector.infos import batched
from shapechanger.envs.vector.member import Member, Step
from shapechanger.envs.vector.resets import masked_options, one_seed_each
from shapechanger.envs.vector.spaces import require_boxes, require_same_spaces
from shapechanger.envs.vector.stride import stride
from shapechanger.errors import VectorEnvError

__all__ = ["Restart", "ThreadVectorEnv"]

_Floats = NDArray[np.float64]
_Bools = NDArray[np.bool_]


class Restart(NamedTuple):
    """A reset that followed the end of an episode within the same step.

    Attributes:
        final_observation: The last observation of the episode.
        info: The info of the reset.
    """

    final_observation: NDArray[Any]
    info: dict[str, Any]


class ThreadVectorEnv(Access):
    """Envs of one class, stepped together, with the numbers of Gymnasium's `SyncVectorEnv`.

    MuJoCo steps outside Python's lock, so threads share the cores: each has a row of neighbouring
    envs of its own, and is given work once a step. Observations, rewards, ends and infos are those
    of `SyncVectorEnv` to the last bit, with any number of threads. Two things are better told:
    actions are looked at before any env steps, and an env whose simulation diverges is terminated
    with `info["diverged"]` (see `Member`).

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
            Member(env, row) for env, row in zip(self.envs, self._observations, strict=True)
        ]
        self._ended = np.zeros(self.num_envs, np.bool_)
        self._nowhere = np.zeros(self.num_envs, np.bool_)
        self._awaits_reset = True
        threads = 1 if self.render_mode == "human" else min(threads, self.num_envs)
        self._crew = Crew(threads)
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
        return observations, batched(infos)

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

        # Another body has to be compiled and its pictures drawn anew, which is for one thread.
        self._guarded(lambda: self._crew.do(start, numbers, alone=any(options)))
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
        observations, steps, restarts = self.step_each(actions)
        rewards, terminated, truncated, infos = zip(*steps, strict=True)
        if restarts:
            infos = list(infos)
            for i, (final, info) in restarts.items():
                infos[i] = {"final_obs": final, "final_info": infos[i], **info}
        return (
            observations,
            np.array(rewards, np.float64),
            np.array(terminated, np.bool_),
            np.array(truncated, np.bool_),
            batched(infos),
        )

    def step_each(self, actions: Any) -> tuple[NDArray[Any], list[Step], dict[int, Restart]]:
        """Take one step in each env, as `step`; what came of it is told env by env.

        Returns:
            The observations of all envs; for each its reward, whether it terminated and was
            truncated, and its info; and by number the envs that started again at once.
        """
        self._require_open()
        waits = self._ended if self._mode is AutoresetMode.NEXT_STEP else self._nowhere
        given = checked(actions, self.num_envs, self._action_shape, waits)
        self._require_running()
        steps: list[Step] = [(0.0, False, False, {})] * self.num_envs
        restarts: dict[int, Restart] = {}
        members, waiting = self._members, waits.tolist()
        same_step = self._mode is AutoresetMode.SAME_STEP

        def start(i: int) -> None:
            steps[i] = (0.0, False, False, members[i].reset())

        def done(i: int, step: Step) -> None:
            steps[i] = step
            if same_step and (step[1] or step[2]):
                restarts[i] = self._restart(i, steps)

        def advance(numbers: Sequence[int], failures: Failures) -> None:
            work_through(start, [i for i in numbers if waiting[i]], failures)
            rest = [i for i in numbers if not waiting[i]]
            stride(members, given, self._observations, rest, done, failures)

        self._guarded(lambda: self._crew.share(advance, range(self.num_envs)))
        if not np.isfinite(self._observations).all():
            self._end_diverged(steps, restarts)
        self._ended = np.array([step[1] or step[2] for step in steps], np.bool_)
        return self._present_observations(), steps, restarts

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads and close each env."""
        self._crew.stop()
        for env in self.envs:
            env.close()

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

    def _restart(self, i: int, steps: list[Step]) -> Restart:
        """Reset an env whose episode has ended; if its last observation is bad, say why."""
        member = self._members[i]
        if not np.isfinite(member.row).all():
            steps[i] = member.diverged(*steps[i][2:])
        return Restart(member.row.copy(), member.reset())

    def _end_diverged(self, steps: list[Step], restarts: dict[int, Restart]) -> None:
        """End the episodes whose observation is not finite, though nobody has noticed before."""
        finite = np.isfinite(self._observations).reshape(self.num_envs, -1).all(axis=1)
        for i in (int(number) for number in np.flatnonzero(~finite)):
            if i not in restarts:
                steps[i] = self._members[i].diverged(*steps[i][2:])
                if self._mode is AutoresetMode.SAME_STEP:
                    restarts[i] = self._restart(i, steps)

    def _present_observations(self) -> NDArray[Any]:
        return self._observations.copy() if self.copy else self._observations
