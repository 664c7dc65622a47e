"""Small episodes for tests, with images of a few bytes."""

from pathlib import Path
from typing import Any

from shapechanger.demos.episodes import EpisodeHeader, EpisodeWriter, Step
from shapechanger.layout import Feature, Layout

ACTIONS = Layout((Feature("steering", "1", -1.0, 1.0), Feature("throttle", "1", -1.0, 1.0)))
STATES = Layout((Feature("effort", "N·m"), Feature("distance", "m", 0.0)))


def header(**changes: Any) -> EpisodeHeader:
    fields: dict[str, Any] = {
        "action_layout": ACTIONS,
        "state_layout": STATES,
        "image_size": (160, 120),
        "robot": "car",
    }
    return EpisodeHeader(**(fields | changes))


def step(number: int = 0, **changes: Any) -> Step:
    fields: dict[str, Any] = {
        "action": (0.1, 0.2),
        "driver": "person",
        "state": (1.0, 2.0),
        "captured_ns": 50_000_000 * number,
        "decided_ns": 50_000_000 * number + 1_000_000,
    }
    return Step(**(fields | changes))


def picture(number: int = 0) -> bytes:
    """Return bytes that start like a JPEG, different for each number."""
    return b"\xff\xd8" + number.to_bytes(4, "big") * 50


def recorded(recording: Path, steps: int = 5, *, close: bool = True) -> Path:
    """Record an episode with one image per step; leave it unclosed on request."""
    with EpisodeWriter.create(recording, header(), spare_bytes=0) as writer:
        begun = (writer.path / "episode.json").read_bytes()
        for number in range(steps):
            writer.add(step(number), picture(number))
    if not close:
        (writer.path / "episode.json").write_bytes(begun)
    return writer.path
