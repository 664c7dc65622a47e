"""Key and certificate of a robot."""

import ssl
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509

from shapechanger.errors import RobotError
from shapechanger.robot.daemon.credentials import (
    check_exposure,
    credentials_folder,
    load_credentials,
    make_credentials,
)
from shapechanger.robot.link.authentication import parse_key
from shapechanger.robot.serve import recordings_folder
from tests.robot.daemon.plans import car_plan


def test_credentials_are_made_once_and_only_their_owner_can_read_them(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "car"
    made = make_credentials(folder, "my car")
    assert make_credentials(folder, "my car") == made == load_credentials(folder)
    paths = (folder, folder / "key", folder / "certificate.key")
    modes = [path.stat().st_mode & 0o777 for path in paths]
    assert modes == [0o700, 0o600, 0o600]
    certificate = x509.load_pem_x509_certificate((folder / "certificate.pem").read_bytes())
    assert certificate.subject.rfc4514_string() == "CN=my car"
    assert certificate.not_valid_before_utc < datetime(2020, 1, 2, tzinfo=UTC)
    assert certificate.not_valid_after_utc > datetime.now(UTC) + timedelta(days=3_600)
    other = make_credentials(tmp_path / "b", "my car")
    assert made.fingerprint != other.fingerprint
    assert (len(parse_key(made.key)), made.key == other.key) == (16, False)
    assert made.key not in repr(made)


@pytest.mark.parametrize("name", ["key", "certificate.key"])
def test_a_key_that_others_may_read_is_refused(tmp_path: Path, name: str) -> None:
    make_credentials(tmp_path, "car")
    (tmp_path / name).chmod(0o640)
    with pytest.raises(RobotError, match="chmod 600"):
        load_credentials(tmp_path)


@pytest.mark.parametrize("name", ["key", "certificate.pem", "certificate.key"])
def test_incomplete_and_malformed_credentials_are_refused(tmp_path: Path, name: str) -> None:
    """Missing files are not made again, because clients have stored the existing credentials."""
    make_credentials(tmp_path, "car")
    if name != "certificate.key":  # Only OpenSSL checks this file.
        for garbage in (b"short", b"\xff\xfe"):
            (tmp_path / name).write_bytes(garbage)
            with pytest.raises(RobotError, match=name):
                load_credentials(tmp_path)
    (tmp_path / name).unlink()
    with pytest.raises(RobotError, match="only some"):
        make_credentials(tmp_path, "car")
    with pytest.raises(RobotError, match="robot init"):
        load_credentials(tmp_path)


def test_tls_1_3_and_the_key_of_the_certificate_are_required(tmp_path: Path) -> None:
    one, two = (make_credentials(tmp_path / name, name) for name in ("one", "two"))
    assert one.tls().minimum_version is ssl.TLSVersion.TLSv1_3
    (two.folder / "certificate.key").replace(one.folder / "certificate.key")
    with pytest.raises(RobotError, match="do not match"):
        one.tls()


_FOLDERS = {
    "XDG_CONFIG_HOME": (credentials_folder, ".config/shapechanger/robots/car"),
    "XDG_DATA_HOME": (recordings_folder, ".local/share/shapechanger/recordings/car"),
}


@pytest.mark.parametrize("variable", _FOLDERS)
def test_folders_follow_the_xdg_specification(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, variable: str
) -> None:
    """A robot's name cannot select a folder outside the user's folders."""
    folder_of, default = _FOLDERS[variable]
    monkeypatch.delenv(variable, raising=False)
    assert folder_of("car") == Path.home() / default
    monkeypatch.setenv(variable, "relative")
    assert folder_of("car") == Path.home() / default
    monkeypatch.setenv(variable, str(tmp_path))
    assert folder_of("car") == tmp_path / default[default.index("shapechanger") :]
    for name in ("", "..", ".hidden", "a/b", "a\0b"):
        with pytest.raises(RobotError, match="valid folder name"):
            folder_of(name)


def test_serving_other_machines_needs_a_key_or_insecure() -> None:
    check_exposure(car_plan(host="127.0.0.1"))
    check_exposure(car_plan(host="0.0.0.0", insecure=True))
    check_exposure(car_plan(host="0.0.0.0", credentials="c"))
    with pytest.raises(RobotError, match="--insecure"):
        check_exposure(car_plan(host="0.0.0.0"))


def test_the_daemon_imports_neither_cryptography_nor_gpiozero() -> None:
    script = (
        "import sys, shapechanger.robot.daemon.process; "
        "assert 'cryptography' not in sys.modules and 'gpiozero' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
