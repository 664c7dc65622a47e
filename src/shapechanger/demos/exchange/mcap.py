"""Export of recordings as MCAP, one file for each episode, for players such as Foxglove.

```
/camera    foxglove.CompressedImage   the JPEG as recorded, once for the steps that share it
/state     shapechanger.State         values by name; those that nothing measured are left out
/action    shapechanger.Action        the decided action, by name
/applied, /wanted                     the same, where they are known
/reward    shapechanger.Reward        the reward and its terms
/step      shapechanger.Step          number, driver, ends, stop reason, marks, why it was dropped
```

Messages are JSON, and their schemas state the units. Log times are on the robot's clock, ns:
of the capture for images and states, of the decision for actions, and never moved. Where a time
is unknown, the step follows the one before at the rate of the episode, or precedes the first one
with a time. The header of the episode is the metadata
`shapechanger`. Format: mcap.dev/spec.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.exchange.files import library
from shapechanger.demos.exchange.format import ExchangeEpisode, ExchangeStep, ExportContext, Format
from shapechanger.layout import Layout

_NS_PER_S: Final = 10**9
_TEXT: Final = {"type": "string"}
_WHOLE: Final = {"type": "integer"}
_NUMBER: Final = {"type": "number"}
# Foxglove's own, by which its panels know an image: github.com/foxglove/foxglove-sdk.
_IMAGE: Final[dict[str, Any]] = {
    "timestamp": {"type": "object", "properties": {"sec": _WHOLE, "nsec": _WHOLE}},
    "frame_id": _TEXT,
    "data": {"type": "string", "contentEncoding": "base64"},
    "format": _TEXT,
}
_STEP: Final[dict[str, Any]] = {
    **{name: _WHOLE for name in ("step", "wall_ns")},
    **{name: _TEXT for name in ("driver", "stop_reason", "dropped")},
    **{name: {"type": "boolean"} for name in ("terminated", "truncated")},
    "marks": {"type": "array", "items": _TEXT},
}
_REWARD: Final[dict[str, Any]] = {
    "reward": _NUMBER,
    "terms": {"type": "object", "additionalProperties": _NUMBER},
}


def _write(episodes: Sequence[ExchangeEpisode], folder: Path, _: ExportContext) -> int:
    """Write episodes, each to a file of its own; return the number of steps."""
    steps = 0
    for number, episode in enumerate(episodes, 1):
        with (folder / f"episode-{number:04d}.mcap").open("wb") as file:
            writer = library("mcap.writer").Writer(file)
            writer.start(profile="", library="shapechanger")
            steps += _write_episode(episode, writer)
            outcome = episode.outcome.encode(errors="replace").decode()  # A lone surrogate.
            about = {"header": json.dumps(episode.header.to_json()), "outcome": outcome}
            writer.add_metadata("shapechanger", about)
            writer.finish()
    return steps


def _write_episode(episode: ExchangeEpisode, writer: Any) -> int:
    """Write the messages of an episode; return its number of steps."""
    header = episode.header
    actions = Layout.from_json(header.action_layout)
    states = Layout.from_json(header.state_layout) if header.state_layout else None
    schemas = {topic: ("Action", _properties(actions)) for topic in ("action", "applied", "wanted")}
    schemas |= {"step": ("Step", _STEP), "reward": ("Reward", _REWARD)}
    if states is not None:
        schemas["state"] = ("State", _properties(states))
    schemas = {topic: (f"shapechanger.{name}", parts) for topic, (name, parts) in schemas.items()}
    if header.image_size is not None:
        schemas["camera"] = ("foxglove.CompressedImage", _IMAGE)
    channels: dict[str, int] = {}
    for topic, (name, properties) in schemas.items():
        schema = {"title": name, "type": "object", "properties": properties}
        data = json.dumps(schema).encode()
        number = writer.register_schema(name=name, encoding="jsonschema", data=data)
        channels[topic] = writer.register_channel(
            topic=f"/{topic}", message_encoding="json", schema_id=number
        )
    steps = 0
    for row, seen_ns in _timed(episode):
        steps += 1
        acted_ns = max(seen_ns, row.step.decided_ns or 0)
        for topic, message in _messages(row, seen_ns, actions, states).items():
            at_ns = seen_ns if topic in {"camera", "state"} else acted_ns
            data = json.dumps(message, allow_nan=False).encode()
            writer.add_message(channels[topic], log_time=at_ns, publish_time=at_ns, data=data)
    return steps


def _timed(episode: ExchangeEpisode) -> Iterator[tuple[ExchangeStep, int]]:
    """Yield the steps, each with the time of its observation, ns."""
    period_ns = round(_NS_PER_S / episode.header.control_hz)
    waiting: list[ExchangeStep] = []  # Of unknown time, before the first step of a known one.
    at_ns = -period_ns
    for row in episode.rows:
        clock_ns = row.step.clock_ns
        known = clock_ns is not None and clock_ns >= 0  # MCAP has no negative times.
        if at_ns < 0 and not known and episode.header.clock != "none":
            waiting.append(row)
            continue
        at_ns = cast("int", clock_ns) if known else max(0, at_ns + period_ns)
        for number, earlier in enumerate(waiting):
            yield earlier, max(0, at_ns - (len(waiting) - number) * period_ns)
        waiting.clear()
        yield row, at_ns
    for number, row in enumerate(waiting):
        yield row, number * period_ns


def _messages(
    row: ExchangeStep, seen_ns: int, actions: Layout, states: Layout | None
) -> dict[str, dict[str, Any]]:
    step = row.step
    found: dict[str, dict[str, Any]] = {}
    if row.jpeg is not None:
        sec, nsec = divmod(seen_ns, _NS_PER_S)
        found["camera"] = {
            "timestamp": {"sec": sec, "nsec": nsec},
            "frame_id": "camera",
            "data": base64.b64encode(row.jpeg).decode(),
            "format": "jpeg",
        }
    if states is not None:
        found["state"] = _by_name(states, step.state)
    for name in ("action", "applied", "wanted"):
        if (values := getattr(step, name)) is not None:
            found[name] = _by_name(actions, values)
    if step.reward is not None:
        terms = {name: _known(value) for name, value in step.terms.items()}
        found["reward"] = {"reward": _known(step.reward), "terms": terms}
    about = {"step": step.index, "driver": step.driver}
    about |= {"terminated": step.terminated, "truncated": step.truncated}
    more = {"stop_reason": step.stop_reason or None, "wall_ns": step.wall_ns}
    more |= {"marks": list(row.marks) or None, "dropped": row.dropped}
    found["step"] = about | {name: value for name, value in more.items() if value is not None}
    return found


def _properties(layout: Layout) -> dict[str, Any]:
    """Return the JSON schema of each feature, with its unit and range as description."""
    found: dict[str, Any] = {}
    for feature in layout:
        bounds = (feature.low, feature.high)
        ends = ("" if math.isinf(bound) else f"{bound:g}" for bound in bounds)
        about = {"description": f"[{feature.unit}] {' to '.join(ends)}".rstrip()}
        kind = {"type": "array", "items": _NUMBER} if feature.shape else _NUMBER
        found[feature.name] = about | kind
    return found


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


FORMAT: Final = Format(name="mcap", title="MCAP", write=_write, options=frozenset({"dropped"}))
