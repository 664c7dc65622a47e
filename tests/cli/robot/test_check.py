"""Questions of `shapechanger robot check`."""

import pytest

from shapechanger.cli.robot.check import ask_person


def test_questions_are_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only yes, no and the end of the input are answers."""
    answers = iter(["", "maybe", "Y", "no"])

    def answer(_: str) -> str:
        try:
            return next(answers)
        except StopIteration:
            raise EOFError from None

    monkeypatch.setattr("builtins.input", answer)
    assert [ask_person("Is it lit?") for _ in range(3)] == [True, False, None]
