"""Import and export of recordings in other formats.

A format is one file: it reads folders into `ExchangeEpisode`s, writes these, and declares a
`Format` (`format`), which `convert` finds among our own and in the entry points
`shapechanger.formats`. `format.COLUMNS` names each column of a step. `files` and `pictures`
load what strangers made, within one budget; `imports` measures rates.
Sources are never changed, and targets appear atomically.
"""

from __future__ import annotations

from shapechanger.demos.exchange.convert import (
    Exported,
    Imported,
    export_recording,
    find_format,
    formats,
    import_episodes,
    import_recording,
)
from shapechanger.demos.exchange.format import (
    ExchangeEpisode,
    ExchangeStep,
    ExportContext,
    Format,
    ImportContext,
)

__all__ = [
    "ExchangeEpisode",
    "ExchangeStep",
    "ExportContext",
    "Exported",
    "Format",
    "ImportContext",
    "Imported",
    "export_recording",
    "find_format",
    "formats",
    "import_episodes",
    "import_recording",
]
