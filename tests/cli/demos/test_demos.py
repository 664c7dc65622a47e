"""`shapechanger demos`: list, show, cut, bad, good, mark, merge, repair."""

from __future__ import annotations

import html
import re
import shutil
from pathlib import Path

import pytest

from shapechanger.demos.episodes import EpisodeWriter, read_episode
from tests.cli.demos.pictures import grey
from tests.cli.running import Cli
from tests.demos.episodes.making import header, step


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


def test_list(data: Path, demos: Cli) -> None:
    """Each episode is a line; damaged ones are reported, and the others listed."""
    first, second = episodes(data)
    with (second / "steps.jsonl").open("ab") as file:
        file.write(b"torn")
    printed = demos.output("list", data)
    line = next(line for line in printed.splitlines() if first.name in line)
    assert "Car-v1" in line
    assert "policy 67 %, expert 33 %" in line
    assert "1.5 s" in line
    assert line.rstrip().endswith("time")
    assert "cannot be read" in printed
    assert f"shapechanger demos repair {second}" in printed
    assert "2 episodes: 30 of 30 steps count" in printed


def test_show_as_text(data: Path, demos: Cli) -> None:
    printed = demos.output("show", data)
    assert "driven by policy 50 %, expert 50 %" in printed
    assert "steering: 0.1 to 0.1, median 0.1" in printed
    assert "time between steps: 50 to 50 ms" in printed
    assert "ended by: time 2" in printed


def test_show_as_a_page(data: Path, tmp_path: Path, demos: Cli) -> None:
    """One self-contained file, with drops, marks and a damaged frame, and names escaped."""
    first, second = episodes(data)
    demos.output("bad", first, "--from", 10, "--to", 19)
    damaged = second / "frames" / "000003.jpg"
    damaged.write_bytes(bytes(len(damaged.read_bytes())))
    page = tmp_path / "deep" / "page.html"
    assert f"wrote {page}" in demos.output("show", data, "--out", page)
    text = page.read_text()
    assert not re.search(r"<script|<link|@import|url\(|(src|href)=\"(?!data:|#)", text)
    assert "a &lt;b&gt; bend" in text
    assert "<b>" not in text
    assert text.count("data:image/jpeg;base64,") == 24 + 9
    assert text.count(">damaged<") == 1
    assert 'class="dropped"' in text
    assert "policy 33 % (10 steps)" in html.unescape(text)
    assert "20 of 30" in text


def test_cut_bad_good_mark(data: Path, demos: Cli) -> None:
    first, _ = episodes(data)
    assert "11 of 30 steps" in demos.output("cut", first, "--from", 5, "--to", 15)
    assert [s.index for s in read_episode(first).kept] == list(range(5, 16))
    assert "8 of 30 steps" in demos.output("bad", first, "--from", 7, "--to", 9)
    assert "10 of 30 steps" in demos.output("good", first, "--from", 8, "--to", 9)
    assert "0 of 30 steps" in demos.output("bad", first)
    assert "30 of 30 steps" in demos.output("good", first)
    demos.output("mark", first, 4, "a stone")
    assert [(mark.step, mark.text) for mark in read_episode(first).marks][1:] == [(4, "a stone")]


def test_merge(data: Path, tmp_path: Path, demos: Cli) -> None:
    """Different layouts are reported; duplicates are refused."""
    other = header(state_layout="")
    with EpisodeWriter.create(tmp_path / "other", other, spare_bytes=0) as writer:
        writer.add(step(state=()))
    out = tmp_path / "all"
    printed = demos.output("merge", data, tmp_path / "other", "--out", out)
    assert "copied 3 episodes" in printed
    assert "2 different layouts" in printed
    assert "the same episode" in demos.refused("merge", data, "--out", out)


def test_repair(data: Path, demos: Cli) -> None:
    """Each episode gets a line, and a second repair changes nothing."""
    first, second = episodes(data)
    with (first / "steps.jsonl").open("ab") as file:
        file.write(b'{"kind":"step","st')
    (second / "frames" / "000009.jpg").unlink()
    printed = demos.output("repair", data)
    assert f"{first.name}: kept 30 steps, moved a line aside, because it is cut off" in printed
    assert f"{second.name}: kept 9 steps, moved a line aside" in printed
    assert demos.output("repair", data).count("was complete") == 2


def test_one_episode_must_be_named(data: Path, demos: Cli) -> None:
    first, second = episodes(data)
    assert f"has 2 episodes: name one of them, such as {first}" in demos.refused("bad", data)
    near = data / f"{second.name[:-1]}9"
    assert f"Did you mean {second.name!r}" in demos.refused("cut", near)
    assert "has the steps 0 to 29, and not 20 to 40" in demos.refused(
        "cut", first, "--from", 20, "--to", 40
    )
    assert "and not 50 to 50" in demos.refused("mark", first, 50)
    assert "There is no recording" in demos.refused("list", data / "no" / "such")
    shutil.rmtree(second)
    assert "0 of 30 steps" in demos.output("bad", data)


def test_replay_needs_one_target(data: Path, demos: Cli) -> None:
    """Exactly one of --film, --env and --robot, and an episode with kept steps."""
    first, _ = episodes(data)
    assert "one of --film, --env and --robot" in demos.refused("replay", first)
    demos.output("bad", first)
    assert "demos good" in demos.refused("replay", first, "--film", "a.mp4")


def test_a_film(data: Path, tmp_path: Path, demos: Cli) -> None:
    """The film has one frame per kept step, with the bars of two actions below."""
    import imageio_ffmpeg

    first, _ = episodes(data)
    demos.output("cut", first, "--to", 19)
    assert "20 steps, 1.0 s" in demos.output("replay", first, "--film", tmp_path / "a.mp4")
    assert imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "a.mp4")) == (20, 1.0)
    assert "a film ends with one of" in demos.refused("replay", first, "--film", tmp_path / "a.txt")


def test_an_env_with_other_actions_is_refused(data: Path, demos: Cli) -> None:
    first, _ = episodes(data)
    sentence = demos.refused("replay", first, "--env", "Ant")
    assert "hip_1/motor" in sentence
    assert "was recorded with steering, throttle" in sentence
