"""`shapechanger robot init`: its questions."""

import io
from pathlib import Path

import pytest

from shapechanger.cli.robot.setup import RobotInit
from shapechanger.errors import RobotError
from shapechanger.robot.profile.load import load_profile, shipped_profiles


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[list[str], list[str]]:
    """Questions so far, and the answers to come; Ctrl-D follows them."""
    questions: list[str] = []
    answers: list[str] = []

    def answer(question: str) -> str:
        questions.append(question)
        if not answers:
            raise EOFError
        return answers.pop(0)

    monkeypatch.setattr("builtins.input", answer)
    monkeypatch.setattr("sys.stdin", _Terminal())
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    return questions, answers


def test_enter_takes_the_defaults(asked: tuple[list[str], list[str]]) -> None:
    """The profile is then the shipped one."""
    questions, answers = asked
    answers += [""] * 4
    RobotInit().run()
    assert len(questions) == 4
    assert all(question.endswith("]: ") for question in questions)
    assert Path("car.toml").read_text() == shipped_profiles()["car"].read_text()


def test_answers_are_checked_one_by_one(
    asked: tuple[list[str], list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong one gives a sentence, and is asked for again; the start of a clear one is enough."""
    questions, answers = asked
    Path("taken.toml").touch()
    answers += [
        "kar",
        "Ca",
        "Lab-T",
        "lab-tan",
        "../up",
        "taken",
        "rover",
        "noen",
        "N",
        "me",
        "Any",
    ]
    RobotInit().run()
    said = capsys.readouterr().out
    for text in (
        "  car         The New Bright car of 2017: two small motors",
        "No kind of robot matches 'kar'. Did you mean 'car'?",
        "No kind of robot matches 'Ca'.",
        "No kind of robot matches 'Lab-T'.",
        "Cannot write taken.toml: it exists.",
        "No camera matches 'noen'. Did you mean 'none'?",
        "No answer matches 'me'.",
        "Next: shapechanger robot install rover.toml",
    ):
        assert text in said
    assert len(questions) == 11
    profile = load_profile("rover.toml")
    assert (profile.name, profile.body, profile.camera) == ("rover", "tank", None)
    assert profile.arming == "anyone"


def test_the_end_of_the_answers_writes_nothing(
    asked: tuple[list[str], list[str]], tmp_path: Path
) -> None:
    """Ctrl-D ends it with one sentence."""
    _, answers = asked
    answers += ["car", "rover"]
    with pytest.raises(RobotError, match="nothing was written"):
        RobotInit().run()
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_arguments_ask_nothing(
    asked: tuple[list[str], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A script can choose the same; it needs the kind, as a command without a terminal does."""
    with pytest.raises(RobotError, match=r"`shapechanger robot init car`. There are: .*boat"):
        RobotInit(name="rover").run()
    RobotInit("car", "bench", camera="none").run()
    assert load_profile("bench.toml").camera is None
    monkeypatch.setattr("sys.stdin", io.StringIO())
    with pytest.raises(RobotError, match="Name the kind"):
        RobotInit().run()
    assert asked[0] == []
