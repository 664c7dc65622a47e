"""Record episodes of a Gymnasium env that publishes layouts, one per reset.

In addition to observations and actions, a recording keeps these if the env has them: in `info`,
`captured_ns`, `decided_ns`, `action_applied`, `intervene_action`, `absent` (names of missing state
values), `reward_terms`, `stop_reason`, `truncated_because` and `is_success`; on the unwrapped env,
`newest_jpeg` (bytes of the image as received), `record_clock` and `welcome`.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym
import msgspec
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.contract.env_ref import layouts_of
from shapechanger.demos.episodes import Driver, EpisodeHeader, EpisodeWriter, Step
from shapechanger.demos.jpeg import encode_picture, picture_size
from shapechanger.errors import DemosError, ShapechangerError
from shapechanger.layout import Layout

_PICTURE_DIMENSIONS: Final = 3
_QUALITY: Final = 95  # JPEG quality of images that an env returns as arrays, percent.


class ObservationEncoder:
    """Splits the observations of an env into a JPEG and a state.

    Args:
        env: Env whose observations are an image, a state, or a Dict of `image` and `state`.

    Attributes:
        action_layout: Meaning of the values of an action.
        state_layout: Meaning of the values of a state; None without a state.
        has_picture: Whether observations contain images.

    Raises:
        DemosError: If a space is of another kind.
        LayoutError: If the env publishes no layouts.
    """

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        self._env = env
        seen, self.action_layout = layouts_of(env)
        numbers = Layout(tuple(f for f in seen if len(f.shape) != _PICTURE_DIMENSIONS))
        space: Any = env.observation_space
        self._alone = "image" if len(space.shape or ()) == _PICTURE_DIMENSIONS else "state"
        if isinstance(space, spaces.Dict):
            self._alone = ""
        parts: dict[str, Any] = {**self.parts(space), "action": cast("Any", env.action_space)}
        self.has_picture = "image" in parts
        self.state_layout = numbers if "state" in parts else None
        shapes = {"state": (numbers.size,), "action": (self.action_layout.size,)}
        for kind, part in parts.items():
            is_image = kind == "image" and part.dtype == np.uint8 and part.shape[2:] == (3,)
            if not isinstance(part, spaces.Box) or not (is_image or part.shape == shapes.get(kind)):
                raise DemosError(
                    f"The {kind} space of {name_of(env)} is {part}, which cannot be recorded: an "
                    "`image` is uint8, height x width x 3, and a `state` or an action is a vector "
                    "as long as its layout."
                )

    def parts(self, observation: Any) -> Mapping[str, Any]:
        """Return the `image` and the `state` of an observation."""
        return {self._alone: observation} if self._alone else observation

    def encode(
        self, observation: Any, info: Mapping[str, Any]
    ) -> tuple[bytes | None, tuple[float, ...]]:
        """Return the JPEG of an observation, None without images, and its state.

        Values that were not measured, according to `info["absent"]`, are NaN.
        """
        parts = self.parts(observation)
        jpeg: bytes | None = None
        if self.has_picture:
            given = getattr(self._env.unwrapped, "newest_jpeg", None)
            jpeg = encode_picture(parts["image"], _QUALITY) if given is None else given
        state = np.array(parts.get("state", ()), np.float64).ravel()
        places = self.state_layout.slices if self.state_layout else {}
        for name in places.keys() & info.get("absent", ()):
            state[places[name]] = math.nan
        return jpeg, tuple(state.tolist())


def name_of(env: gym.Env[Any, Any]) -> str:
    """Return the id of an env, or the name of its class."""
    return env.spec.id if env.spec else type(env.unwrapped).__name__


class RecordEpisodes(gym.Wrapper[Any, NDArray[np.float32], Any, NDArray[np.float32]]):
    """Wrapper that records the observations and actions of an env.

    A step holds an observation, the action decided for it, the reward and further results. If a
    person intervened (`info["intervene_action"]`), the person's action is recorded as decided, and
    the action passed to `step` as the action of a policy.

    If a step cannot be written and the env has not ended, the wrapper stops the env with one action
    at rest. `step` raises the error; all earlier steps are complete.

    Args:
        env: Env with layouts, whose observations are an image, a state, or a Dict of `image` and
            `state`.
        recording: Folder of the recording; created if missing.
        driver: Kind of driver that decides the actions passed to `step`.
        about: Further fields of the header, such as `robot`, `body`, `source` and `notes`.

    Attributes:
        path: Folder of the newest episode; None before the first.
        steps: Number of steps written, over all episodes.
        episodes: Number of episodes begun.

    Raises:
        DemosError: If the env's observations or actions cannot be recorded.
        LayoutError: If the env publishes no layouts.
    """

    def __init__(
        self,
        env: gym.Env[Any, NDArray[np.float32]],
        recording: Path,
        *,
        driver: Driver = "program",
        about: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(env)
        self._encoder = ObservationEncoder(env)
        self._recording = recording
        self._by_default: Driver = driver
        self._about = dict(about or {})
        self.path: Path | None = None
        self.steps = 0
        self.episodes = 0
        # Header of the episode, from a reset to the end; its writer, from the first step on.
        self._header: EpisodeHeader | None = None
        self._writer: EpisodeWriter | None = None
        # For the next step: JPEG of the observation; its state and time; decision, if it was set.
        self._jpeg: bytes | None = None
        self._seen: dict[str, Any] = {}
        self._decision: Step | None = None

    def decide(self, decision: Step) -> None:
        """Set the decision for the next step, if it differs from the action passed to `step`.

        Args:
            decision: The intended `action`, which is to be learned; its `driver`; and the action
                `wanted` by a policy while another driver drives.
        """
        self._decision = decision

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
        self._see(observation, info)
        spec, inner, layout = self.env.spec, self.env.unwrapped, self._encoder.state_layout
        kwargs = dict(spec.kwargs) if spec else {}
        kwargs.pop("key", None)  # A secret.
        robot = getattr(inner, "welcome", None)  # Envs of robots, also of simulated ones, have it.
        pitch_deg, fovy_deg = getattr(robot, "camera_deg", (None, None))
        has_clock = self._seen["captured_ns"] is not None
        fields: dict[str, Any] = {
            **{name: getattr(robot, name, "") for name in ("robot", "body")},
            "camera_pitch_deg": pitch_deg,
            "camera_fovy_deg": fovy_deg,
            "action_layout": self._encoder.action_layout,
            "state_layout": layout or Layout(()),
            "image_size": picture_size(self._jpeg, "from the env") if self._jpeg else None,
            "control_hz": float(self.env.metadata.get("render_fps") or 20.0),
            "env": spec.id if spec else "",
            # Values that JSON lacks become their `str`.
            "env_kwargs": json.loads(json.dumps(kwargs, default=str)),
            "driver": self._by_default,
            "clock": getattr(inner, "record_clock", "none") if has_clock else "none",
            "seed": seed,
            **self._about,
        }
        if options:
            plain = json.loads(json.dumps(dict(options), default=str))
            fields["notes"] = {**fields.get("notes", {}), "reset_options": plain}
        self._header = EpisodeHeader(**fields)
        return observation, info

    def _see(self, observation: Any, info: Mapping[str, Any]) -> None:
        self._jpeg, state = self._encoder.encode(observation, info)
        self._seen = {"state": state, "captured_ns": info.get("captured_ns")}

    def step(self, action: NDArray[np.float32]) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Do a step, and record it.

        Raises:
            OutputError: If the step cannot be written.
            DemosError: If the step is invalid, or another process is recording to the folder.
            ResetNeeded: If the episode is over.
        """
        if self._header is None:
            raise gym.error.ResetNeeded("Call reset() before the first step of an episode.")
        writer, self._writer = self._writer, None  # Stays None if no new writer can be made.
        if writer is None:  # Check the folder before the env moves.
            writer = EpisodeWriter.create(self._recording, self._header)
        elif writer.is_full:
            writer = writer.continued()
        self.episodes += writer.path != self.path
        self._writer, self.path = writer, writer.path
        try:
            observation, reward, terminated, truncated, info = super().step(action)
        except BaseException as error:
            self.end("stopped" if isinstance(error, KeyboardInterrupt) else "failed")
            raise
        decided = self._decision or Step(action=row(action), driver=self._by_default)
        if (by_person := info.get("intervene_action")) is not None:
            decided = Step(action=row(by_person), driver="person", wanted=row(action))
        applied, self._decision = info.get("action_applied"), None
        terms = cast("dict[str, Any]", info.get("reward_terms") or {})
        try:
            step = msgspec.structs.replace(
                decided,
                **self._seen,
                applied=None if applied is None else row(applied),
                decided_ns=info.get("decided_ns"),
                wall_ns=time.time_ns(),
                reward=float(reward),
                terms={name: float(value) for name, value in terms.items()},
                terminated=bool(terminated),
                truncated=bool(truncated),
                stop_reason=str(info.get("stop_reason", "")),
            )
            writer.add(step, self._jpeg)
            self.steps += 1
            if terminated or truncated:
                self.end(_outcome(step, info))
            else:
                self._see(observation, info)
        except ShapechangerError as error:
            if not (terminated or truncated):
                self._stop(error)
            with suppress(ShapechangerError):  # If this fails, `demos repair` closes the episode.
                self.end("failed")
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
        """Close the episode, if one is open; `step` needs a reset afterwards.

        Args:
            outcome: How the episode ended; "" if unspecified.

        Raises:
            OutputError: If the header cannot be written; all steps are on disk nevertheless.
        """
        writer, self._writer = self._writer, None
        self._header = self._decision = None
        if writer is not None:
            writer.close(outcome)

    def close(self) -> None:
        """Close the env and the episode."""
        try:
            super().close()
        finally:
            self.end()

    def _stop(self, why: ShapechangerError) -> None:
        """Do a step with the action at rest: 0, or the bound nearest to 0."""
        box = cast("gym.spaces.Box", self.env.action_space)
        try:
            super().step(np.clip(np.zeros(box.shape), box.low, box.high).astype(np.float32))
        except (ShapechangerError, gym.error.Error) as error:
            why.add_note(f"Stopping the env failed, too: {error}")


def row(values: Any) -> tuple[float, ...]:
    """Return the values of an array as a tuple."""
    return tuple(np.asarray(values, np.float64).ravel().tolist())


def _outcome(step: Step, info: Mapping[str, Any]) -> str:
    """Return how an episode ended."""
    if not step.terminated:
        return str(info.get("truncated_because") or "time")
    if step.terms.get("reward_collision", 0.0) < 0.0:
        return "collision"
    return "success" if info.get("is_success") else "terminated"
