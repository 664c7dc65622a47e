"""Formats of other packages, registered by an entry point."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from shapechanger.cli import main
from shapechanger.demos.exchange import formats
from shapechanger.demos.exchange.base import COLUMNS, FORMATS
from shapechanger.errors import DemosError
from tests.demos.exchange.small import all_of

DOCS = Path(__file__).parents[3] / "docs/exchange.md"

FORMAT = """
from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange import ExchangeEpisode, Format, ExchangeRecord
from shapechanger.layout import Feature, Layout

LAYOUT = Layout((Feature("speed", "m/s"),))


def read(folder, context):
    header = EpisodeHeader(action_layout=LAYOUT, control_hz=context.hz or 10.0)
    records = []
    for line in (folder / "speeds.txt").read_text().split():
        try:
            step = Step(action=(float(line),), driver="person")
        except ValueError:
            context.report("left out", "not a number", line)
            continue
        records.append(ExchangeRecord(step=step))
    yield ExchangeEpisode(header=header, records=records, name=str(folder))


def write(episodes, folder, context):
    speeds = [str(row.step.action[0]) for episode in episodes for row in episode.records]
    (folder / "speeds.txt").write_text("\\n".join(speeds))
    return len(speeds)


def detect(folder):
    return (folder / "speeds.txt").is_file()


FORMAT = Format(
    name="speeds", title="Speeds", sign="speeds.txt", detect=detect, read=read, write=write,
    options=frozenset({"hz"}),
)
"""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    place = tmp_path / "site"
    about = place / "speeds_format-1.0.dist-info"
    about.mkdir(parents=True)
    (place / "speeds_format.py").write_text(FORMAT)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: speeds-format\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[shapechanger.formats]\nspeeds = speeds_format:FORMAT")
    monkeypatch.syspath_prepend(str(place))
    formats.cache_clear()
    yield place
    formats.cache_clear()
    sys.modules.pop("speeds_format", None)


@pytest.mark.usefixtures("installed")
def test_commands_use_a_registered_format(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "drive"
    source.mkdir()
    (source / "speeds.txt").write_text("0.5\n1.5\nfast\n")
    command = ["demos", "import", str(source), "--out", str(tmp_path / "data"), "--hz", "5"]
    with pytest.raises(SystemExit) as ended:
        main(command)
    assert ended.value.code == 3
    output = capsys.readouterr()
    assert "(speeds): 1 episode, 2 steps, 0 images" in output.out
    assert output.err == "left out: fast: not a number\n"
    (episode,) = all_of(tmp_path / "data")
    assert [step.action for step in episode.steps] == [(0.5,), (1.5,)]
    assert episode.header.control_hz == 5.0
    again = tmp_path / "again"
    main(["demos", "export", str(tmp_path / "data"), "--out", str(again), "--to", "speeds"])
    assert (again / "speeds.txt").read_text() == "0.5\n1.5"


def test_two_formats_of_one_name_are_refused(installed: Path) -> None:
    path = installed / "speeds_format.py"
    path.write_text(path.read_text().replace('name="speeds"', 'name="csv"'))
    with pytest.raises(DemosError, match="must name a Format of another name than tub, minari"):
        formats()


def test_the_columns_are_documented() -> None:
    lines = [("Field", *FORMATS), ("---",) * (1 + len(FORMATS))]
    for field, names in COLUMNS.items():
        named = (f"`{name}`" if (name := names.get(form)) else "" for form in FORMATS)
        lines.append((f"`{field}`", *named))
    table = "\n".join(f"| {' | '.join(cells)} |".replace("|  |", "| |") for cells in lines)
    assert table in DOCS.read_text()
