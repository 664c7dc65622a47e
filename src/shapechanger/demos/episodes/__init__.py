"""Episodes on disk: what was seen, decided and done, step by step, safe from a crash at any byte.

A recording is a folder of episodes; the folder of one episode is a recording, too:

```
DATA/20261121T103005Z-0001/
  episode.json    what was recorded; written whole when it begins, and once more when it is closed
  steps.jsonl     grows only; each line is a JSON object whose last key is its own CRC-32
  frames/         pictures, as JPEG and exactly as they were received
  lost/           what `repair` took out; there only if there was something
```

The lines of `steps.jsonl` are steps (`"kind": "step"`), marks, and steps that were dropped or taken
back (`"drop"`, `"keep"`): nothing that was recorded is ever rewritten. The standard library is all
that is needed, because robots record, too.
"""

from __future__ import annotations

from shapechanger.demos.episodes.reader import (
    Episode,
    EpisodeMark,
    Repair,
    drop,
    episodes_of,
    keep,
    mark,
    read_episode,
    repair,
)
from shapechanger.demos.episodes.records import DRIVERS, Driver, EpisodeHeader, Step
from shapechanger.demos.episodes.writer import EpisodeWriter

__all__ = [
    "DRIVERS",
    "Driver",
    "Episode",
    "EpisodeHeader",
    "EpisodeMark",
    "EpisodeWriter",
    "Repair",
    "Step",
    "drop",
    "episodes_of",
    "keep",
    "mark",
    "read_episode",
    "repair",
]
