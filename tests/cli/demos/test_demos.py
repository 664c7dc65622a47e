"""`shapechanger demos`: list, show, cut, bad, good, mark, merge, repair."""

from __future__ import annotations

import html
import re
import shutil
from pathlib import Path

import pytest

from shapechanger.cli import main
from shapechanger.demos.episodes import EpisodeWriter, read_episode
from tests.cli.demos.pictures import grey
from tests.demos.episodes.making import header, recorded, step


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Two episodes with JPEG frames; in the first, a policy is corrected."""
    for number, steps in enumerate((30, 10)):
        about = header(env="shapechanger/Car-v1", image_size=(40, 30), seed=number)
        with EpisodeWriter.create(tmp_path / "data", about, spare_bytes=0) as writer:
            for place in range(steps):
                driver = "policy" if number == 0 and place < 20 else "expert"
                writer.add(step(place, driver=driver, reward=0.5), grey(8 * place))
            writer.mark("a <b> bend")
            writer.close("time")
    return tmp_path / "data"


def episodes(data: Path) -> list[Path]:
    """Return the folders of the episodes."""
    return sorted(path for path in data.iterdir() if path.is_dir())


def output_of(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Return the standard output of a command."""
    main(["demos", *map(str, arguments)])
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Return the one-sentence error of a command."""
    with pytest.raises(SystemExit) as stop:
        main(["demos", *map(str, arguments)])
    assert stop.value.code == 2
    sentence = capsys.readouterr().err
    assert sentence.startswith("error: ")
    assert sentence.count("\n") == 1
    return sentence


def test_list(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each episode is a line; damaged ones are reported, and the others listed."""
    first, second = episodes(data)
    with (second / "steps.jsonl").open("ab") as file:
        file.write(b"torn")
    printed = output_of(capsys, "list", data)
    line = next(line for line in printed.splitlines() if first.name in line)
    assert "Car-v1" in line
    assert "policy 67 %, expert 33 %" in line
    assert "1.5 s" in line
    assert line.rstrip().endswith("time")
    assert "cannot be read" in printed
    assert f"shapechanger demos repair {second}" in printed
    assert "2 episodes: 30 of 30 steps count" in printed
    recorded(data / "other", close=False)
    assert "not closed" in output_of(capsys, "list", data / "other")


def test_show_as_text(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    printed = output_of(capsys, "show", data)
    assert "driven by policy 50 %, expert 50 %" in printed
    assert "steering: 0.1 to 0.1, median 0.1" in printed
    assert "time between steps: 50 to 50 ms" in printed
    assert "ended by: time 2" in printed


def test_show_as_a_page(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One self-contained file, with drops, marks and a damaged frame, and names escaped."""
    first, second = episodes(data)
    output_of(capsys, "bad", first, "--from", 10, "--to", 19)
    damaged = second / "frames" / "000003.jpg"
    damaged.write_bytes(bytes(len(damaged.read_bytes())))
    page = tmp_path / "deep" / "page.html"
    assert f"wrote {page}" in output_of(capsys, "show", data, "--out", page)
    text = page.read_text()
    assert not re.search(r"<script|<link|@import|url\(|(src|href)=\"(?!data:|#)", text)
    assert "a &lt;b&gt; bend" in text
    assert "<b>" not in text
    assert text.count("data:image/jpeg;base64,") == 24 + 9
    assert text.count(">damaged<") == 1
    assert 'class="dropped"' in text
    assert "policy 33 % (10 steps)" in html.unescape(text)
    assert "20 of 30" in text


def test_cut_bad_good(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, _ = episodes(data)
    assert "11 of 30 steps" in output_of(capsys, "cut", first, "--from", 5, "--to", 15)
    assert [s.index for s in read_episode(first).kept] == list(range(5, 16))
    assert "8 of 30 steps" in output_of(capsys, "bad", first, "--from", 7, "--to", 9)
    assert "10 of 30 steps" in output_of(capsys, "good", first, "--from", 8, "--to", 9)
    assert "0 of 30 steps" in output_of(capsys, "bad", first)
    assert "30 of 30 steps" in output_of(capsys, "good", first)


def test_mark(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, _ = episodes(data)
    output_of(capsys, "mark", first, 4, "a stone")
    output_of(capsys, "mark", first, 6)
    assert [(m.step, m.text) for m in read_episode(first).marks][1:] == [(4, "a stone"), (6, "")]


def test_merge(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Different layouts are reported."""
    other = header(state_layout="")
    with EpisodeWriter.create(tmp_path / "other", other, spare_bytes=0) as writer:
        writer.add(step(state=()))
    printed = output_of(capsys, "merge", data, tmp_path / "other", "--out", tmp_path / "all")
    assert "copied 3 episodes" in printed
    assert "2 different layouts" in printed


def test_repair(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each episode gets a line, and a second repair changes nothing."""
    first, second = episodes(data)
    with (first / "steps.jsonl").open("ab") as file:
        file.write(b'{"kind":"step","st')
    (second / "frames" / "000009.jpg").unlink()
    printed = output_of(capsys, "repair", data)
    assert f"{first.name}: kept 30 steps, moved 1 line aside, because it is cut off" in printed
    assert f"{second.name}: kept 9 steps, moved 1 line aside" in printed
    assert output_of(capsys, "repair", data).count("was complete") == 2
    with EpisodeWriter.create(data, header(), spare_bytes=0):
        assert "being recorded" in refused(capsys, "repair", data)


def test_one_episode_must_be_named(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = episodes(data)
    assert f"has 2 episodes: name one of them, such as {first}" in refused(capsys, "bad", data)
    near = data / f"{second.name[:-1]}9"
    assert f"Did you mean {second.name!r}" in refused(capsys, "cut", near)
    assert "has the steps 0 to 29, and not 20 to 40" in refused(
        capsys, "cut", first, "--from", 20, "--to", 40
    )
    assert "and not 50 to 50" in refused(capsys, "mark", first, 50)
    assert "There is no recording" in refused(capsys, "list", data / "no" / "such")
    shutil.rmtree(second)
    assert "0 of 30 steps" in output_of(capsys, "bad", data)


def test_a_replay_that_cannot_be_is_refused(
    data: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It needs one target, which exists and has these actions, and an episode with kept steps."""
    first, _ = episodes(data)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(data))
    assert "nobody" in refused(capsys, "replay", first, "--robot", "nobody")
    sentence = refused(capsys, "replay", first, "--env", "Ant")
    assert "hip_1/motor" in sentence
    assert "was recorded with steering, throttle" in sentence
    assert "one of --film, --env and --robot" in refused(capsys, "replay", first)
    output_of(capsys, "bad", first)
    assert "demos good" in refused(capsys, "replay", first, "--film", "a.mp4")


def test_a_film(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The film has one frame per kept step, with the bars of two actions below."""
    import imageio_ffmpeg

    first, _ = episodes(data)
    output_of(capsys, "cut", first, "--to", 19)
    assert "20 steps, 1.0 s" in output_of(capsys, "replay", first, "--film", tmp_path / "a.mp4")
    assert imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "a.mp4")) == (20, 1.0)
    assert "a film ends with one of" in refused(
        capsys, "replay", first, "--film", tmp_path / "a.txt"
    )
