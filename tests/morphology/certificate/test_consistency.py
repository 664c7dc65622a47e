"""Compiled models with inconsistent numbers."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import pytest

from shapechanger.morphology.certificate import inconsistencies
from tests.morphology.scenes import EVERYTHING, asset, everything


@pytest.mark.parametrize("name", ["ant", "hopper", "humanoid", "inverted_pendulum", "pusher_v5"])
def test_compiled_models_are_consistent(name: str) -> None:
    assert inconsistencies(asset(name)) == ()
    assert inconsistencies(everything()) == ()


def test_a_mass_written_into_a_compiled_model_is_found() -> None:
    """By its stale constants, with the values measured on Ant-v5, and then by its inertia."""
    model = asset("ant")
    model.body("torso").mass[:] = 3.0
    message = " ".join(inconsistencies(model))
    assert "body_subtreemass is 0.9109, but the model makes it 3.584" in message
    assert "torso: body_invweight0 is 1.101, but the model makes it 0.2793" in message
    assert "mj_setConst" in message
    mujoco.mj_setConst(model, mujoco.MjData(model))
    assert inconsistencies(model) == ()
    (message,) = inconsistencies(model, asset("ant"))
    assert message.startswith("torso: mass goes from 0.3272 to 3 kg, but its inertia stays 0.00818")


def test_mass_and_inertia_together_are_fine() -> None:
    model = asset("ant")
    model.body("torso").mass[:] *= 2.0
    model.body("torso").inertia[:] *= 2.0
    mujoco.mj_setConst(model, mujoco.MjData(model))
    assert inconsistencies(model, asset("ant")) == ()
    assert inconsistencies(asset("ant"), asset("hopper")) == ()


_IGNORED: dict[str, tuple[Callable[[mujoco.MjModel], object], str]] = {
    "centre of mass": (
        lambda m: m.body("wheel").ipos.fill(0.1),
        "wheel: body_sameframe is 1, but the model makes it 3, so body_ipos or body_iquat",
    ),
    "place of a geom": (
        lambda m: m.geom("leg").pos.fill(0.1),
        "geom_pos or geom_quat is ignored",
    ),
    "size of a geom": (lambda m: m.geom("leg").size.fill(0.2), "leg: geom_rbound is 0.1"),
    "gravity compensation": (
        lambda m: m.body_gravcomp.fill(1.0),
        "flg_gravcomp is not set, so body_gravcomp is ignored",
    ),
    "adhesion": (
        lambda m: m.geom_adhesion.fill(1.0),
        "flg_adhesion is not set, so geom_adhesion and pair_adhesion are ignored",
    ),
    "surface velocity": (
        lambda m: m.geom_surfacevel.fill(1.0),
        "flg_surfacevel is not set, so geom_surfacevel is ignored",
    ),
    "damping of an actuator": (
        lambda m: m.actuator_damping.fill(1.0),
        "so the actuator's damping or armature is ignored",
    ),
    "length of a tendon": (lambda m: m.tendon_length0.fill(9.0), "tendon_length0 is 9"),
}


@pytest.mark.parametrize("what", _IGNORED)
def test_writes_without_effect_are_found(what: str) -> None:
    edit, message = _IGNORED[what]
    model = mujoco.MjModel.from_xml_string(EVERYTHING.replace('gravcomp=".1"', ""))
    assert inconsistencies(model) == ()
    edit(model)
    assert message in " ".join(inconsistencies(model))


def test_bits_that_were_not_compiled_are_found() -> None:
    model = everything()
    model.geom("wheel").contype[:] = 1
    (message,) = inconsistencies(model)
    assert message.startswith("wheel: geom_contype or geom_conaffinity has bits that its body")
    model = everything()
    model.geom("paint").contype[:] = 1
    (message,) = inconsistencies(model)
    assert message.startswith("MuJoCo cannot derive its constants from the model: ")


_BODY = "<body name='b'><joint/><inertial mass='1' pos='0 0 0' diaginertia='1 1 2'/></body>"


@pytest.mark.parametrize(
    ("inertia", "message"),
    [
        ((0.0, 0.0, 0.0), "comes with inertia 0 kg·m²"),
        ((-1.0, 1.0, 1.0), "comes with inertia -1 kg·m²"),
        ((0.1, 0.1, 0.3), "more than the other two together"),
        ((1.0, 1.0, 2.0), ""),
    ],
)
def test_impossible_inertias_are_found(inertia: tuple[float, float, float], message: str) -> None:
    """Moments must be positive, and the largest at most the sum of the others, as of a thin rod."""
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{_BODY}</worldbody></mujoco>")
    model.body("b").inertia[:] = inertia
    found = [each for each in inconsistencies(model) if each.startswith("b: mass")]
    assert bool(found) == bool(message)
    assert message in "".join(found)


def test_an_empty_model_is_consistent() -> None:
    assert inconsistencies(mujoco.MjModel.from_xml_string("<mujoco/>")) == ()
