"""The actions of an episode in an env, and how far that comes apart from what was recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.cli.console import plain_console
from shapechanger.cli.env_arguments import env_ref, opened
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

if TYPE_CHECKING:
    from shapechanger.demos.episodes import Episode, Step
    from shapechanger.demos.recordable import Seen
    from shapechanger.transfer.env_ref import EnvRef

__all__ = ["play_in_env"]


def play_in_env(episode: Episode, env_id: str) -> None:
    """Play an episode in an env, from the seed that was recorded, and say how it differs.

    What the outputs did is what is played, where that is known: it is what the pictures follow
    from, while an expert may have meant something else.

    Raises:
        DemosError: If the env takes other actions.
        UnknownName: If there is no such env.
    """
    from shapechanger.demos.recordable import Sight

    header = episode.header
    kept = episode.kept
    apart = _Apart()
    with opened(_ref(episode, env_id), max_episode_steps=-1) as env:
        sight = Sight(env, 95)
        recorded = Layout.from_json(header.action_layout)
        if [(f.name, f.unit, f.shape) for f in sight.action_layout] != [
            (f.name, f.unit, f.shape) for f in recorded
        ]:
            raise DemosError(
                f"{env_id} moves {', '.join(sight.action_layout.names)}, and {episode.path.name} "
                f"was recorded with {', '.join(recorded.names)}."
            )
        states = sight.state_layout
        compares = states is not None and states.to_json() == header.state_layout
        observation, info = env.reset(
            seed=header.seed, options=cast("Any", header.notes.get("reset_options"))
        )
        played, ended = 0, ""
        for step in kept:
            apart.look(episode, step, sight.seen(observation, info), states=compares)
            values = step.action if step.applied is None else step.applied
            observation, reward, terminated, truncated, info = env.step(
                np.array(values, np.float32)
            )
            played += 1
            apart.earn(step, float(reward))
            if terminated or truncated:
                ended = "; there it was over" if played < len(kept) else ""
                break
    console = plain_console()
    console.print(f"played {played} of {len(kept)} steps in {env_id}{ended}", soft_wrap=True)
    for line in _caveats(episode):
        console.print(line, soft_wrap=True)
    for line in apart.told(states if compares else None):
        console.print(line, soft_wrap=True)


def _ref(episode: Episode, env_id: str) -> EnvRef:
    """The env, with the arguments that were recorded where it is the same one."""
    from shapechanger.transfer.env_ref import EnvRef

    ref, header = env_ref(env_id), episode.header
    kwargs = header.env_kwargs if ref.id == header.env else {}
    return EnvRef(ref.id, {**kwargs, **ref.kwargs})


def _caveats(episode: Episode) -> list[str]:
    """Why an episode cannot come out the same."""
    told: list[str] = []
    if episode.header.seed is None:
        told.append("it was recorded without a seed, so it began somewhere else")
    kept = episode.kept
    if kept[0].index != 0 or kept[-1].index - kept[0].index != len(kept) - 1:
        told.append("steps of it do not count and were not played, so it went on from elsewhere")
    if any(step.applied is None for step in kept):
        told.append("what its outputs did is not known, so what was decided was played")
    return told


class _Apart:
    """How far a replay comes apart from what was recorded."""

    def __init__(self) -> None:
        self._states: list[NDArray[np.float64]] = []
        self._pictures: list[float] = []
        self._rewards: list[tuple[float, float]] = []

    def look(self, episode: Episode, step: Step, seen: Seen, *, states: bool) -> None:
        """Compare what is seen now with what was seen before this step."""
        from shapechanger.demos.dataset import decode_picture

        if states:
            self._states.append(np.abs(np.array(seen.state) - np.array(step.state)))
        jpeg = episode.jpeg(step)
        if jpeg is None or seen.jpeg is None:
            return
        old, new = decode_picture(jpeg, step.frame), decode_picture(seen.jpeg, "the env's picture")
        if old.shape == new.shape:
            self._pictures.append(float(np.abs(old.astype(float) - new).mean()))

    def earn(self, step: Step, reward: float) -> None:
        """Take in what the step was worth, then and now."""
        if step.reward is not None:
            self._rewards.append((step.reward, reward))

    def told(self, layout: Layout | None) -> list[str]:
        """The differences, a line each."""
        lines: list[str] = []
        if self._pictures and not any(self._pictures):
            lines.append("the pictures are the same in every step")
        elif self._pictures:
            lines.append(
                f"pictures differ by {np.mean(self._pictures):.1f} of 255 on average, "
                f"{self._pictures[-1]:.1f} at the end"
            )
        if layout is not None and self._states:
            gaps = np.array(self._states)
            if not np.nanmax(gaps, initial=0.0):
                lines.append("the state is the same in every step")
            for name, place in layout.slices.items():
                of_one = gaps[:, place]
                if np.nanmax(of_one, initial=0.0):
                    lines.append(
                        f"{layout[name]} differs by {np.nanmean(of_one):.3g} on average, "
                        f"{np.nanmax(of_one):.3g} at most"
                    )
        if self._rewards:
            then, now = np.sum(self._rewards, axis=0)
            lines.append(f"it was worth {then:.2f} and is now worth {now:.2f}")
        return lines or ["there is nothing to compare it with"]
