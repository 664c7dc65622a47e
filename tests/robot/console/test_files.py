"""Files of the console that the package contains."""

import re
from pathlib import Path

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.daemon.server import ENTRY, console_files


def test_the_page_refers_only_to_existing_files() -> None:
    files = console_files()
    for name, (_, body) in files.items():
        text = body.decode()
        named = re.findall(r'(?:src|href)="([^"]+)"|from "([^"]+)"', text)
        for path in (one or other for one, other in named):
            assert path.startswith(("/console/", "./")), (name, path)
            assert path.rpartition("/")[2] in files, (name, path)


def test_no_inline_code_and_no_external_resources() -> None:
    """Checks statically what the content security policy enforces in a browser."""
    for name, (_, body) in console_files().items():
        text = body.decode()
        outside = set(re.findall(r"https?://[^\s\"'`)]+", text))
        assert outside <= {"http://127.0.0.1.", "http://www.w3.org/2000/svg"}, name
        if name == ENTRY:
            assert "style=" not in text
            assert not re.search(r"\son\w+=", text)
            assert "<style" not in text


def test_a_missing_page_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match=r"has no index.html"):
        console_files(tmp_path)
    with pytest.raises(RobotError, match="Cannot read"):
        console_files(tmp_path / "nowhere")
