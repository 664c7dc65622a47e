"""Export of recordings as MCAP, one file for each episode, for players such as Foxglove.

```
/camera    foxglove.CompressedImage   the JPEG as recorded, once for the steps that share it
/state     shapechanger.State         values, keyed by name, without values that were not measured
/action    shapechanger.Action        the decided action, keyed by name
/applied, /wanted                     the applied and the wanted action, if known
/reward    shapechanger.Reward        the reward and its terms
/step      shapechanger.Step          number, driver, ends, stop reason, marks, why it was dropped
```

Messages are JSON, and their schemas state the units. Log times are unchanged times of the robot's
clock, ns: of the capture for images and states, and of the decision for other messages. A step
with an unknown time follows the step before after one period; a first step is at 0. The header of
the episode is the metadata `shapechanger`. Format: mcap.dev/spec.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from shapechanger.demos.exchange.base import ExchangeEpisode, ExchangeRecord, ExportContext, Format
from shapechanger.demos.exchange.files import library
from shapechanger.layout import Layout

_NS_PER_S: Final = 10**9
_TEXT, _WHOLE, _NUMBER, _FLAG = (
    {"type": kind} for kind in ("string", "integer", "number", "boolean")
)
_SCHEMAS: Final[dict[str, dict[str, Any]]] = {
    "reward": {"reward": _NUMBER, "terms": {"type": "object"}},
    "step": {
        **dict.fromkeys(("step", "wall_ns"), _WHOLE),
        **dict.fromkeys(("driver", "stop_reason", "dropped"), _TEXT),
        **dict.fromkeys(("terminated", "truncated"), _FLAG),
        "marks": {"type": "array", "items": _TEXT},
    },
    # Foxglove's schema, by which its panels recognize images: github.com/foxglove/foxglove-sdk.
    "camera": {
        "timestamp": {"type": "object", "properties": {"sec": _WHOLE, "nsec": _WHOLE}},
        **dict.fromkeys(("frame_id", "format"), _TEXT),
        "data": {"type": "string", "contentEncoding": "base64"},
    },
}
_KINDS: Final = {
    "camera": "foxglove.CompressedImage",
    **{topic: f"shapechanger.{topic.title()}" for topic in ("state", "reward", "step")},
    **dict.fromkeys(("action", "applied", "wanted"), "shapechanger.Action"),
}


def _write(episodes: Sequence[ExchangeEpisode], folder: Path, _: ExportContext) -> int:
    """Write each episode to a separate file, and return the number of steps."""
    steps = 0
    for number, episode in enumerate(episodes, 1):
        with (folder / f"episode-{number:04d}.mcap").open("wb") as file:
            writer = library("mcap.writer").Writer(file)
            writer.start(profile="", library="shapechanger")
            steps += _write_messages(episode, writer)
            outcome = episode.outcome.encode(errors="replace").decode()  # Lone surrogates.
            about = {"header": json.dumps(episode.header.to_json()), "outcome": outcome}
            writer.add_metadata("shapechanger", about)
            writer.finish()
    return steps


def _write_messages(episode: ExchangeEpisode, writer: Any) -> int:
    header, steps, channels = episode.header, 0, dict[str, int]()
    layouts = {"state": header.state_layout} if header.state_layout else {}
    layouts |= dict.fromkeys(("action", "applied", "wanted"), header.action_layout)
    schemas: dict[str, dict[str, Any]] = {}
    for topic, layout in layouts.items():
        schemas[topic] = {}
        for feature in layout:
            ends = ("" if math.isinf(end) else f"{end:g}" for end in (feature.low, feature.high))
            about = {"description": f"[{feature.unit}] {' to '.join(ends)}".rstrip()}
            kind = {"type": "array", "items": _NUMBER} if feature.shape else _NUMBER
            schemas[topic][feature.name] = about | kind
    for topic, properties in (schemas | _SCHEMAS).items():
        schema = {"title": _KINDS[topic], "type": "object", "properties": properties}
        text = json.dumps(schema).encode()
        number = writer.register_schema(_KINDS[topic], "jsonschema", text)
        channels[topic] = writer.register_channel(f"/{topic}", "json", number)
    period_ns = round(_NS_PER_S / header.control_hz)
    seen_ns, shown = -period_ns, None
    for steps, record in enumerate(episode.records, 1):  # noqa: B007
        clock_ns = record.step.clock_ns
        if clock_ns is None or clock_ns < 0:  # MCAP has no negative times.
            clock_ns = max(0, seen_ns + period_ns)
        seen_ns = clock_ns
        acted_ns = max(seen_ns, record.step.decided_ns or 0)
        for topic, message in _messages(record, record.jpeg is not shown, seen_ns, layouts):
            at_ns = seen_ns if topic in {"camera", "state"} else acted_ns
            data = json.dumps(message, allow_nan=False).encode()
            writer.add_message(channels[topic], log_time=at_ns, publish_time=at_ns, data=data)
        shown = record.jpeg
    return steps


def _messages(
    record: ExchangeRecord, is_new: bool, seen_ns: int, layouts: Mapping[str, Layout]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the topic and the content of each message of a step."""
    step = record.step
    if is_new and record.jpeg is not None:
        sec, nsec = divmod(seen_ns, _NS_PER_S)
        about = {"timestamp": {"sec": sec, "nsec": nsec}, "frame_id": "camera", "format": "jpeg"}
        yield "camera", about | {"data": base64.b64encode(record.jpeg).decode()}
    for topic, layout in layouts.items():
        if (values := getattr(step, topic)) is not None:
            parts = {n: list(map(_known, values[place])) for n, place in layout.slices.items()}
            named = {f.name: parts[f.name] if f.shape else parts[f.name][0] for f in layout}
            # A single number that is not finite is left out.
            yield topic, {name: part for name, part in named.items() if part is not None}
    if step.reward is not None:
        terms = {name: _known(value) for name, value in step.terms.items()}
        yield "reward", {"reward": _known(step.reward), "terms": terms}
    plain = {name: value for name, value in step.to_json().items() if name in _SCHEMAS["step"]}
    plain |= {"terminated": step.terminated, "truncated": step.truncated}
    plain |= {"marks": record.marks} if record.marks else {}
    yield "step", plain | ({} if record.dropped is None else {"dropped": record.dropped})


def _known(value: float) -> float | None:
    """Return a number, or None (JSON's null) if it is not finite."""
    return value if math.isfinite(value) else None


FORMAT: Final = Format(name="mcap", title="MCAP", write=_write, options=frozenset({"dropped"}))
