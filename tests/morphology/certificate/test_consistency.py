"""Compiled models with inconsistent numbers."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import pytest

from shapechanger.morphology.certificate import inconsistencies
from tests.morphology.scenes import EVERYTHING, asset, everything


@pytest.mark.parametrize("name", ["ant", "hopper", "humanoid", "everything"])
def test_compiled_models_are_consistent(name: str) -> None:
    assert inconsistencies(everything() if name == "everything" else asset(name)) == ()


def test_a_mass_written_into_a_compiled_model_is_found() -> None:
    """By its stale constants, with the values measured on Ant-v5, and then by its inertia."""
    model = asset("ant")
    model.body("torso").mass[:] = 3.0
    message = " ".join(inconsistencies(model))
    assert "body_subtreemass is 0.9109, but the model makes it 3.584" in message
    assert "torso: body_invweight0 is 1.101, but the model makes it 0.2793" in message
    mujoco.mj_setConst(model, mujoco.MjData(model))
    assert inconsistencies(model) == ()
    (message,) = inconsistencies(model, asset("ant"))
    assert message.startswith("torso: mass goes from 0.3272 to 3 kg, but its inertia stays 0.00818")
    model.body("torso").inertia[:] *= 2.0
    mujoco.mj_setConst(model, mujoco.MjData(model))
    assert inconsistencies(model, asset("ant")) == ()
    assert inconsistencies(asset("ant"), asset("hopper")) == ()


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (
            lambda m: m.body("wheel").ipos.fill(0.1),
            "wheel: body_sameframe is 1, but the model makes it 3, so body_ipos or body_iquat",
        ),
        (lambda m: m.geom("leg").pos.fill(0.1), "geom_pos or geom_quat is ignored"),
        (lambda m: m.geom("leg").size.fill(0.2), "leg: geom_rbound is 0.1"),
        (lambda m: m.body_gravcomp.fill(1.0), "flg_gravcomp is 0, but the model makes it 1, so"),
        (lambda m: m.geom_adhesion.fill(1.0), "so geom_adhesion and pair_adhesion are ignored"),
        (lambda m: m.geom_surfacevel.fill(1.0), "so geom_surfacevel is ignored"),
        (lambda m: m.actuator_damping.fill(1.0), "so the actuator's damping or armature is igno"),
        (lambda m: m.tendon_length0.fill(9.0), "tendon_length0 is 9"),
    ],
)
def test_writes_without_effect_are_found(
    edit: Callable[[mujoco.MjModel], object], message: str
) -> None:
    model = mujoco.MjModel.from_xml_string(EVERYTHING.replace('gravcomp=".1"', ""))
    edit(model)
    found = " ".join(inconsistencies(model))
    assert message in found
    assert "Call mujoco.mj_setConst after writing to a compiled model." in found


def test_bits_that_were_not_compiled_are_found() -> None:
    model = everything()
    model.geom("wheel").contype[:] = 1
    (message,) = inconsistencies(model)
    assert message.startswith("wheel: geom_contype or geom_conaffinity has bits that its body")
    model = everything()
    model.geom("paint").contype[:] = 1
    (message,) = inconsistencies(model)
    assert message.startswith("MuJoCo cannot derive its constants from the model: ")


@pytest.mark.parametrize(
    ("inertia", "possible"),
    [
        ((0.0, 0.0, 0.0), False),
        ((-1.0, 1.0, 1.0), False),
        ((0.1, 0.1, 0.3), False),
        ((1.0, 1.0, 2.0), True),
    ],
)
def test_impossible_inertias_are_found(inertia: tuple[float, float, float], possible: bool) -> None:
    """Moments must be positive, and the largest at most the sum of the others, as of a thin rod."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body name='b'><joint/><inertial mass='1' pos='0 0 0' "
        "diaginertia='1 1 2'/></body></worldbody></mujoco>"
    )
    model.body("b").inertia[:] = inertia
    found = [each for each in inconsistencies(model) if each.startswith("b: mass 1 kg comes with")]
    assert bool(found) != possible
    assert inconsistencies(mujoco.MjModel.from_xml_string("<mujoco/>")) == ()
