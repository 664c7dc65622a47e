"""Writes CSV: a folder with `header.json`, `steps.csv` and `frames/`, for each episode.

One episode lies in the folder itself, several each in a folder of their own below it. Pictures are
the bytes that were recorded. `csv_in` reads it back, and nothing has changed then.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from shapechanger.demos.exchange.csv_columns import Columns
from shapechanger.demos.exchange.recorded import Recorded

__all__ = ["FRAMES", "HEADER", "TABLE", "write_csv"]

HEADER: Final = "header.json"
TABLE: Final = "steps.csv"
FRAMES: Final = "frames"


def write_csv(episodes: Sequence[Recorded], folder: Path) -> int:
    """Write episodes into a folder that is there.

    Returns:
        How many steps were written.
    """
    if len(episodes) == 1:
        return _write(episodes[0], folder)
    steps = 0
    for number, episode in enumerate(episodes, 1):
        place = folder / f"episode-{number:04d}"
        place.mkdir()
        steps += _write(episode, place)
    return steps


def _write(episode: Recorded, folder: Path) -> int:
    columns = Columns(episode.header)
    header = episode.header.to_json() | {"outcome": episode.outcome}
    text = json.dumps(header, indent=1, ensure_ascii=False)
    (folder / HEADER).write_text(text + "\n", encoding="utf-8", errors="replace")
    (folder / FRAMES).mkdir()
    frame, number = "", 0
    with (folder / TABLE).open("w", encoding="utf-8", errors="replace", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns.names)
        for number, row in enumerate(episode.rows, 1):
            if row.jpeg is not None:
                frame = f"{number - 1:06d}.jpg"
                (folder / FRAMES / frame).write_bytes(row.jpeg)
            writer.writerow(columns.cells(row, number - 1, frame))
    return number
