"""Effective contacts, compared with contacts of simulated scenes."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from shapechanger.morphology.certificate.numbers import moved_numbers

_Contact = dict[str, tuple[float | str, ...]]
_SHAPES = {
    "sphere": "size='.1'",
    "capsule": "size='.08 .1'",
    "box": "size='.1 .08 .09'",
    "ellipsoid": "size='.1 .08 .09'",
    "cylinder": "size='.1 .08'",
}
_SCENE = """
<mujoco>
  <option cone="elliptic" {option}><flag {flag}/></option>
  <asset>{assets}</asset>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" {floor}/>
    <body name="ball" pos="0 0 .05">
      <freejoint/>
      <geom name="ball" size=".1" {ball}/>
      {children}
    </body>
    {bodies}
  </worldbody>
  <contact>{contact}</contact>
</mujoco>
"""


def _scene(**parts: str) -> mujoco.MjModel:
    names = ("assets", "option", "floor", "ball", "children", "bodies", "contact")
    defaults = dict.fromkeys(names, "") | {"flag": "contact='enable'"}
    return mujoco.MjModel.from_xml_string(_SCENE.format(**(defaults | parts)))


def _simulated(model: mujoco.MjModel) -> dict[str, list[mujoco.MjContact]]:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found: dict[str, list[mujoco.MjContact]] = {}
    for contact in data.contact:
        names = sorted(model.geom(geom).name for geom in contact.geom)
        found.setdefault(" + ".join(names), []).append(contact)
    return found


def _contacts(model: mujoco.MjModel) -> dict[str, _Contact]:
    return {
        name: {field.removeprefix("contact "): values for field, values in fields.items()}
        for name, fields in moved_numbers(model)["contacts"].items()
    }


def _assert_equal(ours: _Contact, theirs: mujoco.MjContact) -> None:
    assert ours["dimension"] == (theirs.dim,)
    acting = [value for value in ours["friction"] if value]
    counts = {1: 0, 3: 2, 4: 3, 6: 5}
    np.testing.assert_array_equal(acting, theirs.friction[: counts[theirs.dim]])
    np.testing.assert_allclose(np.array(ours["solref"], float), theirs.solref, rtol=1e-15)
    np.testing.assert_allclose(np.array(ours["solimp"], float), theirs.solimp, rtol=1e-15)
    assert ours["margin"] == (theirs.includemargin,)
    assert ours["adhesion"] == (theirs.adhesion,)
    if "friction solref" in ours:
        np.testing.assert_array_equal(ours["friction solref"], theirs.solreffriction)


def _random_geom(random: np.random.Generator, name: str) -> str:
    shape = str(random.choice(list(_SHAPES)))
    solref = random.uniform(0.01, 0.05), random.uniform(0.5, 2.0)
    if random.random() < 0.3:
        solref = -random.uniform(100.0, 900.0), -random.uniform(1.0, 50.0)
    low, high = sorted(random.uniform(0.5, 0.99, size=2))
    numbers = {
        "priority": (int(random.integers(0, 2)),),
        "condim": (int(random.choice([1, 3, 4, 6])),),
        "solmix": (float(random.choice([0.0, 0.5, 1.0, 3.0])),),
        "friction": random.uniform(0.0, 2.0, size=3),
        "solref": solref,
        "solimp": (low, high, random.uniform(0.001, 0.01), 0.4, 2.0),
        "margin": (random.uniform(0.0, 0.01),),
        "gap": (random.uniform(0.0, 0.01),),
        "adhesion": (random.uniform(0.0, 1.0),),
    }
    written = " ".join(f'{key}="{" ".join(map(str, row))}"' for key, row in numbers.items())
    x, y, z = random.uniform(-0.03, 0.03, size=3)
    return f"<geom name='{name}' type='{shape}' {_SHAPES[shape]} pos='{x} {y} {z}' {written}/>"


@pytest.mark.parametrize("seed", range(6))
def test_random_scenes_have_the_predicted_contacts(seed: int) -> None:
    random = np.random.default_rng(seed)
    bodies = "".join(
        f"<body pos='0 0 .05'><freejoint/>{_random_geom(random, f'g{i}')}</body>" for i in range(6)
    )
    model = _scene(bodies=bodies)
    predicted, simulated = _contacts(model), _simulated(model)
    assert len(simulated) > 10
    assert set(simulated) <= set(predicted)
    for name, contacts in simulated.items():
        for contact in contacts:
            _assert_equal(predicted[name], contact)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("flag", ["contact='enable'", "filterparent='disable'"])
def test_contact_pairs_are_those_of_mujoco(seed: int, flag: str) -> None:
    """In random trees of overlapping balls, exactly the predicted pairs collide."""
    random = np.random.default_rng(seed)
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1])
    bodies = [spec.worldbody]
    for i in range(9):
        parent = bodies[random.integers(len(bodies))]
        body = parent.add_body(name=f"b{i}")
        if random.random() < 0.5:
            body.add_joint(name=f"j{i}", axis=random.normal(size=3))
        types = random.integers(0, 4, size=2).tolist()
        body.add_geom(name=f"g{i}", size=[0.1, 0, 0], contype=types[0], conaffinity=types[1])
        body.mass, body.inertia, body.explicitinertial = 1.0, [1, 1, 1], True
        bodies.append(body)
    for i, j in random.integers(0, 9, size=(2, 2)):
        if i != j:
            spec.add_exclude(bodyname1=f"b{i}", bodyname2=f"b{j}")
    i, j = random.choice(9, size=2, replace=False)
    spec.add_pair(geomname1=f"g{i}", geomname2=f"g{j}", condim=4)
    if "filterparent" in flag:
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    model = spec.compile()
    moving = {
        name
        for name in _simulated(model)
        if any(model.body_treeid[model.geom(geom).bodyid[0]] >= 0 for geom in name.split(" + "))
    }
    assert set(_contacts(model)) == moving


def test_the_override_replaces_all_but_dimension_gap_and_adhesion() -> None:
    option = "o_margin='.1' o_solref='.05 3' o_solimp='.8 .9 .01 .5 2' o_friction='.1 .2 .3 .4 0'"
    model = _scene(
        option=option,
        flag="override='enable'",
        ball="condim='6' friction='9 9 9' solref='.1 1' gap='.3' adhesion='2'",
    )
    contact = _contacts(model)["ball + floor"]
    assert contact["friction"] == (0.1, 0.2, 0.3, 0.4, 1e-5)
    assert contact["gap"] == (0.3,)
    _assert_equal(contact, _simulated(model)["ball + floor"][0])


def test_an_explicit_pair_has_its_own_parameters() -> None:
    """A pair ignores the collision bits and may join a parent and its child."""
    child = "<body name='c'><joint/><geom name='c' size='.1' contype='0' conaffinity='0'/></body>"
    pair = (
        "<pair geom1='floor' geom2='ball' friction='.1 .9 .01 .02 .03' condim='6'"
        " solref='.03 1' solreffriction='.1 2' margin='.01' adhesion='3'/>"
        "<pair geom1='c' geom2='ball'/>"
    )
    model = _scene(children=child, contact=pair)
    predicted, simulated = _contacts(model), _simulated(model)
    assert set(predicted) == set(simulated) == {"ball + floor", "ball + c"}
    assert predicted["ball + floor"]["friction solref"] == (0.1, 2.0)
    for name, (contact,) in simulated.items():
        _assert_equal(predicted[name], contact)
    model.opt.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL  # Pyramidal cones ignore `solreffriction`.
    assert "friction solref" not in _contacts(model)["ball + floor"]


def test_two_pairs_of_the_same_geoms_are_two_contacts() -> None:
    pair = "<pair geom1='floor' geom2='ball'/><pair geom1='ball' geom2='floor' condim='1'/>"
    found = {
        name: contact["dimension"] for name, contact in _contacts(_scene(contact=pair)).items()
    }
    assert found == {"ball + floor": (3,), "ball + floor (2)": (1,)}
    for flag in ("contact='disable'", "constraint='disable'"):
        assert _contacts(_scene(flag=flag, contact=pair)) == {}


def test_friction_has_its_own_softness_only_where_it_differs() -> None:
    """A pair without `solreffriction`, or with the same as `solref`, has one softness."""
    pair = "<pair geom1='floor' geom2='ball' solref='.03 1' {}/>"
    ends = (
        "",
        "solreffriction='.03 1'",
        "solreffriction='.1 2'",
        "solreffriction='.1 2' condim='1'",
    )
    found = _contacts(_scene(contact="".join(map(pair.format, ends))))
    assert ["friction solref" in contact for contact in found.values()] == [0, 0, 1, 0]


@pytest.mark.parametrize(
    ("field", "floor", "ball"),
    [
        *(("solmix", *mixes) for mixes in ((1e-16, 3e-16), (1e-15, 3e-15), (3e-15, 1e-15))),
        *(("solref", *refs) for refs in (((0.03, 0.0), (0.02, 1.0)), ((0.02, 1.0), (0.03, 0.0)))),
        *(("solref", *refs) for refs in (((0.0, 1.0), (0.02, 0.5)), ((0.02, 0.5), (0.0, 1.0)))),
    ],
)
def test_parameters_at_a_bound_are_mixed_as_in_mujoco(field: str, floor: Any, ball: Any) -> None:
    model = _scene(floor="solref='.03 1'", ball="solref='.05 2'")
    getattr(model.geom("floor"), field)[:], getattr(model.geom("ball"), field)[:] = floor, ball
    _assert_equal(_contacts(model)["ball + floor"], _simulated(model)["ball + floor"][0])


def test_a_child_that_comes_before_a_part_of_its_parent_does_not_touch_it() -> None:
    child = "<body name='c'><joint/><geom name='c' size='.1'/></body>"
    part = "<body name='p'><geom name='p' size='.1'/></body>"
    model = _scene(children=child + part)
    assert (
        set(_contacts(model))
        == set(_simulated(model))
        == {"ball + floor", "c + floor", "floor + p"}
    )


def test_static_and_unsupported_pairs_are_left_out() -> None:
    """Height fields do not collide with planes, nor mocap bodies with static geoms."""
    asset = "<hfield name='h' nrow='2' ncol='2' size='1 1 1 1' elevation='0 1 0 1'/>"
    bodies = (
        "<body mocap='true'><geom name='ghost' size='.1'/></body>"
        "<body pos='0 0 .05'><freejoint/><geom name='tray' type='hfield' hfield='h'/>"
        "<inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/></body>"
    )
    assert set(_contacts(_scene(bodies=bodies, assets=asset))) == {
        "ball + floor",
        "ball + ghost",
        "ball + tray",
        "ghost + tray",
    }


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast", "discrete"])
@pytest.mark.parametrize("refsafe", ["enable", "disable"])
def test_contact_stiffness_is_limited_by_the_time_step(integrator: str, refsafe: str) -> None:
    """Time constants below two time steps are clipped, as the simulation clips them.

    The integrator `discrete` does not clip them, nor does a model with `refsafe` disabled.
    """
    effective, moved = [], []
    for solref in ("solref='0.012 1'", "solref='0.002 1'"):
        option = f"integrator='{integrator}' timestep='0.01'"
        model = _scene(option=option, flag=f"refsafe='{refsafe}'", floor=solref, ball=solref)
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, nstep=20)
        effective.append(_contacts(model))
        moved.append(data.qpos.copy())
    same = integrator != "discrete" and refsafe == "enable"
    assert (effective[0] == effective[1]) == same
    assert np.array_equal(*moved) == same
    if same:
        assert effective[0]["ball + floor"]["solref"] == (0.02, 1.0)
