"""Certificates of shifts, and refused shifts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.mujoco.ant_v5 import AntEnv
from gymnasium.wrappers import TransformObservation

import shapechanger  # noqa: F401  # Registers the ids.
from shapechanger.errors import EmptyShift, MorphologyError
from shapechanger.layout import Feature, Layout
from shapechanger.morphology import Edit, Friction, Mass
from shapechanger.morphology.certificate import certify
from tests.morphology.scenes import ASSETS
from tests.morphology.swing import Swing


def test_a_longer_arm_is_certified() -> None:
    certificate = certify(Swing(standing_height=0.5), Swing(length=0.8, standing_height=0.8))
    assert not certificate.is_empty
    assert not certificate.same_model
    text = str(certificate)
    assert "arm: length 0.5 m -> 0.8 m (x1.6)" in text
    assert "robot: standing height 0.5 m -> 0.8 m (x1.6)" in text
    assert "Rollout:\n  100 steps from the same seed" in text
    assert certificate.source_fingerprint in text
    assert certificate.verdict == "Swing behaves differently from Swing."


def test_an_empty_shift_is_refused_unless_it_is_allowed() -> None:
    with pytest.raises(EmptyShift, match="behave the same: their models and 100 steps are equal"):
        certify(Swing(), Swing())
    certificate = certify(Swing(), Swing(), steps=5, allow_empty=True)
    assert certificate.is_empty
    assert certificate.changes == ()
    assert "Changes" not in str(certificate)


def test_an_env_without_a_model_is_refused() -> None:
    with pytest.raises(MorphologyError, match="CartPole-v1 has no model to compare"):
        certify(gymnasium.make("CartPole-v1"), Swing())


def test_a_difference_beyond_the_rollout_is_stated() -> None:
    """A model difference without effect in the rollout is a shift, and the verdict says so."""
    target = Swing()
    target.model.jnt_limited[:] = 1
    target.model.jnt_range[:] = (-50.0, 50.0)
    certificate = certify(Swing(), target, steps=3)
    assert certificate.rollout.identical
    assert certificate.verdict.endswith("differ, but 3 steps did not show it.")


def test_inconsistent_models_are_reported() -> None:
    target = Swing()
    target.model.body_mass[1] = 5.0
    certificate = certify(Swing(), target, steps=5, labels=("light", "heavy"))
    assert certificate.source_inconsistencies == ()
    sentences = " ".join(certificate.target_inconsistencies)
    assert "body_subtreemass" in sentences
    assert "its inertia stays" in sentences
    assert "Does not fit together in heavy:" in str(certificate)


class _Ant(AntEnv):
    """Gymnasium's ant with layouts."""

    standing_height = 0.532

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        self.observation_layout = Layout(tuple(Feature(f"o{i}", "1") for i in range(105)))
        self.action_layout = Layout(tuple(Feature(f"a{i}", "1", -1.0, 1.0) for i in range(8)))


def test_gymnasium_environments_and_wrappers_are_certified(tmp_path: Path) -> None:
    """An ant with masked friction is no shift; a wrapper that changes observations is one."""
    # Edited as text, because writing a spec to a file rounds its numbers.
    text = Path(ASSETS, "ant.xml").read_text(encoding="utf-8")
    edited = text.replace('_ankle_geom" size', '_ankle_geom" friction="0.1 0.5 0.5" size')
    assert edited != text
    (tmp_path / "slippery.xml").write_text(edited, encoding="utf-8")
    with _Ant() as source, _Ant(xml_file=str(tmp_path / "slippery.xml")) as slippery:
        with pytest.raises(EmptyShift):
            certify(source, slippery, steps=10)
        wrapped = TransformObservation(source, lambda seen: seen + 1.0, source.observation_space)
        shifted = certify(source, wrapped, steps=3)
        assert shifted.same_model
        assert ", by 1. " in str(shifted.rollout) or str(shifted.rollout).endswith(", by 1.")
        assert shifted.source == "_Ant"


@pytest.mark.parametrize(
    "edit",
    [Mass("torso", scale=1.0), Friction("ffoot", to=0.2)],
    ids=["mass-x1", "masked-friction"],
)
def test_an_edit_that_changes_only_the_rounding_is_empty(edit: Edit) -> None:
    """Resolving HalfCheetah's total mass changes masses by 4e-16 kg, which is no shift.

    The friction of a foot at 0.2 is masked by that of the floor, 0.4.
    """
    source = gymnasium.make("shapechanger/HalfCheetah-v1")
    target = gymnasium.make("shapechanger/HalfCheetah-v1", body=edit)
    assert not np.array_equal(source.unwrapped.model.body_mass, target.unwrapped.model.body_mass)
    for seed in range(3):  # Seed 1 amplifies the rounding to 0.2 within 100 steps.
        with pytest.raises(EmptyShift, match="differ by rounding"):
            certify(source, target, seed=seed)
    certificate = certify(source, target, allow_empty=True)
    assert certificate.same_model
    assert certificate.changes == ()


def test_a_small_change_is_a_shift() -> None:
    target = gymnasium.make("shapechanger/HalfCheetah-v1", body=Mass("torso", scale=1.000001))
    certificate = certify(gymnasium.make("shapechanger/HalfCheetah-v1"), target)
    assert "mass" in {change.quantity for change in certificate.changes}
