"""Properties of all four vehicles."""

import math

import mujoco
import numpy as np
import pytest

from shapechanger.vehicles.bodies import SIM_DT, VEHICLES, add_vehicle
from shapechanger.vehicles.bodies.parts import BATTERY_V
from shapechanger.vehicles.bodies.visuals import OUTSIDE_VIEW, OWN_VIEW
from tests.vehicles.bodies.grounds import AHEAD, ALL, LAND, TO_THE_LEFT, ground


@pytest.mark.parametrize("name", ALL)
def test_a_vehicle_stays_at_rest(name: str) -> None:
    """The vehicle moves by less than 0.1 mm in ten seconds."""
    here = ground(name)
    here.drive(1.0, {})
    before = here.vehicle.motion()
    here.drive(10.0, {})
    after = here.vehicle.motion()
    assert math.hypot(after.x - before.x, after.y - before.y) < 1e-4
    assert abs(after.heading - before.heading) < 1e-4
    assert abs(here.height()) < 1e-3
    assert here.vehicle.current_a() == 0.0


@pytest.mark.parametrize("name", ALL)
def test_top_speed_is_as_declared_and_falls_with_the_voltage(name: str) -> None:
    here = ground(name)
    here.drive(6.0, AHEAD[name])
    assert here.vehicle.motion().speed == pytest.approx(here.kind.top_speed_mps, rel=0.1)
    pose = here.vehicle.motion()
    assert abs(pose.y) < 0.02
    assert here.vehicle.travelled_m() == pytest.approx(pose.x, rel=0.03)
    here.drive(5.0, AHEAD[name], battery_v=0.8 * BATTERY_V)
    assert 0.6 < here.vehicle.motion().speed / here.kind.top_speed_mps < 0.9


@pytest.mark.parametrize("name", ALL)
def test_left_is_counter_clockwise(name: str) -> None:
    here = ground(name)
    here.drive(3.0, TO_THE_LEFT[name])
    left = here.vehicle.motion().yaw_rate
    assert left > 0.1
    turning = ("steering", "rudder", "left track", "right track")
    mirrored = {part: -v if part in turning else v for part, v in TO_THE_LEFT[name].items()}
    here.vehicle.place(0.0, 0.0, 0.0)
    here.drive(3.0, mirrored)
    assert here.vehicle.motion().yaw_rate == pytest.approx(-left, rel=0.02)


@pytest.mark.parametrize("name", LAND)
def test_zero_brakes_and_none_coasts(name: str) -> None:
    here = ground(name)
    ways: list[float] = []
    for value in (0.0, None):
        here.vehicle.place(0.0, 0.0, 0.0)
        here.drive(3.0, AHEAD[name])
        start = here.vehicle.motion().x
        here.drive(0.5, dict.fromkeys(AHEAD[name], value))
        ways.append(here.vehicle.motion().x - start)
        assert here.vehicle.current_a() == 0.0
    braked, coasted = ways
    assert 0.0 < braked < 0.3 * here.kind.top_speed_mps
    assert coasted > 1.3 * braked


@pytest.mark.parametrize("name", ALL)
def test_a_stalled_motor_draws_the_largest_current(name: str) -> None:
    """The resistance of the winding limits the stall current; at speed, less current flows."""
    here = ground(name)
    here.vehicle.drive(AHEAD[name], BATTERY_V)
    stalled = here.vehicle.current_a()
    motors = 2 if name == "tank" else 1
    assert stalled == pytest.approx(motors * BATTERY_V / 1.0, rel=0.01)  # 1 Ohm.
    here.drive(3.0, AHEAD[name])
    assert 0.2 < here.vehicle.current_a() < 0.3 * stalled


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("heading", [0.0, 0.6])
def test_a_wall_stops_a_vehicle(name: str, heading: float) -> None:
    """The vehicle neither climbs the wall nor tips over."""
    here = ground(name, wall_x=6.0)
    here.vehicle.place(0.0, 0.0, heading)
    most_height, least_upright, furthest = 0.0, 1.0, 0.0
    for _ in range(round(9.0 / SIM_DT)):
        here.vehicle.drive(AHEAD[name], BATTERY_V)
        mujoco.mj_step(here.model, here.data)
        most_height = max(most_height, abs(here.height()))
        least_upright = min(least_upright, here.uprightness())
        furthest = max(furthest, here.vehicle.motion().x)
    assert most_height < 0.05
    assert least_upright > math.cos(math.radians(20.0))
    assert 3.0 < furthest < 6.0
    if heading == 0.0:
        assert furthest == pytest.approx(6.0 - here.kind.nose_m, abs=0.05)
        assert here.pace() < 0.05


@pytest.mark.parametrize("name", ALL)
def test_random_outputs_are_stable(name: str) -> None:
    rng = np.random.default_rng(7)
    here = ground(name, wall_x=2.0)
    with np.errstate(all="raise"):
        for _ in range(300):
            values = {part: float(rng.uniform(-1.3, 1.3)) for part in AHEAD[name]}
            some = {part: None if rng.random() < 0.1 else value for part, value in values.items()}
            here.drive(0.2, some, battery_v=float(rng.uniform(5.0, 8.4)))
            assert abs(here.height()) < 0.1
            assert here.uprightness() > 0.8
    assert np.isfinite(here.data.qpos).all()
    assert np.isfinite(here.data.qvel).all()
    assert not any(warning.number for warning in here.data.warning)


@pytest.mark.parametrize("name", ALL)
def test_names_and_collision_bits(name: str) -> None:
    model = ground(name).model
    for i in range(model.ngeom):
        geom = model.geom(i)
        if geom.name.startswith("world/"):
            continue
        bits = (int(geom.contype[0]), int(geom.conaffinity[0]))
        assert bits in ((0, 0), (2, 1), (10, 5))
        drawn = (OWN_VIEW, OUTSIDE_VIEW)
        assert int(geom.group[0]) in (drawn if bits == (0, 0) else (3,))  # Group 3 is hidden.
    kinds = (model.body, model.nbody), (model.joint, model.njnt), (model.actuator, model.nu)
    for element, count in kinds:
        assert all(element(i).name.startswith(("vehicle/", "world")) for i in range(count))
    camera = model.camera("vehicle/camera")
    mount = VEHICLES[name].camera
    assert camera.pos == pytest.approx((mount.x, mount.y, mount.z))
    assert camera.fovy[0] == mount.fovy_deg


@pytest.mark.parametrize("name", ALL)
def test_a_body_is_within_its_declared_size(name: str) -> None:
    here = ground(name)
    hits: list[float] = []
    for geom in map(here.model.geom, range(here.model.ngeom)):
        if geom.contype[0] not in (2, 10):
            continue
        half = here.model.geom_aabb[geom.id, 3:]
        place, turn = here.data.geom_xpos[geom.id], here.data.geom_xmat[geom.id].reshape(3, 3)
        reach = np.abs(turn) @ half
        hits.append(place[0] + reach[0])
        assert abs(place[1]) + reach[1] <= here.kind.width_m / 2 + 1e-6
        assert place[0] - reach[0] >= here.kind.nose_m - here.kind.length_m - 1e-6
    assert max(hits) == pytest.approx(here.kind.nose_m, abs=1e-6)


@pytest.mark.parametrize("name", ALL)
def test_visual_geoms_change_no_physics(name: str) -> None:
    full, bare = mujoco.MjSpec(), mujoco.MjSpec()
    for spec in (full, bare):
        add_vehicle(spec, name)
    for geom in list(bare.geoms):
        if geom.group in (OWN_VIEW, OUTSIDE_VIEW):
            assert geom.contype == geom.conaffinity == 0
            assert geom.mass == 0.0
            bare.delete(geom)
    model, plain = full.compile(), bare.compile()
    for field in ("body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_M0"):
        np.testing.assert_array_equal(getattr(model, field), getattr(plain, field), err_msg=field)
    solid = (model.geom_contype | model.geom_conaffinity) > 0
    assert solid.sum() == plain.ngeom
    for field in ("type", "size", "pos", "quat", "friction", "solref", "solimp", "contype",
                  "conaffinity", "bodyid", "priority"):  # fmt: skip
        mine, theirs = getattr(model, f"geom_{field}")[solid], getattr(plain, f"geom_{field}")
        np.testing.assert_array_equal(mine, theirs, err_msg=field)
