"""Records what happens in an env, one episode a reset."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple, cast

import gymnasium as gym
import numpy as np
import simplejpeg
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.episodes import Driver, EpisodeHeader, EpisodeWriter, Step
from shapechanger.errors import DemosError, MissingExtra, ShapechangerError
from shapechanger.layout import Layout

__all__ = ["QUALITY", "SPARE_BYTES", "RecordEpisodes", "Seen", "Sight"]

try:
    import simplejpeg
except ImportError as error:
    raise MissingExtra("simplejpeg", "data") from error


_PICTURE_DIMENSIONS: Final = 3
_CHANNELS: Final = 3


@dataclass(frozen=True, slots=True)
class Seen:
    """What one observation is recorded as.

    Attributes:
        jpeg: Its picture; None without one.
        state: Its numbers; NaN where nothing measures one.
        captured_ns: When it was taken, clock of the robot; None where nobody says.
    """

    jpeg: bytes | None
    state: tuple[float, ...]
    captured_ns: int | None


class Sight:
    """Takes the observations of an env apart.

    Args:
        env: Its observations are a picture, a state, or a Dict of `image` and `state`.
        quality: Of pictures that the env gives as arrays, in percent; their colours are kept at
            full resolution.

    Attributes:
        action_layout: What the numbers of an action mean.
        state_layout: What the numbers of a state mean; None without a state.
        has_picture: Whether there are pictures.

    Raises:
        DemosError: If it shows or takes something else, or does not say what that means.
    """

    def __init__(self, env: gym.Env[Any, Any], quality: int) -> None:
        if not 1 <= quality <= 100:  # Percent.
            raise DemosError(f"The quality of a picture is 1 to 100 %, got {quality}.")
        self._env, self._quality = env, quality
        name = env.spec.id if env.spec else type(env.unwrapped).__name__
        space = env.observation_space
        self._is_dict = isinstance(space, spaces.Dict)
        parts: Mapping[str, gym.Space[Any]] = (
            cast("Any", space).spaces
            if self._is_dict
            else {"image" if _is_picture(space) else "state": space}
        )
        picture, state = parts.get("image"), parts.get("state")
        if (
            not parts
            or not parts.keys() <= {"image", "state"}
            or (picture is not None and not _is_picture(picture))
            or (state is not None and not _is_row(state))
        ):
            raise DemosError(
                f"{name} shows {space}, and what can be recorded is a picture (bytes, height x "
                "width x 3), a row of numbers, or a Dict of both as `image` and `state`."
            )
        self.has_picture, self._has_state = picture is not None, state is not None
        seen, self.action_layout = (_layout(env, name, s) for s in ("observation", "action"))
        numbers = tuple(f for f in seen if len(f.shape) != _PICTURE_DIMENSIONS)
        self.state_layout = Layout(numbers) if state is not None else None
        self._places = self.state_layout.slices if self.state_layout else {}
        for what, part, layout in (
            ("state", state, self.state_layout),
            ("action", env.action_space, self.action_layout),
        ):
            if part is None or layout is None:
                continue
            if not _is_row(part) or part.shape != (layout.size,):
                raise DemosError(
                    f"{name}: each {what} is {part}, and its layout has {layout.size} numbers."
                )

    def seen(self, observation: Any, info: Mapping[str, Any]) -> Seen:
        """What an observation is recorded as."""
        return Seen(
            self._jpeg(observation["image"] if self._is_dict else observation)
            if self.has_picture
            else None,
            self._state(observation, info) if self._has_state else (),
            info.get("captured_ns"),
        )

    def _jpeg(self, picture: NDArray[np.uint8]) -> bytes:
        given: bytes | None = getattr(self._env.unwrapped, "newest_jpeg", None)
        if given is not None:
            return given
        return simplejpeg.encode_jpeg(
            np.ascontiguousarray(picture), quality=self._quality, colorsubsampling="444"
        )

    def _state(self, observation: Any, info: Mapping[str, Any]) -> tuple[float, ...]:
        given = observation["state"] if self._is_dict else observation
        state = np.array(given, np.float64).ravel()
        for name in info.get("absent", ()):
            if name in self._places:
                state[self._places[name]] = math.nan
        return tuple(state.tolist())


def _is_picture(space: gym.Space[Any]) -> bool:
    return (
        isinstance(space, spaces.Box)
        and cast("Any", space).dtype == np.uint8
        and len(space.shape) == _PICTURE_DIMENSIONS
        and space.shape[-1] == _CHANNELS
    )


def _is_row(space: gym.Space[Any]) -> bool:
    return isinstance(space, spaces.Box) and len(space.shape) == 1


def _layout(env: gym.Env[Any, Any], name: str, side: str) -> Layout:
    layout = getattr(env.unwrapped, f"{side}_layout", None)
    if not isinstance(layout, Layout):
        raise DemosError(
            f"{name} publishes no {side}_layout, so nothing says what its numbers mean: add it to "
            "the env, as a `shapechanger.Layout`."
        )
    return layout


QUALITY: Final = 95
"""Of pictures that an env gives as arrays, in percent."""

SPARE_BYTES: Final = 64 << 20
"""How much of the disk stays free."""

_COLLISION: Final = "reward_collision"
_SECRET: Final = frozenset({"key"})
"""Arguments of envs that must not leave this machine with a recording."""


class _Decision(NamedTuple):
    """What was decided where it is not what is carried out."""

    action: tuple[float, ...]
    driver: Driver
    wanted: tuple[float, ...] | None


class RecordEpisodes(gym.Wrapper[Any, NDArray[np.float32], Any, NDArray[np.float32]]):
    """Records what is seen and done in an env.

    A step holds what was seen, the action that was decided on seeing it, and what came of that.
    Where a person intervened (`info["intervene_action"]`), the person's action is the one that
    counts, and what was passed to `step` is what a policy wanted. What else is kept where the env
    gives it is listed in `shapechanger.demos.recording`.

    When nothing can be written any more the env is brought to rest by one step of the action that
    moves nothing, and `step` raises what went wrong; what was written before is whole.

    Args:
        env: Shows a picture, a state, or a Dict of `image` and `state`; has layouts.
        recording: Folder of the recording; made where it is missing.
        driver: Who decides what is passed to `step`.
        about: More fields of the header, such as `robot`, `body`, `source` and `notes`.
        quality: Of pictures that the env gives as arrays, in percent.
        spare_bytes: How much of the disk stays free.

    Attributes:
        path: Folder of the newest episode; None before the first.
        steps: How many steps were written, of all episodes.
        episodes: How many episodes were begun.
        outcome: How the newest episode that is over ended.

    Raises:
        DemosError: If the env shows or takes what cannot be recorded.
    """

    def __init__(
        self,
        env: gym.Env[Any, NDArray[np.float32]],
        recording: Path,
        *,
        driver: Driver = "program",
        about: Mapping[str, Any] | None = None,
        quality: int = QUALITY,
        spare_bytes: int = SPARE_BYTES,
    ) -> None:
        super().__init__(env)
        self._sight = Sight(env, quality)
        self._recording, self._spare_bytes = recording, spare_bytes
        self._by_default: Driver = driver
        self._about = dict(about or {})
        self.path: Path | None = None
        self.steps = 0
        self.episodes = 0
        self.outcome = ""
        self._writer: EpisodeWriter | None = None
        self._seen: Seen | None = None
        self._jpeg: bytes | None = None
        self._begun: dict[str, Any] = {}
        self._decision: _Decision | None = None

    @property
    def control_hz(self) -> float:
        """Steps a second."""
        return float(self.env.metadata.get("render_fps") or 20.0)

    def decide(
        self,
        action: Sequence[float] | NDArray[Any],
        driver: Driver,
        wanted: Sequence[float] | NDArray[Any] | None = None,
    ) -> None:
        """Say what was decided for the next step, where it is not what is passed to `step`.

        Args:
            action: What was meant, and is to be learned.
            driver: Who decided it.
            wanted: What a policy wanted while somebody else drives.
        """
        asked = None if wanted is None else _numbers(wanted)
        self._decision = _Decision(_numbers(action), driver, asked)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; one that is still open is closed. It is on disk from its first step."""
        self.end()
        observation, info = super().reset(seed=seed, options=options)
        self._seen = self._sight.seen(observation, info)
        self._begun = {"seed": seed}
        if options:
            self._begun["options"] = _plain(options)
        return observation, info

    def step(self, action: NDArray[np.float32]) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Do a step, and record it.

        Raises:
            OutputError: If it cannot be written.
            DemosError: If it cannot be recorded as it is, or somebody else records there.
            ResetNeeded: If the episode is over.
        """
        seen = self._seen
        if seen is None:
            raise gym.error.ResetNeeded("Call reset() before the first step of an episode.")
        # A folder that cannot be written to is found before anything moves.
        writer = self._writer or self._begin(seen)
        try:
            observation, reward, terminated, truncated, info = super().step(action)
        except BaseException as error:
            self.end("stopped" if isinstance(error, KeyboardInterrupt) else "failed")
            raise
        over = bool(terminated or truncated)
        try:
            writer.add(
                self._step(seen, action, float(reward), bool(terminated), bool(truncated), info),
                seen.jpeg if seen.jpeg != self._jpeg else None,
            )
            self.steps += 1
            self._jpeg = seen.jpeg
            self._seen = None if over else self._sight.seen(observation, info)
            if over:
                self.end(_outcome(bool(terminated), info))
        except ShapechangerError as error:
            self._give_up(error, over=over)
            raise
        return observation, reward, terminated, truncated, info

    def mark(self, text: str = "") -> None:
        """Mark the newest step.

        Raises:
            DemosError: If there is none in this episode.
        """
        self._open().mark(text)

    def undo(self, seconds: float = 5.0) -> int:
        """Drop the newest steps of this episode; how many.

        Raises:
            DemosError: If there is no episode.
        """
        return self._open().undo(seconds)

    def end(self, outcome: str = "") -> None:
        """Close the episode, if there is one; the env goes on, and is not recorded any more.

        Raises:
            OutputError: If that cannot be written; all steps are there all the same.
        """
        writer, self._writer = self._writer, None
        self._seen = self._jpeg = self._decision = None
        if writer is not None:
            self.outcome = outcome
            writer.close(outcome)

    def close(self) -> None:
        """Close the env, and the episode."""
        try:
            super().close()
        finally:
            self.end()

    def _begin(self, seen: Seen) -> EpisodeWriter:
        self._writer = EpisodeWriter.create(
            self._recording, self._header(seen), spare_bytes=self._spare_bytes
        )
        self.path = self._writer.path
        self.episodes += 1
        return self._writer

    def _header(self, seen: Seen) -> EpisodeHeader:
        spec, inner = self.env.spec, self.env.unwrapped
        clock = getattr(inner, "record_clock", "none")
        layout = self._sight.state_layout
        notes = dict(self._about.get("notes", {}))
        if "options" in self._begun:
            notes["reset_options"] = self._begun["options"]
        # A robot on the network says what it is.
        robot = getattr(inner, "welcome", None)
        fields: dict[str, Any] = {
            "robot": getattr(robot, "robot", ""),
            "body": getattr(robot, "body", ""),
            "action_layout": self._sight.action_layout.to_json(),
            "state_layout": layout.to_json() if layout else "",
            "image_size": _size(seen.jpeg),
            "control_hz": self.control_hz,
            "env": spec.id if spec else "",
            "env_kwargs": _plain(_public(spec.kwargs)) if spec else {},
            "driver": self._by_default,
            "clock": clock if seen.captured_ns is not None else "none",
            "seed": self._begun["seed"],
        }
        whole: dict[str, Any] = {**fields, **self._about, "notes": notes}
        return EpisodeHeader(**whole)

    def _step(
        self,
        seen: Seen,
        action: Any,
        reward: float,
        terminated: bool,
        truncated: bool,
        info: Mapping[str, Any],
    ) -> Step:
        passed = _numbers(action)
        decision, self._decision = self._decision, None
        decided = decision or _Decision(passed, self._by_default, None)
        if (by_person := info.get("intervene_action")) is not None:
            decided = _Decision(_numbers(by_person), "person", passed)
        applied = info.get("action_applied")
        return Step(
            action=decided.action,
            driver=decided.driver,
            wanted=decided.wanted,
            applied=None if applied is None else _numbers(applied),
            state=seen.state,
            captured_ns=seen.captured_ns,
            decided_ns=info.get("decided_ns"),
            wall_ns=time.time_ns(),
            reward=reward,
            terms={name: float(value) for name, value in _terms(info).items()},
            terminated=terminated,
            truncated=truncated,
            stop_reason=str(info.get("stop_reason", "")),
        )

    def _give_up(self, why: ShapechangerError, *, over: bool) -> None:
        """Bring the env to rest, and let go of the episode, whatever else goes wrong."""
        if not over:
            try:
                super().step(_rest(self.env.action_space))
            except (ShapechangerError, gym.error.Error) as error:
                why.add_note(f"The env could not be brought to rest either: {error}")
        try:
            self.end("failed")
        except ShapechangerError as error:
            why.add_note(str(error))

    def _open(self) -> EpisodeWriter:
        if self._writer is None:
            raise DemosError("No episode is being recorded: it begins with the first step.")
        return self._writer


def _numbers(values: Any) -> tuple[float, ...]:
    return tuple(np.asarray(values, np.float64).ravel().tolist())


def _terms(info: Mapping[str, Any]) -> Mapping[str, Any]:
    return cast("Mapping[str, Any]", info.get("reward_terms") or {})


def _outcome(terminated: bool, info: Mapping[str, Any]) -> str:
    """How an episode ended, in a word or a sentence."""
    if not terminated:
        return str(info.get("truncated_because") or "time")
    if _terms(info).get(_COLLISION, 0.0) < 0.0:
        return "collision"
    return "success" if info.get("is_success") else "terminated"


def _rest(space: gym.Space[Any]) -> NDArray[np.float32]:
    """The action that moves nothing: 0, or the bound nearest to it."""
    box = cast("gym.spaces.Box", space)
    return np.clip(np.zeros(box.shape), box.low, box.high).astype(np.float32)


def _size(jpeg: bytes | None) -> tuple[int, int] | None:
    if jpeg is None:
        return None
    height, width, *_ = simplejpeg.decode_jpeg_header(jpeg)
    return int(width), int(height)


def _public(arguments: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in arguments.items() if name not in _SECRET}


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values as JSON can hold them; of what it cannot, what it looks like."""
    return cast("dict[str, Any]", json.loads(json.dumps(dict(values), default=str)))
