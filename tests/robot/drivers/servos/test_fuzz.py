"""The driver survives arbitrary bytes on the bus."""

import math

import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as examples
from hypothesis import strategies as st

from shapechanger.errors import RobotError
from tests.robot.drivers.servos.rigs import Rig, of
from tests.robot.drivers.servos.wire import FEETECH, pack, status


def _feetech(servo_id: int, error: int, data: bytes = b"") -> bytes:
    return status(servo_id, error, data, FEETECH)


_ids = st.integers(0, 255)
# Random bytes rarely form a packet, so include valid packets with random content and cut ones.
_noise = st.one_of(
    st.binary(max_size=60),
    st.builds(pack, _ids, st.integers(0, 255), st.binary(max_size=40)),
    st.builds(status, _ids, st.integers(0, 255), st.binary(max_size=40)),
    st.builds(lambda p, n: p[:n], st.builds(status, _ids, st.just(0)), st.integers(0, 11)),
    st.binary(min_size=3, max_size=9).map(lambda tail: b"\xff\xff\xfd\x00" + tail),
    st.builds(_feetech, _ids, st.integers(0, 255), st.binary(max_size=40)),
    st.builds(lambda p, n: p[:n], st.builds(_feetech, _ids, st.just(0)), st.integers(0, 6)),
    st.binary(min_size=1, max_size=9).map(lambda tail: b"\xff\xff" + tail),
)
_slow = examples(max_examples=20, suppress_health_check=[HealthCheck.too_slow])


@pytest.mark.parametrize("family", ["Dynamixel", "Feetech"])
@_slow
@given(noise=st.lists(_noise, max_size=5), tension=st.floats(-50, 50))
def test_noise_never_breaks_the_driver_or_its_caps(
    family: str, noise: list[bytes], tension: float
) -> None:
    """Setting up succeeds or raises a whole sentence, and no servo pulls more than its cap."""
    rig, errors = Rig(of(family)), list[str]()
    for data in noise[:2]:
        rig.port.inject(data)
        try:
            rig.bus.set_up()
        except RobotError as error:
            errors.append(str(error))
    assert all(one.endswith(".") for one in errors)
    rig.start()
    first = rig.settings.servos[0]
    cap = first.most_counts * first.known.ampere_per_goal
    for data in noise:
        rig.port.inject(data)
        seen = rig.run(tension)
        assert all(0.0 <= one <= cap for one in rig.pulls())
        assert all(math.isfinite(x) for found in seen.values() for x in found.values())
    rig.bus.close()
