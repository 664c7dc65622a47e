"""The gallery: its images, its clips, and the command that draws them."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import imageio.v3 as iio
import numpy as np
import pytest

from scripts.draw_pictures import CLIPS, PICTURES, STILLS, main
from scripts.site_hooks import on_page_markdown

GALLERY = PICTURES.parent / "gallery.md"


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_the_command_draws_one_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`--only` draws one, into the given folder: four pendulums side by side on a light ground."""
    monkeypatch.setattr(
        sys, "argv", ["draw_pictures.py", "--only", "pendulums", "--out", str(tmp_path)]
    )
    main()
    assert [path.name for path in tmp_path.iterdir()] == ["pendulums.jpg"]
    picture = np.asarray(iio.imread(tmp_path / "pendulums.jpg"))
    assert picture.shape == (240, 1200, 3)
    seen = (picture.min(axis=2) < 150).reshape(240, 4, 300)
    assert seen.any(axis=(0, 2)).all()
    assert not seen[[0, -1]].any()
    heights = np.ptp([np.flatnonzero(seen[:, i].any(axis=1))[[0, -1]] for i in range(3)], axis=1)
    assert heights[0] < heights[1] < heights[2]


def test_the_gallery_shows_what_the_command_draws() -> None:
    """Each image and each clip is on the page; all together stay below 6 MB."""
    assert sum(path.stat().st_size for path in PICTURES.iterdir()) < 6e6
    page = GALLERY.read_text()
    for name in (*STILLS, *CLIPS):
        assert f"pictures/{name}." in page


def test_clips_have_players_on_the_site() -> None:
    """An image that leads to a clip is a link on code hosts, and a player on the site."""
    page = cast("Any", SimpleNamespace(file=SimpleNamespace(src_uri="gallery.md")))
    shown = on_page_markdown(GALLERY.read_text(), page)
    clips = list(PICTURES.glob("*.webm"))
    assert len(clips) == shown.count("<video ") == shown.count("</video>")
    for clip in clips:
        assert f'poster="pictures/{clip.stem}.jpg"' in shown
        assert f'src="pictures/{clip.name}"' in shown
    assert ".webm)" not in shown
