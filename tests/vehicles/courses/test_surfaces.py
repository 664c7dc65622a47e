"""Looks, textures, meshes, images, and collision geoms of courses."""

from collections.abc import Iterator
from dataclasses import replace
from types import MappingProxyType

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from shapechanger.vehicles.cameras.camera import OnboardCamera
from shapechanger.vehicles.courses import lay_out, textures
from shapechanger.vehicles.courses.course import LOOKS, VARIANTS, Course, Look, Wall
from shapechanger.vehicles.courses.geometry import distances_to_segments, wall_segments
from shapechanger.vehicles.courses.scene import add_course
from shapechanger.vehicles.courses.surfaces import BANK_M, QuadMesh, Surfaces, fittings, moored
from shapechanger.vehicles.courses.textures import PAINTERS, texture
from tests.vehicles.courses.scenes import in_lane, square, with_walls


@pytest.mark.parametrize("world", LOOKS)
def test_a_random_look_stays_in_its_ranges(world: str) -> None:
    usual = Look.of(world)
    for seed in range(200):
        look = Look.random(world, np.random.default_rng(seed))
        for value, low, high in (
            (look.light, 0.6 * usual.light, min(1.0, 1.4 * usual.light)),
            (look.warmth, max(0.0, usual.warmth - 0.35), min(1.0, usual.warmth + 0.35)),
            (look.contrast, max(0.0, usual.contrast - 0.3), min(1.0, usual.contrast + 0.3)),
            (look.gloss, 0.4 * usual.gloss, min(0.9, 1.6 * usual.gloss)),
            *((channel, 0.75, 1.0) for channel in (*look.wall, *look.ground)),
        ):
            assert low - 1e-12 <= value <= high + 1e-12
        assert 0 <= look.texture_seed < VARIANTS


@pytest.mark.parametrize("name", PAINTERS)
def test_a_texture_is_small_varied_and_reproducible(name: str) -> None:
    """Equal seeds give equal textures, read-only and of at most 512 pixels a side."""
    image = texture(name, 1)
    assert (image.dtype, image.shape[2]) == (np.uint8, 3)
    assert max(image.shape) <= 512
    assert image.std() > 1.0
    assert not image.flags.writeable
    texture.cache_clear()
    np.testing.assert_array_equal(texture(name, 1), image)
    assert not np.array_equal(texture(name, 2), image)


@pytest.mark.parametrize(
    "name",
    ["floor", "asphalt", "water", "sea", "paving", "grass", "hedge", "ceiling", "brick", "fence"],
)
def test_repeating_textures_have_no_upright_seam(name: str) -> None:
    image = texture(name, 3).astype(float)
    inside = np.abs(np.diff(image, axis=1)).mean(axis=(0, 2))
    seam = np.abs(image[:, 0] - image[:, -1]).mean()
    assert seam <= inside.max() * 1.5


_SEEDS = (0, 1, 2, 5, 1_000_000)
# Largest distance by which tyres and ladders stick out of a wall, m.
_PROUD_M = 0.021


def _from_walls(course: Course, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of points, m, (n, 2), from the nearest wall, m, (n,)."""
    return distances_to_segments(points, wall_segments(course.walls)).min(axis=1)


def _points(mesh: QuadMesh) -> NDArray[np.float64]:
    return mesh.arrays(mirrored=False)[0]


@pytest.mark.parametrize("seed", _SEEDS)
def test_the_lane_stays_free(seed: int) -> None:
    """Fittings, moored boats and quays are behind the walls, except for tyres and ladders."""
    course = lay_out("harbour", seed)
    banks = Surfaces(course, Look.of("harbour")).walls()
    flat = np.concatenate([_points(p) for p in (*banks.values(), fittings(course))])[:, :2]
    assert in_lane(course, course.route).all()  # The check itself works.
    wrong = in_lane(course, flat) & (_from_walls(course, flat) > _PROUD_M)
    assert not wrong.any()


@pytest.mark.parametrize("seed", _SEEDS)
def test_boats_are_moored_behind_quays(seed: int) -> None:
    """There are at least three boats, and none overlaps with a quay or another boat."""
    course = lay_out("harbour", seed)
    boats = moored(course)
    assert len(boats) >= 3
    uvs = np.array([(boat.x, boat.y) for boat in boats])
    near = _from_walls(course, uvs)
    assert not in_lane(course, uvs).any()
    for boat, metres in zip(boats, near, strict=True):
        assert BANK_M < metres < BANK_M + 0.34 * boat.length
    gaps = np.linalg.norm(uvs[:, None] - uvs, axis=2) + 9.0 * np.eye(len(boats))
    assert gaps.min() > 1.5


@pytest.mark.parametrize("seed", _SEEDS)
def test_obstacles_are_drawn_at_their_place(seed: int) -> None:
    course = lay_out("harbour", seed)
    for obstacle in course.obstacles:
        alone = replace(course, obstacles=(obstacle,))
        points = _points(Surfaces(alone, Look.of("harbour")).obstacles())
        cosine, sine = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
        flat = (points[:, :2] - (obstacle.x, obstacle.y)) @ np.array(
            [[cosine, -sine], [sine, cosine]]
        )
        half = 0.5 * np.array([obstacle.length, obstacle.width])
        assert points[:, 2].min() >= 0.0
        assert points[:, 2].max() == pytest.approx(obstacle.height, rel=0.01)
        if obstacle.is_round:
            assert np.linalg.norm(flat, axis=1).max() == pytest.approx(half[0], rel=0.01)
        else:
            np.testing.assert_allclose(np.abs(flat).max(axis=0), half, rtol=0.01)


_WORLDS = ("corridor", "yard", "harbour")
# Collision bits of a vehicle's hull and wheels.
_HULL, _WHEEL = {"contype": 2, "conaffinity": 1}, {"contype": 10, "conaffinity": 5}


def _compiled(world: str, contype: int = 0, conaffinity: int = 0) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    add_course(spec, square(world), Look.of(world))
    if contype:
        body = spec.worldbody.add_body(name="ball")
        body.add_freejoint()
        body.add_geom(name="ball", size=[0.1, 0.0, 0.0], contype=contype, conaffinity=conaffinity)
    return spec.compile()


def _touched(model: mujoco.MjModel, *place: float) -> set[str]:
    data = mujoco.MjData(model)
    data.qpos[:3] = place
    mujoco.mj_forward(model, data)
    names = {model.geom(number).name for contact in data.contact for number in contact.geom}
    return names - {"ball"}


@pytest.mark.parametrize("world", _WORLDS)
def test_collision_and_visual_geoms_are_separate(world: str) -> None:
    model = _compiled(world)
    touchable = (model.geom_contype | model.geom_conaffinity) > 0
    assert (model.geom_group[touchable] == 3).all()
    assert (model.geom_group[~touchable] == 0).all()
    assert (model.geom_type[~touchable] == mujoco.mjtGeom.mjGEOM_MESH).all()


@pytest.mark.parametrize(("bits", "ground"), [(_HULL, set()), (_WHEEL, {"world/ground"})])
def test_hulls_and_wheels_touch_walls_and_obstacles(bits: dict[str, int], ground: set[str]) -> None:
    """The visible side of a wall is its collision surface; only wheels touch the ground."""
    model = _compiled("corridor", **bits)
    assert _touched(model, 0.0, 3.0, 0.05) == ground
    assert _touched(model, 3.5, -0.89, 0.3) == set()
    assert _touched(model, 3.5, -0.91, 0.3) == {"world/wall/0"}
    assert _touched(model, 6.6, 2.8, 0.3) == {"world/thing/1"}


_WHITE = Look(light=1.0, warmth=0.0, contrast=0.0, gloss=0.0)
_WIDTH, _HEIGHT = 160, 120


def _draw(
    course: Course, look: Look, place: tuple[float, float], angle: float
) -> NDArray[np.uint8]:
    """Render the view at `place`, 0.5 m above the ground, along `angle`, rad."""
    spec = mujoco.MjSpec()
    add_course(spec, course, look)
    cos, sin = float(np.cos(angle)), float(np.sin(angle))
    spec.worldbody.add_camera(
        name="eye", pos=[*place, 0.5], xyaxes=[sin, -cos, 0.0, 0.0, 0.0, 1.0], fovy=66.0
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = OnboardCamera((_WIDTH, _HEIGHT), "eye")
    try:
        return camera.picture(model, data)
    finally:
        camera.close()


@pytest.fixture
def quarters(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Paint windows with a texture that is green at the top left, red on the right, blue below."""

    def painted(rng: np.random.Generator) -> NDArray[np.float32]:
        del rng
        image = np.zeros((64, 64, 3), np.float32)
        image[:32, :32, 1] = image[:32, 32:, 0] = image[32:, :, 2] = 1.0
        return image

    monkeypatch.setattr(
        textures, "PAINTERS", MappingProxyType({**textures.PAINTERS, "window": painted})
    )
    textures.texture.cache_clear()
    yield
    textures.texture.cache_clear()


@pytest.mark.gl
@pytest.mark.usefixtures("gl", "quarters")
@pytest.mark.parametrize("angle", [0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi])
def test_a_texture_is_upright_and_not_mirrored(angle: float) -> None:
    ahead = np.array([np.cos(angle), np.sin(angle)])
    right = np.array([ahead[1], -ahead[0]])
    # A wall 1.8 m wide, 1 m ahead; its visible side is on the left of its direction.
    start, end = ahead + 0.9 * right, ahead - 0.9 * right
    wall = Wall((start[0], start[1]), (end[0], end[1]), 1.0, "window")
    picture = _draw(with_walls(square("corridor"), wall), _WHITE, (0.0, 0.0), angle)
    top, bottom = _HEIGHT // 2 - 20, _HEIGHT // 2 + 20
    left, right_hand = _WIDTH // 2 - 30, _WIDTH // 2 + 30
    assert picture[top, left].argmax() == 1
    assert picture[top, right_hand].argmax() == 0
    assert picture[bottom, left].argmax() == picture[bottom, right_hand].argmax() == 2


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_a_glossy_floor_reflects_lamps() -> None:
    course = square("corridor")
    dull, glossy = (
        _draw(course, replace(Look.of("corridor"), gloss=gloss), (-0.5, 0.0), 0.0)
        for gloss in (0.0, 0.6)
    )
    # In this yellow light, only the lamp is white.
    below = slice(_HEIGHT // 2, None)
    assert glossy[below, :, 2].max() > 1.5 * dull[below, :, 2].max()
