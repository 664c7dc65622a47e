"""Finding and reading profile files."""

from pathlib import Path

import pytest

from shapechanger.errors import ProfileError, UnknownName
from shapechanger.robot.profile import find_profile, load_profile, shipped_profiles
from tests.robot.profile.texts import EVERYTHING


def test_names_and_paths() -> None:
    """Names of shipped profiles resolve to their files; everything else is a path."""
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
def test_a_missing_profile_has_a_nearest_spelling(tmp_path: Path, name: str, hint: str) -> None:
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
