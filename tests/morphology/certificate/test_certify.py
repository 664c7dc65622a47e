"""Certificates of shifts, their rollouts, and models whose numbers do not fit together."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.envs.mujoco.ant_v5 import AntEnv
from gymnasium.wrappers import TransformObservation

import shapechanger  # noqa: F401  # Registers the ids.
from shapechanger.errors import EmptyShift, MorphologyError
from shapechanger.identity import modules_of_env, own_modules
from shapechanger.layout import Feature, Layout
from shapechanger.morphology import Edit, Friction, Mass
from shapechanger.morphology.certificate import (
    certify,
    compare_rollouts,
    fingerprint,
    inconsistencies,
    matched_commands,
)
from tests.morphology.scenes import ASSETS, EVERYTHING, asset, everything
from tests.morphology.swing import Swing, broken, dictionary, late, longer, noisy


class _Labelled(Swing):
    label = "heavy"


def test_a_report_states_all_that_is_certified() -> None:
    source, target = Swing(bonus=1.0), _Labelled(standing_height=0.5)
    del source.standing_height  # An env need not have one.
    source.model.body_invweight0[1], target.model.body_mass[1] = 9.0, 5.0
    certificate = certify(source, target, steps=3, seed=3)
    one, two = (
        "\n".join(
            f"  {name} [{digest}]" for name, digest in own_modules(modules_of_env(env)).items()
        )
        for env in (source, target)
    )
    call = "Call mujoco.mj_setConst after writing to a compiled model."
    soft = f"so constraints have the wrong softness. {call}"
    wrong = f"so lengths and gains derived from it are wrong. {call}"
    assert one != two
    report = f"""\
Swing [{fingerprint(source.model)}] -> heavy [{fingerprint(target.model)}]
heavy behaves differently from Swing.
Changes:
  robot: total mass 1 kg -> 5 kg (x5)
  arm: mass 1 kg -> 5 kg (x5)
Rollout:
  {compare_rollouts(source, target, steps=3, seed=3)}
Does not fit together in Swing:
  arm: body_invweight0 is 9, but the model makes it 0.243, {soft}
Does not fit together in heavy:
  arm: mass goes from 1 to 5 kg, but its inertia stays 0.0232 kg·m²: scale both.
  world: body_subtreemass is 1, but the model makes it 5, so centres of mass are wrong. {call}
  arm: body_invweight0 is 0.243, but the model makes it 0.06205, {soft}
  hinge: dof_M0 is 0.08574, but the model makes it 0.3357, {wrong}
  hinge: dof_invweight0 is 11.66, but the model makes it 2.979, {soft}
Own files of Swing:
{one}
Own files of heavy:
{two}"""
    assert str(certificate) == report


def test_a_longer_arm_is_certified() -> None:
    certificate = certify(Swing(standing_height=0.5), Swing(length=0.8, standing_height=0.8))
    assert (certificate.is_empty, certificate.same_model) == (False, False)
    assert "robot: standing height 0.5 m -> 0.8 m (x1.6)" in str(certificate)


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
    """A model difference without effect in the rollout is a shift, and the verdict states it."""
    target = Swing()
    target.model.jnt_limited[:] = 1
    target.model.jnt_range[:] = (-50.0, 50.0)
    certificate = certify(Swing(), target, steps=3)
    assert certificate.rollout.identical
    assert certificate.verdict.endswith("differ, but 3 steps did not show it.")


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

    The floor's friction of 0.4 masks a foot's friction of 0.2.
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


@pytest.mark.parametrize("wrapped", [lambda env: env, dictionary, broken])
@pytest.mark.parametrize("steps", [0, 20])
def test_equal_environments_have_equal_rollouts(wrapped: Any, steps: int) -> None:
    """One env compared with itself, dictionaries and equal NaN count as equal too."""
    env = wrapped(Swing())
    for target in (wrapped(Swing()), env):
        rollout = compare_rollouts(env, target, steps=steps)
        assert rollout.identical
        assert rollout.differs_by_rounding
        assert str(rollout) == (
            f"{steps} steps from the same seed with the same commands: the 2 numbers that both "
            "observe are equal throughout."
        )


def test_the_first_and_the_largest_difference_are_reported() -> None:
    source, target = Swing(), Swing(length=0.8)
    text = str(compare_rollouts(source, target, steps=25, seed=3))
    commands, _ = matched_commands(source.action_layout, target.action_layout, 25, 3)
    seen = [
        np.stack([env.reset(seed=3)[0], *(env.step(command)[0] for command in commands)])
        for env in (source, target)
    ]
    gap = np.abs(seen[0] - seen[1])
    step, feature = np.unravel_index(np.argmax(gap), gap.shape)
    name = source.observation_layout.names[feature]
    assert "observations part at step 1 in hinge/velocity, and furthest at step" in text
    assert f"at step {step} in {name}, by {gap.max():.4g}. Rewards differ by up to" in text


def test_motors_of_the_same_name_get_the_same_commands() -> None:
    source, target = Swing(), Swing(wrist=True)
    rollout = compare_rollouts(source, target, steps=10)
    assert "Only the target observes 2 more, such as wrist/angle." in str(rollout)
    one, two = np.asarray(source.commands), np.asarray(target.commands)
    assert one.dtype == np.float32
    assert np.all(np.abs(one) <= 1.0)
    assert len(np.unique(one)) == 10
    np.testing.assert_array_equal(one[:, 0], two[:, 0])
    np.testing.assert_array_equal(two[:, 1], 0.0)
    compare_rollouts(source, target, steps=10, seed=1)
    assert not np.array_equal(one, np.asarray(source.commands))


@pytest.mark.parametrize(
    ("source", "target", "steps", "sentence"),
    [
        (Swing, lambda: Swing(limit=7), 7, "equal throughout. Only the target ended its episode."),
        (lambda: Swing(limit=3), lambda: Swing(limit=7), 3, "Only the source ended its episode."),
        (Swing, lambda: Swing(bonus=1.0), 20, "equal throughout. Rewards differ by up to 1 a step"),
        (Swing, lambda: noisy(Swing()), 20, "observations part at the reset in hinge/"),
        # NaN on one side is the largest finite difference.
        (Swing, lambda: broken(Swing()), 20, "in hinge/angle, by 1.798e+308."),
        # The wrapper has no layout, so numbers are compared by index.
        (
            Swing,
            lambda: longer(Swing()),
            20,
            "Only the target observes 1 more, such as observation[2]",
        ),
        (lambda: longer(Swing()), Swing, 20, "Only the source observes 1 more, such as observ"),
        (lambda: longer(Swing()), lambda: longer(Swing(gear=2.0)), 20, "in observation[1], by"),
        (lambda: dictionary(Swing()), lambda: dictionary(Swing(gear=2.0)), 20, "at step 1 in hin"),
    ],
)
def test_each_difference_is_a_sentence(source: Any, target: Any, steps: int, sentence: str) -> None:
    rollout = compare_rollouts(source(), target(), steps=20)
    assert rollout.steps == steps
    assert not rollout.identical
    assert not rollout.differs_by_rounding
    assert sentence in str(rollout)


def test_without_common_features_rollouts_differ() -> None:
    target = Swing()
    target.observation_layout = Layout((Feature("block", "1", shape=(2, 1)),))
    rollout = compare_rollouts(Swing(), target, steps=5)
    assert not rollout.differs_by_rounding
    assert "the 0 numbers that both" in str(rollout)
    assert "Only the target observes 2 more, such as block[0]." in str(rollout)


@pytest.mark.parametrize(
    ("bounds", "expected"),
    [
        ((-2.0, 3.0), (-2.0, 3.0)),
        ((-math.inf, math.inf), (-1.0, 1.0)),
        ((5.0, math.inf), (5.0, 6.0)),
        ((-math.inf, -5.0), (-6.0, -5.0)),
    ],
)
def test_commands_cover_their_range(
    bounds: tuple[float, float], expected: tuple[float, float]
) -> None:
    layout, (low, high) = Layout((Feature("motor", "1", *bounds),)), expected
    commands, _ = matched_commands(layout, layout, 1000, 0)
    assert low <= commands.min() < low + 0.05 * (high - low)
    assert high >= commands.max() > high - 0.05 * (high - low)


def test_commands_are_in_both_ranges() -> None:
    """Commands are in the intersection of both ranges, or each in its own if that is empty."""
    wide, narrow, apart = (
        Layout((Feature("motor", "1", *bounds),))
        for bounds in ((-3.0, 3.0), (0.5, 1.0), (5.0, 6.0))
    )
    one, two = matched_commands(wide, narrow, 50, 0)
    np.testing.assert_array_equal(one, two)
    assert (one.min() >= 0.5, one.max() <= 1.0) == (True, True)
    one, two = matched_commands(narrow, apart, 50, 0)
    assert (one.max() <= 1.0, two.min() >= 5.0) == (True, True)
    _, alone = matched_commands(Layout(()), narrow, 3, 0)
    np.testing.assert_array_equal(alone, np.full((3, 1), 0.5, np.float32))


class _Replay:
    """Env that repeats numbers given, and ends after them."""

    action_layout = Layout(())

    def __init__(self, rows: list[list[float]], *, ends: bool) -> None:
        names = tuple(Feature(f"x{i}", "1") for i in range(len(rows[0])))
        self.observation_layout, self._rows, self._ends = Layout(names), rows, ends

    def reset(self, *, seed: int | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        del seed
        self._left = iter(self._rows)
        return np.array(next(self._left)), {}

    def step(self, _: object, /) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        row = next(self._left)
        return np.array(row), 0.0, self._ends and row is self._rows[-1], False, {}


@pytest.mark.parametrize(
    ("before", "after", "ends", "explained"),
    [
        ([[0.0]] * 2, [[0.0], [1e-8]], False, True),  # At the tolerance.
        ([[0.0]] * 2, [[0.0], [1.5e-8]], False, False),
        ([[0.0]] * 3, [[0.0], [1e-8], [1e-4]], False, True),  # 10,000 times as much in one step.
        ([[0.0]] * 3, [[0.0], [1e-8], [2e-4]], False, False),
        ([[0.0], [0.0], [-1.0]], [[1e-8], [1e-4], [1.0]], False, True),  # No more than all of it.
        ([[100.0]] * 2, [[100.0], [100.0 + 5e-7]], False, True),  # Relative, for large numbers,
        ([[1e6, 0.0]] * 2, [[1e6, 0.0], [1e6, 1.5e-8]], False, False),  # but of its own size.
        ([[math.inf], [0.0]], [[math.inf], [1.5e-8]], False, False),  # Infinity has no size.
        ([[math.nan], [0.0]], [[math.nan], [1.5e-8]], False, False),
        # Another end needs a difference beyond the tolerance before it.
        ([[0.0]] * 3, [[0.0], [0.0], [1e-8]], True, False),
        ([[0.0]] * 3, [[0.0], [1e-9], [1.5e-8]], True, True),
    ],
)
def test_rounding_explains_what_grows_slowly(
    before: list[list[float]], after: list[list[float]], ends: bool, explained: bool
) -> None:
    source, target = _Replay(before, ends=False), _Replay(after, ends=ends)
    rollout = compare_rollouts(source, target, steps=len(before) - 1)
    assert (rollout.identical, rollout.differs_by_rounding) == (False, explained)
    assert compare_rollouts(target, target, steps=len(before) - 1).identical


@pytest.mark.parametrize("after", [0, 1, 50, 100])
def test_a_late_shift_is_no_rounding(after: int) -> None:
    """A late, small difference of a sensor is found, even if the models round differently."""
    heavy = Swing(mass=1.0 + 1e-15)
    assert not certify(heavy, late(Swing(), after, 1e-6)).is_empty
    assert certify(Swing(), late(Swing(), after, 1e-12), allow_empty=True).is_empty


def test_another_end_of_the_episode_is_no_rounding() -> None:
    certificate = certify(Swing(), Swing(limit=30))
    assert certificate.same_model
    assert not certificate.is_empty
    assert certificate.verdict.endswith("are the same; what is sensed, done or rewarded differs.")


@pytest.mark.parametrize("name", ["ant", "hopper", "humanoid", "everything"])
def test_compiled_models_are_consistent(name: str) -> None:
    assert inconsistencies(everything() if name == "everything" else asset(name)) == ()


def test_a_mass_written_into_a_compiled_model_is_found() -> None:
    """Stale constants show the edit; after `mj_setConst`, the unchanged inertia shows it."""
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
        (
            lambda m: m.geom("leg").pos.fill(0.1),
            "leg: geom_sameframe is 1, but the model makes it 3",
        ),
        (lambda m: m.geom("leg").size.fill(0.2), "leg: geom_rbound is 0.1"),
        (
            lambda m: m.body_gravcomp.fill(1.0),
            "flg_gravcomp is 0, but the model makes it 1, so body",
        ),
        (
            lambda m: m.geom_adhesion.fill(1.0),
            "flg_adhesion is 0, but the model makes it 1, so geom",
        ),
        (
            lambda m: m.geom_surfacevel.fill(1.0),
            "flg_surfacevel is 0, but the model makes it 1, so",
        ),
        (lambda m: m.actuator_damping.fill(1.0), "knee: jnt_actuatorid is -1, but the model makes"),
        (lambda m: m.tendon_length0.fill(9.0), "couple: tendon_length0 is 9, but"),
        (
            lambda m: m.dof_M0.fill(9.0),
            "axle: dof_M0 is 9, but the model makes it 0.0005236, so len",
        ),
    ],
)
def test_writes_that_need_set_const_are_found(
    edit: Callable[[mujoco.MjModel], object], message: str
) -> None:
    model = mujoco.MjModel.from_xml_string(EVERYTHING.replace('gravcomp=".1"', ""))
    edit(model)
    assert f"\n{message}" in "\n" + "\n".join(inconsistencies(model))


def test_bits_that_were_not_compiled_are_found() -> None:
    model = everything()
    model.geom("wheel").contype[:] = 1
    (message,) = inconsistencies(model)
    assert message == (
        "wheel: geom_contype or geom_conaffinity has bits that its body was compiled without, so "
        "they are ignored. Compile the model again."
    )
    model = everything()
    model.geom("paint").contype[:] = 1
    (message,) = inconsistencies(model)
    assert message.startswith("MuJoCo cannot derive its constants from the model: ")


_BODY = """<mujoco><worldbody><body name="b"><joint/>
  <inertial mass="{0}" pos="0 0 0" diaginertia="{0} {0} {0}"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("inertia", "moments"),
    [
        ((0.0, 0.0, 0.0), "0, 0, 0"),
        ((1.0, -1.0, 1.0), "-1, 1, 1"),
        ((0.1, 0.3, 0.1), "0.1, 0.1, 0.3"),
        ((1.0, 1.0, 2.0), ""),
        ((0.0, 1.0 - 1e-6, 1.0), ""),  # A thin rod, up to rounding.
    ],
)
def test_impossible_inertias_are_found(inertia: tuple[float, float, float], moments: str) -> None:
    """No moment may be negative, and the largest must not exceed the sum of the others."""
    model = mujoco.MjModel.from_xml_string(_BODY.format(1.0))
    model.body("b").inertia[:] = inertia
    found = [each for each in inconsistencies(model) if "principal" in each]
    assert found == [
        f"b: mass 1 kg comes with principal moments {text} kg·m², which must be positive, and none "
        "of them more than the other two together."
        for text in [moments]
        if text
    ]


def test_bodies_without_mass_or_motion_have_no_inertia_to_check() -> None:
    """A joint may carry only a point mass, and what stands still needs no inertia."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body name='post'><geom size='.1'/></body><body name='hub'><joint/>"
        "<body name='ball' pos='1 0 0'><geom size='.1'/></body></body></worldbody></mujoco>"
    )
    model.body("post").inertia[:], model.body("ball").inertia[:] = -1.0, 0.0
    mujoco.mj_setConst(model, mujoco.MjData(model))
    assert inconsistencies(model) == ()
    assert inconsistencies(mujoco.MjModel.from_xml_string("<mujoco/>")) == ()


@pytest.mark.parametrize("mass", [1e-9, 1e6])
def test_constants_are_stale_from_a_millionth_of_them(mass: float) -> None:
    for share, stale in ((1e-6, False), (2e-6, True)):
        model = mujoco.MjModel.from_xml_string(_BODY.format(mass))
        model.body("b").subtreemass[:] -= share * mass
        assert bool(inconsistencies(model)) == stale
