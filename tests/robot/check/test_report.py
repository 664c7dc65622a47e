"""The report of checks."""

import getpass
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from shapechanger.errors import OutputError, RobotError
from shapechanger.robot.check.report import Finding, anonymous, facts, write_report
from tests.robot.check.held_pins import shipped


def _parts(*findings: Finding | BaseException) -> Iterator[tuple[str, Iterator[Finding]]]:
    def found() -> Iterator[Finding]:
        for one in findings:
            if isinstance(one, BaseException):
                raise one
            yield one

    yield "driving", found()


def test_a_report_is_anonymous(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket, "gethostname", lambda: "annas-pi")
    monkeypatch.setattr(getpass, "getuser", lambda: "anna")
    monkeypatch.setattr(Path, "home", lambda: Path("/home/anna"))
    model = tmp_path / "proc/device-tree/model"
    model.parent.mkdir(parents=True)
    model.write_text("Raspberry Pi 5 Model B Rev 1.0\0")
    sentence = "anna owns /home/anna/car.toml on annas-pi, and a banana."
    assert anonymous(sentence) == "USER owns ~/car.toml on HOST, and a banana."
    head = facts(shipped("car"), twin=False, root=tmp_path)
    assert "board        Raspberry Pi 5 Model B Rev 1.0" in head
    report = tmp_path / "report.txt"
    said: list[str] = []
    good = Finding("drives", "good", sentence)
    assert write_report(_parts(good), said.append, report, head)
    text = report.read_text()
    assert "good  drives: USER owns ~/car.toml on HOST" in text
    assert "1 good, 0 bad, 0 not measured." in text
    assert "anna" not in text.replace("banana", "")
    assert said[:2] == ["\ndriving", f"good  drives: {sentence}"]


def test_a_report_is_kept_whatever_happens(tmp_path: Path) -> None:
    """Findings before an error are kept, and earlier reports are not overwritten."""
    report = tmp_path / "report.txt"
    said: list[str] = []
    bad = Finding("drives", "bad", "It did not.")
    assert not write_report(_parts(bad), said.append, report)
    with pytest.raises(RobotError, match="gone"):
        write_report(_parts(bad, RobotError("gone")), said.append, report)
    with pytest.raises(KeyboardInterrupt):
        write_report(_parts(KeyboardInterrupt()), said.append, report)
    second, third = (tmp_path / f"report-{number}.txt" for number in (2, 3))
    assert f"\n{third} has what was checked so far." in said
    assert "0 good, 1 bad" in report.read_text()
    assert second.read_text().endswith("BAD   drives: It did not.\n\nIt ended early: gone\n")
    assert "It ended early: it was interrupted." in third.read_text()
    with pytest.raises(OutputError, match="Cannot write"):
        write_report(_parts(bad), said.append, report / "below.txt")
