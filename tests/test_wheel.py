"""The built wheel, installed and imported outside the source tree."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.system

_ROOT = Path(__file__).resolve().parents[1]
_SRC = _ROOT / "src"

_USE = """
import gymnasium, shapechanger
print(shapechanger.__file__)
with gymnasium.make("shapechanger/BigAnt-v1") as env:
    env.reset(seed=0)
    env.step(env.action_space.sample())
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel built from the working tree."""
    folder = tmp_path_factory.mktemp("wheel")
    options = ["--wheel", "--no-isolation", "--outdir", str(folder)]
    subprocess.run([sys.executable, "-m", "build", *options, str(_ROOT)], check=True)
    (built,) = folder.glob("*.whl")
    return built


def test_wheel_holds_every_file_of_the_package(wheel: Path) -> None:
    """The wheel has every file of the package, model files and py.typed included."""
    on_disk = {
        path.relative_to(_SRC).as_posix()
        for path in (_SRC / "shapechanger").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert "shapechanger/py.typed" in on_disk
    assert on_disk - set(zipfile.ZipFile(wheel).namelist()) == set()


def test_wheel_works_away_from_the_source(wheel: Path, tmp_path: Path) -> None:
    """The installed package is imported and makes an env from its files."""
    target = tmp_path / "site"
    options = ["--quiet", "--no-deps", "--no-index", "--target", str(target)]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, str(wheel)], check=True)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    run = subprocess.run(
        [sys.executable, "-c", _USE],
        check=True,
        stdout=subprocess.PIPE,
        text=True,
        cwd=elsewhere,
        env={**os.environ, "PYTHONPATH": str(target)},
    )
    assert Path(run.stdout.splitlines()[0]).is_relative_to(target)
