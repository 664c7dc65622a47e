"""Files of known robots."""

import pytest

from shapechanger.errors import LinkError, UnknownName
from shapechanger.robot.client.known_robots import KnownRobot, forget, known_names, recall, remember
from shapechanger.robot.link.authentication import new_key

KEY = "IVPO-EP6N-42IE-SHAG-6YAL-CDJ5-XI"
"""A fixed key, for stable test ids."""

PRINT = "ab" * 32


def test_a_known_robot_round_trips() -> None:
    robot = KnownRobot("new-bright", "car.local:5000", new_key(), PRINT)
    assert robot.key not in repr(robot)
    path = remember(robot)
    assert recall("new-bright") == robot
    assert known_names() == ("new-bright",)
    assert path.stat().st_mode & 0o777 == 0o600
    path.chmod(0o644)
    with pytest.raises(LinkError, match="chmod 600"):
        recall("new-bright")
    forget("new-bright")
    for missing in (recall, forget):
        with pytest.raises(UnknownName):
            missing("new-bright")
    # Without encryption, the key may be empty.
    assert KnownRobot("car", "car.local", "", "insecure").key == ""


@pytest.mark.parametrize("text", ["adress = 1", "not toml", 'address = "a"\nkey = 1\n'])
def test_a_broken_file_is_named(text: str) -> None:
    path = remember(KnownRobot("car", "car.local", new_key(), PRINT))
    path.write_text(text)
    with pytest.raises(LinkError, match=r"car\.toml"):
        recall("car")


@pytest.mark.parametrize(
    ("name", "address", "key", "fingerprint"),
    [
        ("../car", "car.local", KEY, PRINT),
        ("car", "http://car", KEY, PRINT),
        ("car", "car.local", "short", PRINT),
        ("car", "car.local", "", PRINT),
        ("car", "car.local", KEY, "trust me"),
    ],
)
def test_invalid_attributes_are_errors(name: str, address: str, key: str, fingerprint: str) -> None:
    with pytest.raises(LinkError):
        KnownRobot(name, address, key, fingerprint)
