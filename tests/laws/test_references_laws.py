"""Law of references: an edit keeps all references between elements correct, or is refused."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.errors import BrokenModel, MorphologyError
from shapechanger.morphology import (
    AddLimb,
    AddSegment,
    Cut,
    Damping,
    Edit,
    Gear,
    Lock,
    Mass,
    PlaceBody,
    Radius,
    Remove,
    Split,
    StartHeight,
    Stretch,
    compile_body,
)
from tests.morphology.mechanism import Mechanism

law = settings(max_examples=6)

_POINT = st.tuples(st.floats(-0.1, 0.1), st.floats(0.15, 0.4))
_MECHANISMS = st.builds(
    Mechanism,
    crank=_POINT,
    coupler=st.tuples(st.floats(0.2, 0.5), st.floats(-0.1, 0.1)),
    rocker=_POINT,
    pin=st.sampled_from([0.3, 0.7, 1.0]),
    tool=st.sampled_from([0.2, 0.8, 1.0]),
    turn=st.floats(-1.0, 1.0),
    slope=st.sampled_from([-1.0, 0.5, 2.0]),
    curve=st.sampled_from([0.0, 0.3]),
    form=st.sampled_from(["anchor", "reversed", "sites", "weld"]),
    floats=st.booleans(),
    in_degrees=st.booleans(),
    boundmass=st.sampled_from([0.0, 0.02]),
)
_LINKS = st.sampled_from(["crank", "coupler", "rocker", "tool", "left", "right"])
_RATIOS = st.floats(0.7, 1.4)
_EDITS: dict[type[Edit], st.SearchStrategy[Any]] = {
    Stretch: st.builds(Stretch, _LINKS, _RATIOS),
    Radius: st.builds(Radius, _LINKS, _RATIOS),
    Cut: st.builds(Cut, _LINKS, st.floats(0.4, 0.95)),
    Remove: st.builds(Remove, _LINKS),
    Split: st.builds(
        Split, _LINKS, st.just("part"), at=st.floats(0.1, 0.9), axis=st.just((0.0, 1.0, 0.0))
    ),
    AddSegment: st.builds(AddSegment, _LINKS, st.just("part"), st.just((0.0, 0.0, 0.1))),
    AddLimb: st.builds(AddLimb, _LINKS, st.just("_2"), st.floats(-3.0, 3.0), _RATIOS),
    Lock: st.builds(Lock, _LINKS, st.none() | st.floats(-0.4, 0.4)),
    Gear: st.builds(Gear, st.sampled_from(["*", "servo", "speed"]), scale=_RATIOS),
    Mass: st.builds(Mass, _LINKS, scale=_RATIOS),
    Damping: st.builds(Damping, _LINKS, to=_RATIOS),
    StartHeight: st.builds(StartHeight, st.just("base"), _RATIOS),
    PlaceBody: st.builds(
        PlaceBody, _LINKS, st.tuples(*[st.floats(-0.05, 0.05)] * 3).map(lambda p: (p[0], 0.0, p[2]))
    ),
}


@law
@given(mechanism=_MECHANISMS, data=st.data())
@pytest.mark.parametrize("kind", _EDITS)
def test_references_are_correct_after_an_edit(
    kind: type[Edit], mechanism: Mechanism, data: st.DataObject
) -> None:
    edit = data.draw(_EDITS[kind])
    before = mechanism.spec().compile()
    try:
        after = compile_body(mechanism.spec(), [edit])
    except MorphologyError as error:
        # `BrokenModel` would mean that MuJoCo refuses the edited model.
        assert not isinstance(error, BrokenModel), error  # noqa: PT017
        return
    _Check(before, after, edit).everything()


class _Check:
    """Check of one edit of a mechanism, for each kind of element that refers to others."""

    def __init__(self, before: mujoco.MjModel, after: mujoco.MjModel, edit: Edit) -> None:
        self.before, self.after, self.edit = before, after, edit
        self.old, self.new = mujoco.MjData(before), mujoco.MjData(after)
        mujoco.mj_forward(before, self.old)
        mujoco.mj_forward(after, self.new)
        self.gone = {*_names(before, "body")} - {*_names(after, "body")}
        self.copied = {n.removesuffix("_2") for n in _names(after, "body") if n.endswith("_2")}

    def everything(self) -> None:
        assert b"~" not in bytes(self.after.names)
        self.pin()
        self.couplings()
        self.switched_off_weld()
        self.tendons()
        self.actuators()
        self.sensors()
        self.contacts()
        self.views()
        self.keyframe()
        self.fitted_geom()
        self.skin()

    def has(self, kind: str, name: str) -> bool:
        return name in _names(self.after, kind)

    def pin(self) -> None:
        """The two ends of the pin coincide, and lie at the sites that mark them."""
        if not self.has("equality", "pin"):
            assert {"coupler", "rocker"} & self.gone
            return
        ends = self.ends_of("pin")
        assert set(ends) == {
            self.body_of_site("pin on coupler"),
            self.body_of_site("pin on rocker"),
        }
        for site in ("pin on coupler", "pin on rocker"):
            place = ends[self.body_of_site(site)]
            np.testing.assert_allclose(place, self.new.site(site).xpos, atol=1e-7)
        first, second = ends.values()
        np.testing.assert_allclose(first, second, atol=1e-7)

    def ends_of(self, name: str) -> dict[str, np.ndarray]:
        """Return the place of each end of a pin in the world, keyed by its body."""
        model, data = self.after, self.new
        pin = model.equality(name)
        first, second = int(pin.obj1id[0]), int(pin.obj2id[0])
        if model.eq_objtype[pin.id] == mujoco.mjtObj.mjOBJ_SITE:
            places = (data.site_xpos[first], data.site_xpos[second])
            first, second = model.site_bodyid[first], model.site_bodyid[second]
        else:
            welds = pin.type[0] == mujoco.mjtEq.mjEQ_WELD
            locals_ = (pin.data[3:6], pin.data[:3]) if welds else (pin.data[:3], pin.data[3:6])
            places = tuple(
                data.xpos[body] + data.xmat[body].reshape(3, 3) @ local
                for body, local in zip((first, second), locals_, strict=True)
            )
        names = [self.after.body(body).name for body in (first, second)]
        return dict(zip(names, places, strict=True))

    def body_of_site(self, site: str) -> str:
        return self.after.body(int(self.after.site(site).bodyid[0])).name

    def couplings(self) -> None:
        """The right joint starts where the coupling puts it, also if one of the two is locked."""
        mimic = self.before.equality("mimic").data
        edit = self.edit
        start = {j: self.after.joint(j).qposadr[0] for j in _names(self.after, "joint") if j}
        if self.has("equality", "mimic"):
            right = self.after.qpos0[start[_first(self.after, "mimic")]]
            if isinstance(edit, Lock) and edit.joint == "left":
                at = edit.position or 0.0
                assert right == pytest.approx(mimic[1] * at + mimic[2] * at**2, abs=1e-8)
            if isinstance(edit, Lock) and edit.joint == "right":
                assert right == pytest.approx((edit.position or 0.0) / mimic[1], abs=1e-8)
        else:
            assert "right" in self.gone
        if "right" in self.copied:
            assert self.has("equality", "mimic_2")

    def switched_off_weld(self) -> None:
        """A weld that is switched off keeps its relative pose, wherever the arm is now."""
        touched = getattr(self.edit, "body", "") in ("tool", "left")
        if self.has("equality", "grasp") and not touched and not self.copied:
            old, new = (model.equality("grasp").data for model in (self.before, self.after))
            np.testing.assert_allclose(new[:6], old[:6], atol=1e-9)
            assert abs(new[6:10] @ old[6:10]) == pytest.approx(1.0)
        if "tool" in self.copied:
            assert self.has("equality", "grasp_2")

    def tendons(self) -> None:
        """The path of a tendon keeps its elements; the path of its copy has their copies."""
        if self.has("tendon", "rope"):
            assert _path(self.after, "rope") == _path(self.before, "rope")
        else:
            assert "crank" in self.gone
        if "crank" in self.copied:
            path = [f"{name}_2" for name in _path(self.before, "rope")]
            assert _path(self.after, "rope_2") == path
            if isinstance(self.edit, AddLimb) and self.edit.size == 1.0:
                lengths = [self.new.tendon(name).length[0] for name in ("rope", "rope_2")]
                assert lengths[0] == pytest.approx(lengths[1])

    def actuators(self) -> None:
        """Actuators keep their targets, and servos their set points."""
        expected = {*_names(self.before, "actuator")}
        if not isinstance(self.edit, Lock) and not self.gone:
            assert expected <= {*_names(self.after, "actuator")}
        for name in {*_names(self.after, "actuator")} & expected:
            old, new = self.before.actuator(name), self.after.actuator(name)
            assert _target(self.after, name) == _target(self.before, name)
            if name in ("servo", "speed"):
                np.testing.assert_array_equal(new.gear, old.gear)
                np.testing.assert_array_equal(new.ctrlrange, old.ctrlrange)
                scale = new.gainprm[0] / old.gainprm[0]
                np.testing.assert_allclose(new.biasprm[:3], scale * old.biasprm[:3])
                np.testing.assert_allclose(new.forcerange, scale * old.forcerange)
                if isinstance(self.edit, Gear) and self.edit.element in ("*", name):
                    assert scale == pytest.approx(self.edit.scale)
        for limb, motors in {
            "crank": "servo muscle rod",
            "tool": "speed jet",
            "left": "sum",
        }.items():
            if limb in self.copied:
                assert all(self.has("actuator", f"{motor}_2") for motor in motors.split())

    def sensors(self) -> None:
        """Sensors measure the same elements as before."""
        for name in {*_names(self.after, "sensor")} & {*_names(self.before, "sensor")}:
            assert _sensed(self.after, name) == _sensed(self.before, name)
        if not isinstance(self.edit, Lock) and not self.gone:
            assert {*_names(self.before, "sensor")} <= {*_names(self.after, "sensor")}
        if "tool" in self.copied:
            assert _sensed(self.after, "tip_2") == ["tip_2", "origin"]

    def contacts(self) -> None:
        """All parts of excluded bodies remain excluded, and parts of paired geoms remain paired."""
        excluded = {frozenset(pair) for pair in _excluded(self.after)}
        paired = {self.after.geom(int(g)).name for g in self.after.pair_geom2}
        for body in _names(self.after, "body"):
            if body.removesuffix("_2") == "coupler" and "left" not in self.gone:
                assert frozenset({body, "left"}) in excluded
        if isinstance(self.edit, Split) and self.edit.body in ("coupler", "left"):
            other = {"coupler": "left", "left": "coupler"}[self.edit.body]
            assert frozenset({"part", other}) in excluded
        for geom in _names(self.after, "geom"):
            if geom.removesuffix("_of_part").removesuffix("_2") == "coupler":
                assert geom in paired

    def views(self) -> None:
        """Camera and light stay at the sites that mark them, and the camera keeps its target."""
        if "coupler" in self.gone:
            return
        np.testing.assert_allclose(
            self.new.camera("eye").xpos, self.new.site("eye").xpos, atol=1e-9
        )
        assert self.body_of_site("eye") == self.after.body(self.after.camera("eye").bodyid[0]).name
        lamp = self.after.light("lamp")
        if self.has("site", "lamp"):
            np.testing.assert_allclose(
                self.new.light_xpos[0], self.new.site("lamp").xpos, atol=1e-9
            )
            assert self.body_of_site("lamp") == self.after.body(lamp.bodyid[0]).name
        aim = self.after.body(self.after.camera("eye").targetbodyid[0]).name
        assert aim == ("base" if "left" in self.gone else "left")

    def keyframe(self) -> None:
        """Every joint and actuator keeps its values, and copies have the values of the original."""
        for model, address, values in (
            ("joint", "qposadr", "key_qpos"),
            ("actuator", "id", "key_ctrl"),
        ):
            for name in _names(self.after, model):
                known = name.removesuffix("_2")
                if known not in _names(self.before, model):
                    continue
                old = getattr(self.before, values)[0]
                new = getattr(self.after, values)[0]
                first = int(np.ravel(getattr(getattr(self.before, model)(known), address))[0])
                at = int(np.ravel(getattr(getattr(self.after, model)(name), address))[0])
                size = 7 if name == "root" else 1
                expected = old[first : first + size].copy()
                if name == "root" and isinstance(self.edit, StartHeight):
                    expected[2] = self.edit.to
                np.testing.assert_array_equal(new[at : at + size], expected)

    def fitted_geom(self) -> None:
        """Only an edit of its body changes the size of the capsule that is fitted to a mesh."""
        if not self.has("geom", "shell"):
            assert "rocker" in self.gone or isinstance(self.edit, Cut)
            return
        old, new = self.before.geom("shell").size[:2].copy(), self.after.geom("shell").size[:2]
        edit = self.edit
        on_rocker = getattr(edit, "body", "") == "rocker"
        if isinstance(edit, Stretch) and on_rocker:
            old[1] *= edit.factor
        if isinstance(edit, Radius) and on_rocker:
            old[0] *= edit.factor
        if not (isinstance(edit, Cut | Split) and on_rocker):
            np.testing.assert_allclose(new, old, rtol=1e-9)

    def skin(self) -> None:
        """An edit of the shape of a body removes the skin over it, which has no physical effect."""
        shaped = isinstance(self.edit, Stretch | Radius | Cut | Remove | Split)
        over = getattr(self.edit, "body", "") in ("left", "right")
        assert self.after.nskin == (0 if shaped and over else 1)


def _names(model: mujoco.MjModel, kind: str) -> list[str]:
    count = {"body": "nbody", "joint": "njnt", "equality": "neq", "actuator": "nactuator"}
    number = getattr(model, count.get(kind, f"n{kind}"))
    return [getattr(model, kind)(i).name for i in range(number)]


def _first(model: mujoco.MjModel, equality: str) -> str:
    return model.joint(int(model.equality(equality).obj1id[0])).name


def _path(model: mujoco.MjModel, tendon: str) -> list[str]:
    found: list[str] = []
    of = model.tendon(tendon).id
    first = int(model.tendon_adr[of])
    for i in range(first, first + int(model.tendon_num[of])):
        named = int(model.wrap_objid[i])
        if model.wrap_type[i] == mujoco.mjtWrap.mjWRAP_SITE:
            found.append(model.site(named).name)
        else:
            found += [model.geom(named).name, model.site(int(model.wrap_prm[i])).name]
    return found


def _target(model: mujoco.MjModel, actuator: str) -> list[str]:
    of = model.actuator(actuator)
    kind = mujoco.mjtTrn(int(of.trntype[0]))
    kinds = {mujoco.mjtTrn.mjTRN_JOINT: "joint", mujoco.mjtTrn.mjTRN_TENDON: "tendon"}
    ids = [int(i) for i in of.trnid if i >= 0][: 1 if kind in kinds else 2]
    return [getattr(model, kinds.get(kind, "site"))(i).name for i in ids]


def _sensed(model: mujoco.MjModel, sensor: str) -> list[str]:
    of = model.sensor(sensor)
    ends = ((of.objtype[0], of.objid[0]), (of.reftype[0], of.refid[0]))
    return [mujoco.mj_id2name(model, int(kind), int(i)) for kind, i in ends if i >= 0]


def _excluded(model: mujoco.MjModel) -> list[tuple[str, str]]:
    pairs = [divmod(int(signature), 1 << 16) for signature in model.exclude_signature]
    return [(model.body(a).name, model.body(b).name) for a, b in pairs]
