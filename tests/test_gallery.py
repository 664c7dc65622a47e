"""The gallery: its clips, and the command that draws them."""

from __future__ import annotations

import sys
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest

from scripts.draw_pictures import CLIPS, PICTURES, STRIP, main
from scripts.site_hooks import on_page_markdown

GALLERY = PICTURES.parent / "gallery.md"


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_the_command_draws_one_clip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`--only` draws one clip into the given folder: four pendulums, three in order of size."""
    monkeypatch.setattr(
        sys, "argv", ["draw_pictures.py", "--only", "balancing", "--out", str(tmp_path)]
    )
    main()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["balancing.jpg", "balancing.webm"]
    assert (tmp_path / "balancing.webm").stat().st_size > 10_000
    frame = np.asarray(iio.imread(tmp_path / "balancing.jpg"))
    assert frame.shape == (160, 1200, 3)
    seen = (frame.min(axis=2) < 150).reshape(160, 4, 300)
    assert seen.any(axis=(0, 2)).all()
    heights = np.ptp([np.flatnonzero(seen[:, i].any(axis=1))[[0, -1]] for i in range(3)], axis=1)
    assert heights[0] < heights[1] < heights[2]


def test_the_gallery_shows_what_the_command_draws() -> None:
    """Each clip is on the page, and all pictures of the documentation stay below 6 MB."""
    assert sum(path.stat().st_size for path in PICTURES.iterdir()) < 6e6
    page = GALLERY.read_text()
    assert [name for name in CLIPS if f"(pictures/{name}.webm)" not in page] == []
    assert f"(pictures/{STRIP}.jpg)" in page


def test_clips_have_players_on_the_site() -> None:
    """Linked images of clips become players on the site."""
    shown = on_page_markdown(GALLERY.read_text())
    clips = list(PICTURES.glob("*.webm"))
    assert len(clips) == shown.count("<video ") == shown.count("</video>")
    for clip in clips:
        assert f'poster="pictures/{clip.stem}.jpg"' in shown
        assert f'src="pictures/{clip.name}"' in shown
    assert ".webm)" not in shown
