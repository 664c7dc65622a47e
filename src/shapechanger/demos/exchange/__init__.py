"""Import and export of recordings in other formats.

```
2017     a folder with labels.csv and JPEGs: which of four keys was held    in and out
tub      Donkeycar tubs, version 2 and the older version 1                  in; version 2 out
minari   datasets of the Gymnasium family                                   in and out
lerobot  datasets of LeRobot, version 3: Parquet and video                  in and out
csv      steps.csv, header.json and frames/                                 in and out
mcap     a log of messages for each episode                                 out
```

Sources are never changed, and targets appear atomically.
"""

from __future__ import annotations

from shapechanger.demos.exchange.convert import (
    FORMATS,
    Exported,
    Format,
    Imported,
    export_recording,
    find_format,
    import_episodes,
    import_recording,
)
from shapechanger.demos.exchange.importing import ImportContext

__all__ = [
    "FORMATS",
    "Exported",
    "Format",
    "ImportContext",
    "Imported",
    "export_recording",
    "find_format",
    "import_episodes",
    "import_recording",
]
