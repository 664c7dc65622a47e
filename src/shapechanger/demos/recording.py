"""Record episodes of any Gymnasium env, one per reset.

Besides observations and actions, a step keeps what the env provides: in `info`, `captured_ns`,
`decided_ns`, `action_applied`, `intervene_action`, `absent` (names of missing state values),
`reward_terms`, `stop_reason`, `truncated_because` and `is_success`; on the unwrapped env,
`newest_jpeg` (bytes of the image as received), `record_clock` and `welcome`.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, cast

import gymnasium as gym
import msgspec
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.contract.env_ref import layouts_of
from shapechanger.demos.episodes import Driver, EpisodeHeader, EpisodeWriter, Step
from shapechanger.demos.episodes.writer import SPARE_BYTES
from shapechanger.demos.jpeg import encode_picture, picture_size
from shapechanger.errors import DemosError, ShapechangerError
from shapechanger.layout import Layout

_PICTURE_DIMENSIONS: Final = 3
_CHANNELS: Final = 3


class EncodedObservation(NamedTuple):
    """An observation in the form in which it is recorded.

    Attributes:
        jpeg: The image; None without one.
        state: The state; NaN where nothing measured a value.
        captured_ns: Capture time on the robot's clock; None if unknown.
    """

    jpeg: bytes | None
    state: tuple[float, ...]
    captured_ns: int | None


class ObservationEncoder:
    """Splits the observations of an env into a JPEG and a state.

    Args:
        env: Its observations are an image, a state, or a Dict of `image` and `state`.
        quality: JPEG quality in percent for images that the env returns as arrays; colours keep
            full resolution.

    Attributes:
        action_layout: Meaning of the values of an action.
        state_layout: Meaning of the values of a state; None without a state.
        has_picture: Whether observations contain images.

    Raises:
        DemosError: If the spaces are of another kind, or the env has no layouts.
    """

    def __init__(self, env: gym.Env[Any, Any], quality: int) -> None:
        if not 1 <= quality <= 100:  # Percent.
            raise DemosError(f"quality must be from 1 to 100 percent, got {quality}.")
        self._env, self._quality = env, quality
        space = env.observation_space
        is_dict = isinstance(space, spaces.Dict)
        self._alone = "" if is_dict else "image" if _is_picture(space) else "state"
        parts: Mapping[str, gym.Space[Any]]
        parts = cast("Any", space).spaces if is_dict else {self._alone: space}
        kinds = {"image": _is_picture, "state": _is_row}
        if not parts or not all(n in kinds and kinds[n](part) for n, part in parts.items()):
            raise DemosError(
                f"{name_of(env)} has the observation space {space}, which cannot be recorded: it "
                "must be an image (uint8, height x width x 3), a vector, or a Dict of both as "
                "`image` and `state`."
            )
        self.has_picture = "image" in parts
        seen, self.action_layout = layouts_of(env)
        numbers = tuple(f for f in seen if len(f.shape) != _PICTURE_DIMENSIONS)
        self.state_layout = Layout(numbers) if "state" in parts else None
        self._places = self.state_layout.slices if self.state_layout else {}
        for kind, part, layout in (
            ("state", parts.get("state"), self.state_layout),
            ("action", env.action_space, self.action_layout),
        ):
            if layout is None or part is None:
                continue
            if not _is_row(part) or part.shape != (layout.size,):
                raise DemosError(
                    f"{name_of(env)}: the {kind} space is {part}, but its layout has {layout.size} "
                    "values."
                )

    def parts(self, observation: Any) -> Mapping[str, Any]:
        """Return the `image` and the `state` of an observation."""
        return {self._alone: observation} if self._alone else observation

    def encode(self, observation: Any, info: Mapping[str, Any]) -> EncodedObservation:
        """Return an observation as it is recorded.

        Args:
            observation: Observation of the env.
            info: The info that came with it.
        """
        parts = self.parts(observation)
        jpeg: bytes | None = None
        if self.has_picture:
            given = getattr(self._env.unwrapped, "newest_jpeg", None)
            jpeg = encode_picture(parts["image"], self._quality) if given is None else given
        state = np.array(parts.get("state", ()), np.float64).ravel()
        for name in info.get("absent", ()):
            if name in self._places:
                state[self._places[name]] = math.nan
        return EncodedObservation(jpeg, tuple(state.tolist()), info.get("captured_ns"))


def name_of(env: gym.Env[Any, Any]) -> str:
    """Return the id of an env, or the name of its class."""
    return env.spec.id if env.spec else type(env.unwrapped).__name__


def _is_picture(space: gym.Space[Any]) -> bool:
    return (
        isinstance(space, spaces.Box)
        and cast("Any", space).dtype == np.uint8
        and len(space.shape) == _PICTURE_DIMENSIONS
        and space.shape[-1] == _CHANNELS
    )


def _is_row(space: gym.Space[Any]) -> bool:
    return isinstance(space, spaces.Box) and len(space.shape) == 1


QUALITY: Final = 95
"""JPEG quality in percent for images that an env returns as arrays."""

_COLLISION: Final = "reward_collision"
_SECRET: Final = frozenset({"key"})
"""Arguments of envs that must not leave this machine with a recording."""


class RecordEpisodes(gym.Wrapper[Any, NDArray[np.float32], Any, NDArray[np.float32]]):
    """Wrapper that records what is observed and done in an env.

    A step holds an observation, the action decided for it, and the outcome. Where a person
    intervened (`info["intervene_action"]`), the person's action is recorded as decided, and the
    action passed to `step` as what a policy wanted.

    If a step cannot be written, the wrapper stops the env with one action that moves nothing, and
    `step` raises the error; everything written before is complete.

    Args:
        env: Its observations are an image, a state, or a Dict of `image` and `state`; it has
            layouts.
        recording: Folder of the recording; created if missing.
        driver: Who decides the actions passed to `step`.
        about: Further fields of the header, such as `robot`, `body`, `source` and `notes`.
        quality: JPEG quality in percent for images that the env returns as arrays.
        spare_bytes: Disk space to leave free.

    Attributes:
        path: Folder of the newest episode; None before the first.
        steps: Number of steps written, over all episodes.
        episodes: Number of episodes begun.
        seconds: Duration of the closed episodes, s.

    Raises:
        DemosError: If the env's observations or actions cannot be recorded.
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
        self._encoder = ObservationEncoder(env, quality)
        self._recording, self._spare_bytes = recording, spare_bytes
        self._by_default: Driver = driver
        self._about = dict(about or {})
        self.path: Path | None = None
        self.steps = 0
        self.episodes = 0
        self.seconds = 0.0
        self._writer: EpisodeWriter | None = None
        self._seen: EncodedObservation | None = None
        self._jpeg: bytes | None = None
        self._start: dict[str, Any] = {}
        self._decision: Step | None = None

    @property
    def control_hz(self) -> float:
        """Steps per second."""
        return float(self.env.metadata.get("render_fps") or 20.0)

    def decide(
        self,
        action: Sequence[float] | NDArray[Any],
        driver: Driver,
        wanted: Sequence[float] | NDArray[Any] | None = None,
    ) -> None:
        """Set the decision for the next step, where it differs from the action passed to `step`.

        Args:
            action: The intended action, which is to be learned.
            driver: Who decided it.
            wanted: What a policy wanted while somebody else drives.
        """
        self._decision = Step(
            action=_numbers(action),
            driver=driver,
            wanted=None if wanted is None else _numbers(wanted),
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, which is created on disk with its first step; close the previous one.

        Args:
            seed: As in `gymnasium.Env.reset`.
            options: As in `gymnasium.Env.reset`.
        """
        self.end()
        observation, info = super().reset(seed=seed, options=options)
        self._seen = self._encoder.encode(observation, info)
        self._start = {"seed": seed, "options": options}
        return observation, info

    def step(self, action: NDArray[np.float32]) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Do a step, and record it.

        Raises:
            OutputError: If the step cannot be written.
            DemosError: If the step is invalid, or another process is recording to the folder.
            ResetNeeded: If the episode is over.
        """
        seen = self._seen
        if seen is None:
            raise gym.error.ResetNeeded("Call reset() before the first step of an episode.")
        # Before the step, so that an unwritable folder is found before anything moves.
        writer = self._writer
        if writer is None or writer.is_full:
            writer = self._begin(seen, writer)
        try:
            observation, reward, terminated, truncated, info = super().step(action)
        except BaseException as error:
            self.end("stopped" if isinstance(error, KeyboardInterrupt) else "failed")
            raise
        over = bool(terminated or truncated)
        try:
            step = msgspec.structs.replace(
                self._decided(action, info),
                state=seen.state,
                captured_ns=seen.captured_ns,
                reward=float(reward),
                terminated=bool(terminated),
                truncated=bool(truncated),
            )
            writer.add(step, seen.jpeg if seen.jpeg != self._jpeg else None)
            self.steps += 1
            self._jpeg = seen.jpeg
            self._seen = None if over else self._encoder.encode(observation, info)
            if over:
                self.end(_outcome(bool(terminated), info))
        except ShapechangerError as error:
            self._give_up(error, over=over)
            raise
        return observation, reward, terminated, truncated, info

    def mark(self, text: str = "") -> None:
        """Mark the newest step, with free text.

        Raises:
            DemosError: If no episode is being recorded.
        """
        if self._writer is None:
            raise DemosError("No episode is being recorded: one begins with the first step.")
        self._writer.mark(text)

    def end(self, outcome: str = "") -> None:
        """Close the episode, if one is open; the env goes on unrecorded until the next reset.

        Args:
            outcome: How the episode ended; "" if unspecified.

        Raises:
            OutputError: If the header cannot be written; all steps are on disk all the same.
        """
        writer, self._writer = self._writer, None
        self._seen = self._jpeg = self._decision = None
        if writer is not None:
            self.seconds += writer.seconds + 1.0 / self.control_hz
            writer.close(outcome)

    def close(self) -> None:
        """Close the env and the episode."""
        try:
            super().close()
        finally:
            self.end()

    def _begin(self, seen: EncodedObservation, full: EpisodeWriter | None) -> EpisodeWriter:
        """Begin an episode, which continues one that is full."""
        self._writer = None  # In case that the next one cannot be created.
        if full is None:
            writer = EpisodeWriter.create(
                self._recording, self._header(seen), spare_bytes=self._spare_bytes
            )
        else:
            self.seconds += full.seconds + 1.0 / self.control_hz
            writer = full.continued()
        self._writer, self.path = writer, writer.path
        self.episodes += 1
        return writer

    def _header(self, seen: EncodedObservation) -> EpisodeHeader:
        spec, inner = self.env.spec, self.env.unwrapped
        clock = getattr(inner, "record_clock", "none")
        layout = self._encoder.state_layout
        notes = dict(self._about.get("notes", {}))
        if self._start["options"]:
            notes["reset_options"] = _plain(self._start["options"])
        kwargs = spec.kwargs if spec else {}
        robot = getattr(inner, "welcome", None)  # Of a robot on the network, or an emulated one.
        facts = ("robot", "body", "camera_pitch_deg", "camera_fovy_deg")
        fields: dict[str, Any] = {n: getattr(robot, n) for n in facts if hasattr(robot, n)}
        fields |= {
            "action_layout": self._encoder.action_layout.to_json(),
            "state_layout": layout.to_json() if layout else "",
            "image_size": picture_size(seen.jpeg, "from the env") if seen.jpeg else None,
            "control_hz": self.control_hz,
            "env": spec.id if spec else "",
            "env_kwargs": _plain({n: v for n, v in kwargs.items() if n not in _SECRET}),
            "driver": self._by_default,
            "clock": clock if seen.captured_ns is not None else "none",
            "seed": self._start["seed"],
        }
        fields |= {**self._about, "notes": notes}
        return EpisodeHeader(**fields)

    def _decided(self, action: Any, info: Mapping[str, Any]) -> Step:
        """Return a step with the decision for it, and what the env did with that."""
        passed, applied = _numbers(action), info.get("action_applied")
        decided = self._decision or Step(action=passed, driver=self._by_default)
        if (by_person := info.get("intervene_action")) is not None:
            decided = Step(action=_numbers(by_person), driver="person", wanted=passed)
        self._decision = None
        return msgspec.structs.replace(
            decided,
            applied=None if applied is None else _numbers(applied),
            decided_ns=info.get("decided_ns"),
            wall_ns=time.time_ns(),
            terms={name: float(value) for name, value in _terms(info).items()},
            stop_reason=str(info.get("stop_reason", "")),
        )

    def _give_up(self, why: ShapechangerError, *, over: bool) -> None:
        """Stop the env, and close the episode, even if either fails."""
        if not over:
            # The action that moves nothing: 0, or the bound nearest to 0.
            box = cast("gym.spaces.Box", self.env.action_space)
            still = np.clip(np.zeros(box.shape), box.low, box.high).astype(np.float32)
            try:
                super().step(still)
            except (ShapechangerError, gym.error.Error) as error:
                why.add_note(f"Stopping the env failed too: {error}")
        try:
            self.end("failed")
        except ShapechangerError as error:
            why.add_note(str(error))


def _numbers(values: Any) -> tuple[float, ...]:
    return tuple(np.asarray(values, np.float64).ravel().tolist())


def _terms(info: Mapping[str, Any]) -> Mapping[str, Any]:
    return cast("Mapping[str, Any]", info.get("reward_terms") or {})


def _outcome(terminated: bool, info: Mapping[str, Any]) -> str:
    """Return how an episode ended."""
    if not terminated:
        return str(info.get("truncated_because") or "time")
    if _terms(info).get(_COLLISION, 0.0) < 0.0:
        return "collision"
    return "success" if info.get("is_success") else "terminated"


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values as JSON can hold them; others as their `str`."""
    return cast("dict[str, Any]", json.loads(json.dumps(dict(values), default=str)))
