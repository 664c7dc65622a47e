"""The card of a robot, which its processes, clients and recordings share."""

import json
import math

import msgspec
import pytest

from shapechanger.errors import LinkError
from shapechanger.layout import Layout
from shapechanger.robot.link.card import RobotCard, card_of
from shapechanger.robot.link.messages import Welcome, decode_robot_message, encode
from shapechanger.robot.profile.load import find_profile, load_profile, shipped_profiles


@pytest.mark.parametrize("kind", list(shipped_profiles()))
def test_every_shipped_robot_has_a_card_that_a_client_reads(kind: str) -> None:
    profile = load_profile(find_profile(kind))
    card = card_of(profile)
    assert msgspec.json.decode(json.dumps(msgspec.to_builtins(card)), type=RobotCard) == card
    welcome = Welcome(**msgspec.structs.asdict(card), session=7)
    assert decode_robot_message(encode(welcome)) == welcome
    assert Layout.from_json(card.action_layout) == profile.action_layout()
    assert len(card.slew_per_s) == len(card.slew_down_per_s) == len(profile.actions)


def test_a_card_states_the_numbers_of_the_profile() -> None:
    profile = load_profile(find_profile("lab-car"))
    card = card_of(profile)
    assert (card.robot, card.body, card.image_size) == ("lab-car", "car", (160, 120))
    assert (card.control_hz, card.tick_hz) == (20.0, 100.0)
    assert (card.deadline_ms, card.max_observation_age_ms) == (250, 400)
    # Steering and throttle, which may fall to rest at once.
    assert (card.slew_per_s, card.slew_down_per_s) == ((0.0, 4.0), (0.0, 0.0))
    assert card.camera_deg == (0.0, 48.8)
    assert card.turning == pytest.approx((math.radians(108.0), 0.0))
    assert (card.arming, card.clock, card.reset) == ("person", "real", ())
    weights = {"velocity": 1.0, "collision": -10.0, "stall": -1.0}
    assert card.reward == weights | {"collision_ends_episode": 1.0}
    twin = card_of(profile, arming="anyone", clock="twin", pictures=False)
    assert (twin.arming, twin.clock, twin.image_size) == ("anyone", "twin", None)
    assert twin.camera_deg == (None, None)


def test_a_welcome_without_a_required_field_is_refused() -> None:
    card = card_of(load_profile(find_profile("car")))
    fields = msgspec.to_builtins(card) | {"kind": "welcome", "session": 1}
    for missing in ("deadline_ms", "control_hz", "arming", "max_observation_age_ms"):
        rest = {name: value for name, value in fields.items() if name != missing}
        with pytest.raises(LinkError, match=missing):
            decode_robot_message(msgspec.msgpack.encode(rest))
