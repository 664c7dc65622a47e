"""`shapechanger suite` with small lane envs instead of vehicles."""

from __future__ import annotations

import contextlib
import io
import json
import shlex
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec
import pytest

from shapechanger.cli import main
from shapechanger.cli import suite as suite_command
from shapechanger.cli import transfer as transfer_command
from shapechanger.envs.suite_file import SuiteFile
from shapechanger.errors import FailedRuns
from shapechanger.transfer.executor import Job, OnProgress, Serial
from shapechanger.transfer.learners import presets
from shapechanger.transfer.learners.presets import LEARNERS
from tests.transfer.lane import DRY, ICY, QUICK_CLONING, WET

pytestmark = pytest.mark.system

_SUITE = ["suite", "run", "vehicles", "--seeds", "2"]
# Sources and targets are shared between pairs.
_PAIRS = [f"{a}-to-{b}" for a, b in (("Dry", "Wet"), ("Dry", "Icy"), ("Wet", "Dry"))]
_PAIRS += [f"{a}-to-{b}" for a, b in (("Wet", "Icy"), ("Icy", "Dry"), ("Icy", "Wet"))]


class _Counting(Serial):
    """Executor that records the names of jobs, and raises Ctrl-C after `stops_after` jobs."""

    def __init__(self, stops_after: int | None = None) -> None:
        self.done: list[str] = []
        self._stops_after = stops_after

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        for job in jobs:
            if len(self.done) == self._stops_after:
                raise KeyboardInterrupt
            super().run([job], on_progress)
            self.done.append(job.name)


@pytest.fixture(scope="module", autouse=True)
def lanes() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        suite = SuiteFile(name="Lanes", envs=(DRY.id, WET.id, ICY.id), learner="cloning")
        patch.setattr(suite_command, "load_suite", lambda name: suite)
        shipped = {**LEARNERS, "cloning": QUICK_CLONING}
        patch.setattr(presets, "LEARNERS", shipped)
        yield


def _run(
    out: Path, counting: _Counting, *more: str, arguments: Sequence[str] = _SUITE
) -> tuple[int, str, str]:
    typed = [*arguments, "--out", str(out), *more]
    output, errors, code = io.StringIO(), io.StringIO(), 0
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(errors),
    ):
        patch.setattr(transfer_command, "Processes", lambda workers: counting)
        patch.setattr(sys, "argv", ["shapechanger", *typed])
        try:
            main(typed)
        except SystemExit as stop:
            code = int(stop.code or 0)
    return code, output.getvalue(), errors.getvalue()


@pytest.fixture(scope="module")
def complete_suite(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, _Counting, str]:
    out, counting = tmp_path_factory.mktemp("suite") / "all", _Counting()
    code, output, errors = _run(out, counting)
    assert code == 0, errors
    return out, counting, output


def test_a_suite_is_one_command(complete_suite: tuple[Path, _Counting, str]) -> None:
    out, _, output = complete_suite
    lines = [line.strip() for line in output.splitlines()]
    header = next(i for i, line in enumerate(lines) if line.startswith("study"))
    assert lines[header].startswith("study")
    assert "zero-shot" in lines[header]
    assert lines[header].endswith("gain at the end")
    assert [line.split()[0] for line in lines[header + 1 : header + 7]] == _PAIRS
    for name in _PAIRS:
        assert f"wrote {out / name / 'report.html'}" in output
        assert (out / name / "report.html").stat().st_size > 10_000
        command = json.loads((out / name / "study.json").read_text())["command"]
        assert command == f"shapechanger suite run vehicles --seeds 2 --out {out}"
    assert "<h1>Lanes</h1>" in (out / "index.html").read_text()
    assert "of 6 pairs fine-tune reached the final value of scratch in less than half of" in output


def test_a_stopped_suite_resumes_to_the_same_numbers(
    complete_suite: tuple[Path, _Counting, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Reports are slow to draw, and not part of this test.
    monkeypatch.setattr("shapechanger.cli.suite.write_study_report", lambda study, folder: folder)
    whole, all_of_it, _ = complete_suite
    out, before = tmp_path / "all", _Counting(stops_after=13)
    code, output, errors = _run(out, before)
    assert code == 130
    way_on = shlex.join(["shapechanger", *_SUITE, "--out", str(out)])
    assert errors.splitlines()[-1] == f"Stopped. Go on with: {way_on}"
    assert "report.html" in output
    assert len(json.loads((out / "suite.json").read_text())) == 1
    after = _Counting()
    assert _run(out, after)[0] == 0
    assert before.done + after.done == all_of_it.done
    assert (out / "suite.json").read_bytes() == (whole / "suite.json").read_bytes()
    again = _Counting()
    assert _run(out, again)[0] == 0
    assert again.done == []


class _Failing(_Counting):
    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        self.done.append(jobs[0].name)
        raise FailedRuns("These runs failed: source-0 (broken).")


@pytest.mark.parametrize(("exclusive", "studies"), [(False, 6), (True, 1)], ids=["sim", "robot"])
def test_after_a_failed_run_other_studies_go_on_except_on_a_robot(
    exclusive: bool, studies: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Failed runs are reported at the end; after a failure, a robot must not move again."""
    plan = suite_command._plan
    monkeypatch.setattr(
        suite_command,
        "_plan",
        lambda *arguments: msgspec.structs.replace(plan(*arguments), exclusive=exclusive),
    )
    failing = _Failing()
    code, _, errors = _run(tmp_path / "all", failing)
    assert code == 2
    assert len(failing.done) == studies
    assert errors.count("source-0 (broken)") == studies


def test_folders_of_two_machines_are_merged(
    complete_suite: tuple[Path, _Counting, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shapechanger.cli.suite.write_study_report", lambda study, folder: folder)
    whole = complete_suite[0]
    parts = {"a": _PAIRS[:2], "b": _PAIRS[1:3]}
    for part, names in parts.items():
        for name in names:
            shutil.copytree(whole / name, tmp_path / part / name)
    # The results of this study were also computed before it ended, from 4 and 2 seeds.
    study = tmp_path / "a" / _PAIRS[0] / "study.json"
    study.write_text(json.dumps({**json.loads(study.read_text()), "looks": [4, 2]}))
    # The other machine had been stopped in one of its studies.
    shutil.rmtree(tmp_path / "b" / _PAIRS[2] / "runs" / "fine-tune-1")
    merge = ["suite", "merge", "vehicles", str(tmp_path / "a"), str(tmp_path / "b")]
    code, output, errors = _run(tmp_path / "ab", _Counting(), arguments=merge)
    assert code == 0, errors
    assert f"{_PAIRS[2]} lacks fine-tune-1." in output
    found = json.loads((tmp_path / "ab" / "suite.json").read_text())
    alone = {one["name"]: one for one in json.loads((whole / "suite.json").read_text())}
    assert [one["name"] for one in found] == _PAIRS[:2]
    assert all(one == alone[one["name"]] for one in found)
    page = (tmp_path / "ab" / "index.html").read_text()
    assert "Results were also computed on the way, with 4 seeds" in page


def test_conflicting_folders_are_refused(
    complete_suite: tuple[Path, _Counting, str], tmp_path: Path
) -> None:
    name = _PAIRS[0]
    for part in ("a", "b"):
        shutil.copytree(complete_suite[0] / name, tmp_path / part / name)
    result = tmp_path / "b" / name / "runs" / "random-0" / "run.json"
    content = json.loads(result.read_text())
    content["curve"][0]["mean_return"] += 1.0
    result.write_text(json.dumps(content))
    merge = ["suite", "merge", "vehicles", str(tmp_path / "a"), str(tmp_path / "b")]
    code, _, errors = _run(tmp_path / "ab", _Counting(), arguments=merge)
    assert code == 2
    assert "The result of random-0 in" in errors
    code, _, errors = _run(tmp_path / "a", _Counting(), arguments=merge)
    assert code == 2
    assert "one of the folders to merge" in errors


def test_a_suite_can_be_watched(
    complete_suite: tuple[Path, _Counting, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(complete_suite[0], tmp_path / "all")
    at_work = tmp_path / "all" / _PAIRS[0] / "runs" / "fine-tune-1"
    (at_work / "run.json").unlink()
    curve = at_work / "curve.jsonl"
    first, *_ = curve.read_text().splitlines(keepends=True)
    curve.write_text(first + '{"steps": 2')  # A line that is being written.
    main(["suite", "watch", str(tmp_path / "all")])
    lines = capsys.readouterr().out.splitlines()
    (row,) = (line for line in lines if line.strip().startswith(_PAIRS[0]))
    assert "10 of 11" in row
    assert "fine-tune-1" in row
    assert "after 0" in row
    assert sum("11 of 11" in line for line in lines) == 5
    with pytest.raises(SystemExit):
        main(["suite", "watch", str(tmp_path / "nothing")])
    assert "There is no study in" in capsys.readouterr().err
