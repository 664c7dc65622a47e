"""CSV: a folder with `header.json`, `steps.csv` and `frames/` for each episode.

Numbers are written so that they are read back exactly; an empty cell is a missing value, `nan` a
value that nothing measured. Texts are written as JSON with its quotes, so that no spreadsheet takes
one for a formula, and line ends and other special characters survive.

Without a header, `steps.csv` is a table of others: its columns are known by their names or aliases
of them, and its images lie in the same folder.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from itertools import chain
from pathlib import Path
from typing import Any, Final

import msgspec

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange import files, pictures
from shapechanger.demos.exchange.format import (
    COLUMNS,
    COMMANDS,
    ExchangeEpisode,
    ExchangeStep,
    ExportContext,
    Format,
    ImportContext,
    SourceRecord,
    as_json,
    features_of,
    stretches,
    value_names,
)
from shapechanger.errors import DemosError, translate_errors

_TABLE: Final = "steps.csv"
_HEADER: Final = "header.json"
_FRAMES: Final = "frames"
_NAMES: Final = {field: names["csv"] for field, names in COLUMNS.items()}
_VECTORS: Final = [field for field, name in _NAMES.items() if name.endswith("/")]
_IN_JSON: Final = ("terms", "stop_reason", "marks", "dropped")
_TEXTS: Final = ("frame", "driver", *_IN_JSON)
_KNOWN_AS: Final = {
    **{key: (_NAMES["action"] + one.name, 1) for key, one in COMMANDS.items()},
    **dict.fromkeys(("file", "image", "picture", "filename"), ("frame", 1)),
    **dict.fromkeys(("timestamp", "time"), ("captured_ns", 10**9)),
    **dict.fromkeys(("timestamp_ms", "milliseconds"), ("captured_ns", 10**6)),
    "done": ("terminated", 1),
}
"""Columns of `steps.csv`, each with its factor to their unit, by names in tables of others."""


def _tables_of(folder: Path) -> list[Path]:
    """Return the folders with a `steps.csv`: the folder itself, or its subfolders."""
    if (folder / _TABLE).is_file():
        return [folder]
    try:
        return sorted(path for path in folder.iterdir() if (path / _TABLE).is_file())
    except OSError as error:
        raise files.cannot_read(folder, error) from error


def _columns(header: EpisodeHeader) -> dict[str, list[str]]:
    """Return the names of the columns of each field of a step, in order."""
    actions, states = value_names(header.actions), value_names(header.states)
    values = dict.fromkeys(_VECTORS, actions) | {"state": states}
    return {
        field: [name + value for value in values.get(field, [""])] for field, name in _NAMES.items()
    }


def _write(episodes: Sequence[ExchangeEpisode], folder: Path, _: ExportContext) -> int:
    """Write episodes; several episodes get a subfolder each."""
    steps = 0
    for number, episode in enumerate(episodes, 1):
        place = folder if len(episodes) == 1 else folder / f"episode-{number:04d}"
        (place / _FRAMES).mkdir(parents=True)
        text = json.dumps(files.own_fields(episode), indent=1, ensure_ascii=False)
        (place / _HEADER).write_text(text + "\n", encoding="utf-8", errors="replace")
        columns, frame = _columns(episode.header), ""
        with (place / _TABLE).open("w", encoding="utf-8", errors="replace", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(chain.from_iterable(columns.values()))
            for index, row in enumerate(episode.rows):
                if row.jpeg is not None:
                    frame = f"{index:06d}.jpg"
                    (place / _FRAMES / frame).write_bytes(row.jpeg)
                writer.writerow([index, frame, row.step.driver, *_cells(row, columns)])
                steps += 1
    return steps


def _cells(row: ExchangeStep, columns: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Yield the cells of a step after those of its index, image and driver."""
    for field, names in list(columns.items())[3:]:
        value: Any = getattr(row if field in {"marks", "dropped"} else row.step, field)
        if field in _VECTORS:
            yield from [""] * len(names) if value is None else map(repr, value)
        elif field == "terms":  # JSON has neither NaN nor infinity.
            terms = {n: v if math.isfinite(v) else repr(v) for n, v in value.items()}
            yield json.dumps(terms) if terms else ""
        elif field == "dropped":  # For an unknown reason, which is "".
            yield "" if value is None else json.dumps(value)
        elif field in _IN_JSON:
            yield json.dumps(value) if value else ""
        else:
            yield "" if value is None else repr(value).lower()


def _read(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    for place in _tables_of(folder):
        read = _own if (place / _HEADER).is_file() else _others
        yield from read(place, context)


def _own(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    if context.hz is not None:
        raise DemosError("The format csv states the rate itself: leave out --hz.")
    path, where = folder / _HEADER, folder / _TABLE
    header, outcome = files.own_header(files.read_json(path), path)
    columns = _columns(header)
    expected = list(chain.from_iterable(columns.values()))
    table = files.read_table(where, len(expected))
    names = table[1][0][1] if table[1] else []
    if names != expected:
        wrong = ", ".join(sorted(set(names) ^ set(expected))[:5]) or "their order"
        raise DemosError(f"{where} has other columns than {path}: {wrong}.")
    records = _records(folder / _FRAMES, where, table, columns, None, context)
    if header.image_size is None and any(record.frame for record in records):
        raise DemosError(f"{where} has images, but {path} has no image_size.")
    rows = pictures.rows_of(records, header.image_size, context, "line")
    yield ExchangeEpisode(header=header, rows=rows, name=str(folder), outcome=outcome)


def _others(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a table without a header."""
    path = folder / _TABLE
    table = files.read_table(path)
    stated = [name.strip() for name in table[1][0][1]] if table[1] else []
    known = [_KNOWN_AS.get(name.lower(), (name, 1)) for name in stated]
    names = [name for name, _ in known]
    columns = {
        field: [n for n in names if (n.startswith(name) if field in _VECTORS else n == name)]
        for field, name in _NAMES.items()
    }
    if not columns["action"]:
        raise DemosError(
            f"There is no {_HEADER} next to {path}, and no column of an action: restore it, "
            f"or name columns action/NAME, or {', '.join(COMMANDS)}."
        )
    if len(set(names)) < len(names):
        raise DemosError(f"{path} has two columns of one name: rename one of them.")
    if others := set(names).difference(*columns.values()):
        context.note(f"Columns that are not imported: {', '.join(sorted(others))}.")
    table[1][0] = (1, names)
    found = _records(folder, path, table, columns, dict(known), context)
    records, size = pictures.with_pictures(found, "line", context)
    layouts: list[str] = []
    for field in ("action", "state"):
        values = [name.removeprefix(_NAMES[field]) for name in columns[field]]
        features = [COMMANDS.get(name) or features_of(name, 1)[0] for name in values]
        layouts.append(as_json(features))
    for part, hz, timed in stretches([records] if records else [], "line", context):
        header = EpisodeHeader(
            action_layout=layouts[0],
            state_layout=layouts[1],
            image_size=size,
            control_hz=hz,
            clock="real" if timed else "none",
            source="csv",
        )
        rows = pictures.rows_of(part, size, context, "line")
        yield ExchangeEpisode(header=header, rows=rows, name=f"{folder}, from {part[0].name}")


def _records(
    folder: Path,
    path: Path,
    table: tuple[str, list[tuple[int, list[str]]]],
    columns: Mapping[str, Sequence[str]],
    factors: Mapping[str, int] | None,
    context: ImportContext,
) -> list[SourceRecord]:
    """Return the lines of a table that can be read, with their images; the others are left out.

    An own table has no `factors` of columns, and the tables of others may lack columns.
    """
    separator, ((_, names), *lines) = table
    records: list[SourceRecord] = []
    shown, known = "", set[str]()
    for position, (line, cells) in enumerate(lines):
        try:
            if len(cells) != len(names):
                hint = " (decimal commas need another separator)" if separator == "," else ""
                raise ValueError(f"{len(cells)} cells instead of {len(names)}{hint}")
            found = dict(zip(names, cells, strict=True))
            record = _record(found, columns, factors, comma=separator != ",")
            if factors is not None:
                record.number = position
            elif record.number <= (records[-1].number if records else -1):
                raise ValueError(f"step {record.number} is not after the step before")
        except (ValueError, RecursionError, msgspec.ValidationError) as error:
            context.leave_out("line", f"of {path}", f"line {line}: {error}")
            continue
        record.name, frame = f"line {line}", str(record.frame)
        records.append(record)
        record.picture = folder / frame if frame else None
        if frame and not files.is_inside(folder, frame):
            record.fault = "with an image name that leaves the folder"
        elif frame != shown and frame in known:
            record.fault = f"that returns to the image {frame!r} of an earlier step"
        elif not frame and shown:
            record.fault = "without an image"
        else:
            shown = frame
            known.add(frame)
    return records


def _record(
    cells: Mapping[str, str],
    columns: Mapping[str, Sequence[str]],
    factors: Mapping[str, int] | None,
    *,
    comma: bool,
) -> SourceRecord:
    fields: dict[str, Any] = {} if factors is None else {"driver": "person"}
    for field, names in columns.items():
        values = [cell for name in names if (cell := cells[name].strip())]
        if comma and field not in _TEXTS:
            values = [value.replace(",", ".") for value in values]
        factor = (factors or {}).get(names[0], 1) if names else 1
        if field in _VECTORS:
            fields |= {field: values} if values else {}
        elif not values:
            if factors is None and field in {"terminated", "truncated"}:
                raise ValueError(f"{names[0]} is empty")
        elif field in _IN_JSON:
            fields[field] = json.loads(values[0])
        elif factor > 1:
            wrong = f"{names[0]} is not a time: {values[0]!r}"
            with translate_errors(ArithmeticError, to=lambda _, wrong=wrong: ValueError(wrong)):
                fields[field] = int((Decimal(values[0]) * factor).quantize(1))
        else:
            fields[field] = values[0]
    sizes = [len(columns[field]) for field in ("action", "state")]
    fields.setdefault("state", [math.nan] * sizes[1])
    marks, dropped, frame = (fields.pop(name, None) for name in ("marks", "dropped", "frame"))
    step = Step.from_json(fields)
    if reason := step.refusal(*sizes):
        raise ValueError(reason)
    return SourceRecord(
        name="",
        step=step,
        number=step.index,
        frame=frame or "",
        marks=msgspec.convert(marks or (), tuple[str, ...]),
        dropped=msgspec.convert(dropped, str | None),
    )


FORMAT: Final = Format(
    name="csv",
    title="CSV",
    sign=_TABLE,
    detect=lambda folder: bool(_tables_of(folder)),
    read=_read,
    write=_write,
    options=frozenset({"dropped", "hz"}),
)
