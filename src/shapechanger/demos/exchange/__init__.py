"""Recordings of others, in and out.

```
2017     a folder with labels.csv and JPEGs: which of four keys was held    in and out
tub      Donkeycar's tubs, version 2 and the older version 1                in; version 2 out
minari   the datasets of the Gymnasium family                               in and out
csv      steps.csv, header.json and frames/                                 in and out
```

What is read is never changed, and what is written appears whole or not at all.
"""

from __future__ import annotations

from shapechanger.demos.exchange.convert import (
    Exported,
    Imported,
    export_recording,
    import_episodes,
    import_recording,
)
from shapechanger.demos.exchange.formats import FORMATS, Format, find_format

__all__ = [
    "FORMATS",
    "Exported",
    "Format",
    "Imported",
    "export_recording",
    "find_format",
    "import_episodes",
    "import_recording",
]
