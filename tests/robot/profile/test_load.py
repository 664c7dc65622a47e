"""Finding, reading, writing and changing profile files."""

import datetime
import stat
from pathlib import Path

import pytest

from shapechanger.errors import OutputError, ProfileError, UnknownName
from shapechanger.robot.profile import find_profile, load_profile, shipped_profiles, write_profile
from shapechanger.robot.profile.load import CAMERAS, rewrite
from tests.robot.profile.texts import EVERYTHING


def test_names_and_paths() -> None:
    assert find_profile("car") == shipped_profiles()["car"]
    assert find_profile("car.toml") == Path("car.toml")
    assert find_profile("robots/car") == Path("robots/car")
    assert find_profile(Path("my.toml")) == Path("my.toml")
    with pytest.raises(UnknownName, match=r"'tnak'. Did you mean 'tank'\? There are: boat"):
        find_profile("tnak")


def test_a_profile_in_the_working_folder_has_a_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Shipped profiles take precedence, and folders are ignored."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rover.toml").write_text(EVERYTHING)
    (tmp_path / "car.toml").write_text(EVERYTHING)
    (tmp_path / "folder.toml").mkdir()
    assert find_profile("rover") == Path("rover.toml")
    assert find_profile("car") == shipped_profiles()["car"]
    with pytest.raises(UnknownName, match="No profile matches 'folder'"):
        find_profile("folder")
    with pytest.raises(UnknownName, match="Did you mean 'rover'"):
        find_profile("rovre")


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("my-cra.toml", r"There is no file .*my-cra\.toml \(did you mean my-car in .*\?\); there "),
        ("trcuk.toml", r"\(did you mean truck of Shapechanger\?\)"),
        ("zzz.toml", r"zzz\.toml; there are: boat, .*, my-car\.$"),
    ],
)
def test_a_missing_profile_is_an_error_with_a_hint(tmp_path: Path, name: str, hint: str) -> None:
    (tmp_path / "my-car.toml").touch()
    with pytest.raises(ProfileError, match=hint):
        load_profile(tmp_path / name)


def test_bom_and_crlf_are_accepted(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_bytes(b"\xef\xbb\xbf" + EVERYTHING.replace("\n", "\r\n").encode())
    assert load_profile(path).name == "rover"


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    path, long = tmp_path / "x.toml", tmp_path / "long.toml"
    path.write_bytes(b"# One.\n\xff")
    long.write_bytes(b"#" * (1024 * 1024 + 1))
    for unread, message in (
        (tmp_path / "gone.toml", r"There is no file .*gone\.toml; there are: boat"),
        (tmp_path, "cannot be read: Is a directory"),
        (path, r"x\.toml, line 2: this is not UTF-8 text"),
        (long, "longer than a profile can be"),
        (path / "y.toml", r"x\.toml/y\.toml cannot be read: Not a directory"),
        ("a\0b.toml", "cannot be read: embedded null"),
    ):
        with pytest.raises(ProfileError, match=message):
            load_profile(unread)


@pytest.fixture
def rover(tmp_path: Path) -> Path:
    path = tmp_path / "rover.toml"
    path.write_text(EVERYTHING)
    return path


@pytest.mark.parametrize("kind", shipped_profiles())
def test_a_new_profile_differs_only_in_its_name(kind: str, tmp_path: Path) -> None:
    path = write_profile(kind, tmp_path / "new" / "my.toml", 'Ann\'s "7" \\ ü')
    profile = load_profile(path)
    assert profile.name == 'Ann\'s "7" \\ ü'
    shipped = shipped_profiles()[kind].read_text().split("\n")
    differing = [
        line
        for line, before in zip(path.read_text().split("\n"), shipped, strict=True)
        if line != before
    ]
    assert len(differing) == 1


def test_a_new_profile_overwrites_no_file(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text("mine")
    new = tmp_path / "new.toml"
    for arguments, error, message in (
        (("car", path, "car"), OutputError, "Cannot write .*: it exists"),
        (
            ("car", path / "x.toml", "car"),
            OutputError,
            "Cannot write .*: (it exists|Not a dir|File)",
        ),
        (
            ("car", tmp_path / ("x" * 300), "car"),
            OutputError,
            "Cannot write .*: File name too long",
        ),
        (("kar", new, "car"), UnknownName, r"No kind of robot matches 'kar'. Did you mean .car.\?"),
        (("car", new, "car", "us"), UnknownName, r"No camera matches 'us'. Did you mean 'usb'\?"),
        (("car", new, ""), ProfileError, r"name of .robot. must be a text"),
    ):
        with pytest.raises(error, match=message):
            write_profile(*arguments)
    assert path.read_text() == "mine"
    assert not new.exists()


def test_changes_keep_comments(rover: Path) -> None:
    """`rewrite` changes only the given keys, and keeps file mode and comments."""
    rover.chmod(0o640)
    profile = rewrite(
        rover,
        {
            "output.steer.centre_us": 1480,
            "output.steer.left_us": 1900,
            "action.throttle.slew_per_s": 3.5,
            "robot.calibrated": datetime.date(2026, 11, 21),
            "sensor.bumper.pins": [12, 7],
            "output.drive.mix": {"throttle": 0.9},
        },
    )
    assert profile == load_profile(rover)
    before, after = EVERYTHING.split("\n"), rover.read_text().split("\n")
    assert set(after) - set(before) == {
        "centre_us = 1480",
        "left_us = 1900",
        "slew_per_s = 3.5",
        "calibrated = 2026-11-21",
        "pins = [12, 7]",
        "mix = {throttle = 0.9}",
    }
    assert [line for line in after if "#" in line] == [
        line for line in before if "#" in line and "12,  # Left." not in line
    ]
    assert stat.S_IMODE(rover.stat().st_mode) == 0o640
    assert [path.name for path in rover.parent.iterdir()] == ["rover.toml"]


def test_a_change_through_a_link_changes_its_target(rover: Path, tmp_path: Path) -> None:
    link = tmp_path / "link.toml"
    link.symlink_to(rover)
    assert rewrite(link, {"robot.name": "new"}).name == "new"
    assert link.is_symlink()
    assert load_profile(rover).name == "new"


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("output.steer.centre_us", 2400, "must lie between left_us and right_us"),
        ("output.stear.centre_us", 1500, "No table of rover.toml matches 'stear'. Did you mean"),
        ("robot.name.x", 1500, "No table of rover.toml matches 'name'"),
        ("robot.nam", "x", r"\[robot\] has no key 'nam'"),
    ],
)
def test_a_change_that_breaks_the_profile_is_refused(
    rover: Path, key: str, value: object, message: str
) -> None:
    """The file is unchanged, and no temporary file remains."""
    with pytest.raises((ProfileError, UnknownName), match=message):
        rewrite(rover, {key: value})
    assert rover.read_text() == EVERYTHING
    assert [path.name for path in rover.parent.iterdir()] == ["rover.toml"]


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("kind", ["car", "lab-car", "finger"])
def test_a_new_profile_can_have_another_camera(kind: str, camera: str, tmp_path: Path) -> None:
    """The size and the rate of the frames are kept, and so are the outputs."""
    before = load_profile(shipped_profiles()[kind])
    profile = load_profile(write_profile(kind, tmp_path / "mine.toml", "mine", camera, "anyone"))
    assert profile.arming == "anyone"
    assert (profile.camera.driver if profile.camera else "") == CAMERAS[camera]
    if before.camera and profile.camera:
        assert (profile.camera.size, profile.camera.fps) == (before.camera.size, before.camera.fps)
    assert profile.outputs == before.outputs
    assert "# " in profile.path.read_text()
