"""What was recorded: the file `episode.json`."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Final, Literal, cast

from shapechanger.errors import DemosError

__all__ = ["FORMAT", "Clock", "EpisodeHeader"]

FORMAT: Final = 1
"""Version of the format; a reader refuses another one."""

Clock = Literal["real", "twin", "none"]
"""Where the nanoseconds of the steps come from: a robot's clock, that of a twin whose time moves in
steps, or nowhere."""

_CLOCKS: Final = ("real", "twin", "none")
_IMAGE_SIZE: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeHeader:
    """What an episode is of.

    Attributes:
        action_layout: JSON of the `Layout` of the actions.
        state_layout: JSON of the `Layout` of the states; "" without states.
        image_size: Width and height of the pictures in pixels; None without pictures.
        control_hz: Steps a second.
        robot: Name of the robot.
        body: What it is, such as "car".
        env: Id of the env; "" for a robot that was driven without one.
        env_kwargs: Its arguments, as JSON can hold them.
        driver: Who drives, for people to read.
        clock: Where the nanoseconds of the steps come from.
        seed: Seed of the first reset; None for none.
        source: What made it: a command, or the format it was imported from.
        notes: More, for people to read, as JSON can hold it.
        created: When it began, ISO 8601 in UTC; the writer fills it in.
        version: Version of Shapechanger that wrote it; the writer fills it in.
        format: Version of the format.

    Raises:
        DemosError: If it contradicts itself.
    """

    action_layout: str
    state_layout: str = ""
    image_size: tuple[int, int] | None = None
    control_hz: float = 20.0
    robot: str = ""
    body: str = ""
    env: str = ""
    env_kwargs: dict[str, Any] = field(default_factory=dict[str, Any])
    driver: str = ""
    clock: Clock = "real"
    seed: int | None = None
    source: str = ""
    notes: dict[str, Any] = field(default_factory=dict[str, Any])
    created: str = ""
    version: str = ""
    format: int = FORMAT

    def __post_init__(self) -> None:
        if not (self.control_hz > 0.0 and math.isfinite(self.control_hz)):
            raise DemosError(f"An episode has steps at more than 0 Hz, got {self.control_hz}.")
        if self.clock not in _CLOCKS:
            raise DemosError(f"The clock is one of {', '.join(_CLOCKS)}, got {self.clock!r}.")
        if self.image_size is not None and (
            len(self.image_size) != _IMAGE_SIZE or min(self.image_size) < 1
        ):
            raise DemosError(f"Pictures cannot have a size of {self.image_size}.")
        if self.action_size < 1:
            raise DemosError("An action has at least one number.")
        _ = self.state_size

    @property
    def action_size(self) -> int:
        """How many numbers an action has."""
        return _layout_size(self.action_layout)

    @property
    def state_size(self) -> int:
        """How many numbers a state has."""
        return _layout_size(self.state_layout) if self.state_layout else 0

    def to_json(self) -> dict[str, Any]:
        """The header as JSON can hold it, with the layouts spelled out for people to read."""
        plain = asdict(self)
        for name in ("action_layout", "state_layout"):
            plain[name] = json.loads(plain[name]) if plain[name] else None
        plain["image_size"] = None if self.image_size is None else list(self.image_size)
        return plain

    @classmethod
    def from_json(cls, plain: dict[str, Any]) -> EpisodeHeader:
        """Read what `to_json` gave; what is not known is left out.

        Raises:
            DemosError: If it is no header.
        """
        if plain.get("format") != FORMAT:
            raise DemosError(
                f"the episode has format {plain.get('format')}, and this version of Shapechanger "
                f"reads format {FORMAT}."
            )
        known = {name: plain[name] for name in (f.name for f in fields(cls)) if name in plain}
        try:
            for name in ("action_layout", "state_layout"):
                known[name] = _compact(known[name])
            if known.get("image_size") is not None:
                width, height = known["image_size"]
                known["image_size"] = (int(width), int(height))
            return cls(**known)
        except (KeyError, TypeError, ValueError) as error:
            raise DemosError(f"the header is not whole ({error}).") from error


def _compact(layout: dict[str, Any] | None) -> str:
    """A layout as `Layout.to_json` writes it; "" for none."""
    return json.dumps(layout, separators=(",", ":"), ensure_ascii=False) if layout else ""


def _layout_size(layout: str) -> int:
    """How many numbers a layout has, without what reading layouts loads."""
    try:
        features = cast("list[dict[str, Any]]", json.loads(layout)["features"])
        return sum(math.prod(feature.get("shape", ())) for feature in features)
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise DemosError(f"This is no layout: {layout[:80]!r}.") from error
