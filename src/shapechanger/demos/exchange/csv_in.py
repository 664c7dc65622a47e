"""Reads what `csv_out` writes."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

from shapechanger.demos.episodes import EpisodeHeader
from shapechanger.demos.exchange.csv_columns import Columns
from shapechanger.demos.exchange.csv_out import FRAMES, HEADER, TABLE
from shapechanger.demos.exchange.pictures import Pictures
from shapechanger.demos.exchange.places import cannot_read, inside, read_text
from shapechanger.demos.exchange.recorded import Recorded, Row
from shapechanger.errors import DemosError, LayoutError

__all__ = ["read_csv", "tables_of"]


def tables_of(folder: Path) -> list[Path]:
    """The folders with a `steps.csv`: the folder itself, or those in it.

    Raises:
        DemosError: If the folder cannot be read.
    """
    if (folder / TABLE).is_file():
        return [folder]
    try:
        return sorted(path for path in folder.iterdir() if (path / TABLE).is_file())
    except OSError as error:
        raise cannot_read(folder, error) from error


def read_csv(folder: Path) -> Iterator[Recorded]:
    """The episodes of a folder.

    Raises:
        DemosError: If something in it is not whole; the sentence says what.
    """
    for place in tables_of(folder):
        path = place / HEADER
        if not path.is_file():
            raise DemosError(
                f"There is no {HEADER} beside {place / TABLE}, which says what the numbers mean: "
                "put it back."
            )
        try:
            plain = json.loads(read_text(path))
        except (ValueError, RecursionError) as error:
            raise DemosError(f"{path} is no JSON: {error}.") from error
        if not isinstance(plain, dict):
            raise DemosError(f"{path} is no header.")
        fields = cast("dict[str, Any]", plain)
        try:
            header = EpisodeHeader.from_json(fields)
            columns = Columns(header)
        except (DemosError, LayoutError) as error:
            raise DemosError(f"{path}: {error}") from error
        yield Recorded(
            header=header,
            rows=_rows(place, header, columns),
            name=str(place),
            outcome=str(fields.get("outcome", "")),
        )


def _rows(folder: Path, header: EpisodeHeader, columns: Columns) -> Iterator[Row]:
    path = folder / TABLE
    pictures = Pictures(header.image_size)
    reader = csv.reader(io.StringIO(read_text(path), newline=""), strict=True)
    frame, before = "", -1
    try:
        columns.require(next(reader, list[str]()), str(path))
        for cells in reader:
            where = f"{path}, line {reader.line_num}"
            read = columns.read(cells, where)
            if read.number <= before:
                raise DemosError(f"{where}: step {read.number} comes after step {before}.")
            before = read.number
            jpeg = None
            if read.frame != frame:
                if header.image_size is None:
                    raise DemosError(f"{where} has a picture, and {HEADER} says there are none.")
                frame = read.frame
                jpeg = pictures.read(inside(folder / FRAMES, frame, where))
            yield Row(step=read.row.step, jpeg=jpeg, marks=read.row.marks, dropped=read.row.dropped)
    except csv.Error as error:
        raise DemosError(
            f"{path}, line {reader.line_num}, is no line of a CSV: {error}."
        ) from error
