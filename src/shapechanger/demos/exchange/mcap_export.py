"""Export of recordings as MCAP, one file for each episode, for players such as Foxglove.

```
/camera    foxglove.CompressedImage   the JPEG as recorded, once for the steps that share it
/state     shapechanger.State         values by name; those that nothing measured are left out
/action    shapechanger.Action        the decided action, by name
/applied, /wanted                     likewise, where they are known
/reward    shapechanger.Reward        the reward and its terms
/step      shapechanger.Step          number, driver, ends, stop reason, marks, why it was dropped
```

Messages are JSON, and their schemas state the units. Log times are those of the robot's clock, ns:
of the capture for pictures and states, of the decision for actions, and never moved. Where a time
is unknown, the step follows the one before at the rate of the episode, or precedes the first one
with a time. The header of the episode is the metadata
`shapechanger`. Format: mcap.dev/spec.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.files import library
from shapechanger.demos.exchange.recorded import ExchangeEpisode, ExchangeStep
from shapechanger.layout import Feature, Layout

_NS_PER_S: Final = 10**9
_CAMERA: Final = "camera"
_TEXT: Final = {"type": "string"}
_TEXTS: Final = {"type": "array", "items": _TEXT}
_WHOLE: Final = {"type": "integer"}
_FLAG: Final = {"type": "boolean"}
_NUMBER: Final = {"type": "number"}
# Foxglove's own, by which its panels know a picture: github.com/foxglove/foxglove-sdk.
_IMAGE: Final = {
    "timestamp": {"type": "object", "properties": {"sec": _WHOLE, "nsec": _WHOLE}},
    "frame_id": _TEXT,
    "data": {"type": "string", "contentEncoding": "base64"},
    "format": _TEXT,
}
_STEP: Final = {
    "step": _WHOLE,
    "driver": _TEXT,
    "terminated": _FLAG,
    "truncated": _FLAG,
    "stop_reason": _TEXT,
    "wall_ns": _WHOLE,
    "marks": _TEXTS,
    "dropped": _TEXT,
}


def write_mcap(episodes: Sequence[ExchangeEpisode], folder: Path) -> int:
    """Write episodes into an existing folder, each to a file of its own.

    Args:
        episodes: The episodes, in the order in which their files are numbered.
        folder: Folder of the files.

    Returns:
        Number of steps in all files.

    Raises:
        MissingExtra: If mcap is not installed.
    """
    steps = 0
    for number, episode in enumerate(episodes, 1):
        with (folder / f"episode-{number:04d}.mcap").open("wb") as file:
            writer = library("mcap.writer").Writer(file)
            writer.start(profile="", library="shapechanger")
            steps += _write(episode, writer)
            header = json.dumps(episode.header.to_json(), ensure_ascii=False)
            about = {"header": _text(header), "outcome": _text(episode.outcome)}
            writer.add_metadata("shapechanger", about)
            writer.finish()
    return steps


def _write(episode: ExchangeEpisode, writer: Any) -> int:
    """Write the messages of an episode; return its number of steps."""
    topics = _Topics(episode.header, writer)
    period_ns = round(_NS_PER_S / episode.header.control_hz)
    waiting: list[ExchangeStep] = []  # Of unknown time, before the first step of a known one.
    at_ns, steps = -period_ns, 0
    for row in episode.rows:
        clock_ns = row.step.clock_ns
        known = clock_ns is not None and clock_ns >= 0  # MCAP has no negative times.
        steps += 1
        if at_ns < 0 and not known and episode.header.clock != "none":
            waiting.append(row)
            continue
        for number, earlier in enumerate(waiting):
            before_ns = cast("int", clock_ns) - (len(waiting) - number) * period_ns
            topics.add(earlier, max(0, before_ns))
        waiting.clear()
        at_ns = cast("int", clock_ns) if known else max(0, at_ns + period_ns)
        topics.add(row, at_ns)
    for number, row in enumerate(waiting):
        topics.add(row, number * period_ns)
    return steps


class _Topics:
    """The channels of one file.

    Args:
        header: Header of the episode.
        writer: An `mcap.writer.Writer`.
    """

    def __init__(self, header: EpisodeHeader, writer: Any) -> None:
        self._writer = writer
        self._actions = Layout.from_json(header.action_layout)
        self._states = Layout.from_json(header.state_layout) if header.state_layout else None
        acts = _properties(self._actions)
        self._channels = {
            name: self._channel(name, "shapechanger.Action", acts)
            for name in ("action", "applied", "wanted")
        }
        self._channels["step"] = self._channel("step", "shapechanger.Step", _STEP)
        terms = {"type": "object", "additionalProperties": _NUMBER}
        worth = {"reward": _NUMBER, "terms": terms}
        self._channels["reward"] = self._channel("reward", "shapechanger.Reward", worth)
        if self._states is not None:
            sensed = _properties(self._states)
            self._channels["state"] = self._channel("state", "shapechanger.State", sensed)
        if header.image_size is not None:
            self._channels[_CAMERA] = self._channel(_CAMERA, "foxglove.CompressedImage", _IMAGE)

    def add(self, row: ExchangeStep, seen_ns: int) -> None:
        """Write the messages of a step.

        Args:
            row: The step.
            seen_ns: Time of its observation.
        """
        step = row.step
        acted_ns = max(seen_ns, step.decided_ns or 0)
        if row.jpeg is not None:
            sec, nsec = divmod(seen_ns, _NS_PER_S)
            picture = {"timestamp": {"sec": sec, "nsec": nsec}, "frame_id": _CAMERA}
            picture |= {"data": base64.b64encode(row.jpeg).decode(), "format": "jpeg"}
            self._send(_CAMERA, picture, seen_ns)
        if self._states is not None:
            self._send("state", _by_name(self._states, step.state), seen_ns)
        for name in ("action", "applied", "wanted"):
            values = getattr(step, name)
            if values is not None:
                self._send(name, _by_name(self._actions, values), acted_ns)
        if step.reward is not None:
            worth = {"reward": _known(step.reward)}
            terms = {name: _known(value) for name, value in step.terms.items()}
            self._send("reward", {**worth, "terms": terms}, acted_ns)
        self._send("step", _about(row, step), acted_ns)

    def _channel(self, topic: str, name: str, properties: Mapping[str, Any]) -> int:
        schema = {"title": name, "type": "object", "properties": properties}
        return self._writer.register_channel(
            topic=f"/{topic}",
            message_encoding="json",
            schema_id=self._writer.register_schema(
                name=name, encoding="jsonschema", data=json.dumps(schema).encode()
            ),
        )

    def _send(self, topic: str, message: Mapping[str, Any], at_ns: int) -> None:
        self._writer.add_message(
            channel_id=self._channels[topic],
            log_time=at_ns,
            publish_time=at_ns,
            data=json.dumps(message, allow_nan=False).encode(),
        )


def _about(row: ExchangeStep, step: Step) -> dict[str, Any]:
    """Return everything about a step that is no number of a layout; what is empty is left out."""
    about: dict[str, Any] = {"step": step.index, "driver": step.driver}
    about |= {"terminated": step.terminated, "truncated": step.truncated}
    if step.stop_reason:
        about["stop_reason"] = step.stop_reason
    if step.wall_ns is not None:
        about["wall_ns"] = step.wall_ns
    if row.marks:
        about["marks"] = list(row.marks)
    if row.dropped is not None:
        about["dropped"] = row.dropped
    return about


def _properties(layout: Layout) -> dict[str, Any]:
    """Return the JSON schema of each feature, with its unit and range as description."""
    return {
        feature.name: {"description": _range(feature)}
        | ({"type": "array", "items": _NUMBER} if feature.shape else _NUMBER)
        for feature in layout
    }


def _range(feature: Feature) -> str:
    bounds = [feature.low, feature.high]
    ends = ("" if math.isinf(bound) else f"{bound:g}" for bound in bounds)
    return f"[{feature.unit}] {' to '.join(ends)}".rstrip()


def _by_name(layout: Layout, values: Sequence[float]) -> dict[str, Any]:
    """Return values by the name of their feature; a number that is not finite is left out."""
    found: dict[str, Any] = {}
    for feature, place in zip(layout, layout.slices.values(), strict=True):
        part = [_known(value) for value in values[place]]
        if feature.shape:
            found[feature.name] = part
        elif part[0] is not None:
            found[feature.name] = part[0]
    return found


def _known(value: float) -> float | None:
    """Return a number as JSON can hold it: null if it is not finite."""
    return value if math.isfinite(value) else None


def _text(value: str) -> str:
    """Replace characters that have no UTF-8 encoding."""
    return value.encode(errors="replace").decode()
