"""Errors of camera images after an export to LeRobot's video and an import."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.row import Row, asked
from shapechanger.demos.episodes import episodes_of, read_episode
from shapechanger.demos.exchange import export_recording, import_recording
from shapechanger.demos.jpeg import decode_picture

_VEHICLES = ("Car", "Tank", "Boat", "Truck")
_BRIGHTEST = 255.0
_MB = 1e6


def video() -> list[Row]:
    """Export a minute of each vehicle's expert drive, import it, and compare the images."""
    return [_row(vehicle) for vehicle in asked("vehicle", _VEHICLES)]


def _row(vehicle: str) -> Row:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        command = ["demos", "record", vehicle, "--minutes", "1", "--out", str(folder / "data")]
        program = f"from shapechanger.cli import main; main({command!r})"
        subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, cwd=folder)
        export_recording(folder / "data", folder / "set", "lerobot")
        import_recording(folder / "set", folder / "back")
        errors: list[float] = []
        squares: list[float] = []
        size = 0
        for one, two in zip(
            episodes_of(folder / "data"), episodes_of(folder / "back"), strict=True
        ):
            before, after = read_episode(one), read_episode(two)
            for first, second in zip(before.steps, after.steps, strict=True):
                jpegs = before.jpeg(first) or b"", after.jpeg(second) or b""
                size += len(jpegs[0])
                pixels = [decode_picture(jpeg, vehicle).astype(np.float64) for jpeg in jpegs]
                difference = pixels[0] - pixels[1]
                errors.append(float(np.abs(difference).mean()))
                squares.append(float((difference**2).mean()))
        bytes_ = sum(path.stat().st_size for path in (folder / "set/videos").rglob("*.mp4"))
    ratio_db = 10.0 * np.log10(_BRIGHTEST**2 / np.mean(squares))
    return Row(
        f"{vehicle}: mean error of a pixel after LeRobot's video, of 255",
        f"{np.mean(errors):.2f}",
        f"worst picture {max(errors):.2f}; PSNR {ratio_db:.1f} dB; {bytes_ / _MB:.2f} MB in place "
        f"of {size / _MB:.2f} MB of JPEG, {len(errors)} pictures",
        "none",
        True,
    )
