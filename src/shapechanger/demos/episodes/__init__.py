"""Episodes on disk: observations, actions and images, step by step, safe against crashes.

A recording is a folder of episodes; the folder of a single episode is a recording too:

```
DATA/20261121T103005Z-0001/
  episode.json    header; written atomically when the episode begins and again when it is closed
  steps.jsonl     append-only; each line is a JSON object whose last key is its own CRC-32
  frames/         images, as JPEG, byte for byte as received
  lost/           invalid lines and unused images that `repair` moved aside
```

The lines of `steps.jsonl` are steps (`"kind": "step"`), marks (`"mark"`), and ranges of steps that
are excluded or included again (`"drop"`, `"keep"`); recorded lines are never rewritten. Robots
write episodes, too, so this package has few dependencies.
"""

from __future__ import annotations

from shapechanger.demos.episodes.reader import (
    Episode,
    edit,
    episode_at,
    episodes_of,
    merge,
    read_episode,
    read_outline,
    repair,
)
from shapechanger.demos.episodes.records import (
    DRIVERS,
    Driver,
    Drop,
    EpisodeHeader,
    EpisodeMark,
    Keep,
    Step,
)
from shapechanger.demos.episodes.writer import EpisodeWriter

__all__ = [
    "DRIVERS",
    "Driver",
    "Drop",
    "Episode",
    "EpisodeHeader",
    "EpisodeMark",
    "EpisodeWriter",
    "Keep",
    "Step",
    "edit",
    "episode_at",
    "episodes_of",
    "merge",
    "read_episode",
    "read_outline",
    "repair",
]
