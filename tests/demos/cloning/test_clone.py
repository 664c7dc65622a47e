"""Cloning: learning, continuing, reproducibility and invalid input."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
import torch

from shapechanger.demos.cloning.examples import held_out
from shapechanger.demos.cloning.learn import MemberCheck, Training, clone
from shapechanger.demos.cloning.pictures import CloningError
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.settings import CloneSettings
from tests.demos.cloning.small import SMALL, demonstrations, error

_QUICK = msgspec.structs.replace(SMALL, fewest_steps=4, most_steps=4, checks=2, warm_up=1)


@pytest.fixture(scope="module")
def learned() -> tuple[CameraPolicy, Training]:
    """A policy trained on 600 images."""
    source = demonstrations(600, 1)
    return clone(source.pictures, source.actions, settings=SMALL, seed=0)


def test_it_learns_to_drive(learned: tuple[CameraPolicy, Training]) -> None:
    """On new corridors, the error is far below that of the median action."""
    test = demonstrations(200, 2)
    steering, throttle = np.abs(learned[0].predict_many(test.pictures) - test.actions).mean(axis=0)
    guess = np.abs(test.actions - np.median(test.actions, axis=0)).mean(axis=0)
    assert steering < 0.35 * guess[0]
    assert throttle < 0.6 * guess[1]


def test_the_training_log_matches_the_policy(learned: tuple[CameraPolicy, Training]) -> None:
    policy, training = learned
    assert training.learned == 540
    assert [check.step for check in training.checks] == [0, 30, 60, 90, 120, 150]
    best = min(training.checks, key=lambda check: check.error)
    assert training.best_steps == (best.step,)
    exam = demonstrations(600, 1)
    done = policy.predict_many(exam.pictures[540:])
    errors = np.abs(done - exam.actions[540:]).mean(axis=0)
    np.testing.assert_allclose(errors.sum(), best.error, rtol=1e-5)


def test_a_start_policy_helps_with_few_images(
    learned: tuple[CameraPolicy, Training],
) -> None:
    few = demonstrations(30, 3, gain=0.5)
    test = demonstrations(200, 4, gain=0.5)
    settings = msgspec.structs.replace(SMALL, fewest_steps=80, most_steps=80)
    scratch, _ = clone(few.pictures, few.actions, settings=settings, seed=0)
    further, _ = clone(few.pictures, few.actions, settings=settings, seed=0, start=learned[0])
    assert error(further, test) < 0.8 * error(scratch, test)
    assert error(further, test) < 0.8 * error(learned[0], test)


def test_rehearsal_prevents_forgetting(learned: tuple[CameraPolicy, Training]) -> None:
    """The target steers the opposite way, and rehearsal keeps the source skill."""
    source, target = demonstrations(100, 1), demonstrations(60, 3, gain=-1.0)
    old = demonstrations(200, 2)
    settings = msgspec.structs.replace(SMALL, rehearsal=0.5, fewest_steps=40, most_steps=40)
    forgets, keeps = (
        clone(
            target.pictures,
            target.actions,
            settings=settings,
            seed=0,
            start=learned[0],
            rehearsal=rehearsal,
        )[0]
        for rehearsal in (None, (source.pictures, source.actions))
    )
    assert error(keeps, old) < 0.9 * error(forgets, old)


def test_the_start_policy_is_not_changed(learned: tuple[CameraPolicy, Training]) -> None:
    policy, few = learned[0], demonstrations(20, 3)
    before = policy.predict_many(few.pictures)
    # Without held-out images, the last policy is kept.
    settings = msgspec.structs.replace(_QUICK, held_out=0.0)
    further, _ = clone(few.pictures, few.actions, settings=settings, seed=7, start=policy)
    np.testing.assert_array_equal(policy.predict_many(few.pictures), before)
    assert not np.array_equal(further.predict_many(few.pictures), before)
    assert (policy.card.seeds, further.card.seeds) == ((0,), (0, 7))


def test_a_start_policy_sets_the_architecture(learned: tuple[CameraPolicy, Training]) -> None:
    few = demonstrations(20, 3)
    other = msgspec.structs.replace(_QUICK, channels=(4, 4))
    further, _ = clone(few.pictures, few.actions, settings=other, seed=0, start=learned[0])
    assert further.card.channels == SMALL.channels


def test_the_same_seed_gives_the_same_policy() -> None:
    few = demonstrations(40, 5)

    def actions(seed: int) -> np.ndarray:
        policy, _ = clone(few.pictures, few.actions, settings=_QUICK, seed=seed)
        return policy.predict_many(few.pictures)

    first = actions(3)
    state = torch.random.get_rng_state()
    second = actions(3)
    assert torch.equal(torch.random.get_rng_state(), state)
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first, actions(4))


def test_one_image_is_enough() -> None:
    one = demonstrations(1, 0)
    policy, training = clone(one.pictures, one.actions, settings=_QUICK, seed=0)
    assert (training.best_steps, training.learned) == ((4,), 1)
    assert all(math.isnan(check.error) for check in training.checks)
    assert np.isfinite(policy.predict(one.pictures[0])).all()


def test_training_stops_early() -> None:
    """With random actions the held-out error does not fall, so training stops after `patience`."""
    noise = demonstrations(40, 6)
    actions = np.random.default_rng(0).uniform(-1, 1, (40, 2)).astype(np.float32)
    settings = msgspec.structs.replace(
        SMALL, fewest_steps=60, most_steps=60, checks=30, patience=3, held_out=0.5
    )
    checks: list[MemberCheck] = []
    _, training = clone(noise.pictures, actions, settings=settings, seed=0, on_check=checks.append)
    assert checks[-1].step < 60
    assert training.best_steps == (checks[-1].step - 6,)
    assert repr(tuple(checks)) == repr(training.checks)  # NaN is not equal to itself.


def test_read_only_arrays_are_accepted() -> None:
    few = demonstrations(12, 0)
    expected, _ = clone(few.pictures, few.actions, settings=_QUICK, seed=0)
    for array in (few.pictures, few.actions):
        array.flags.writeable = False
    policy, _ = clone(few.pictures, few.actions, settings=_QUICK, seed=0)
    np.testing.assert_array_equal(
        policy.predict_many(few.pictures), expected.predict_many(few.pictures)
    )


def test_the_end_of_each_episode_is_held_out() -> None:
    mask = held_out(35, [20, 5, 10], 0.1)
    assert np.flatnonzero(mask).tolist() == [18, 19, 34]
    assert np.flatnonzero(held_out(20, [], 0.1)).tolist() == [18, 19]


def test_the_number_of_steps_follows_the_images() -> None:
    settings = CloneSettings(batch=10, passes=2.0, fewest_steps=50, most_steps=100)
    assert [settings.steps(n) for n in (1, 400, 9000)] == [50, 80, 100]


_GOOD = demonstrations(4, 0)


@pytest.mark.parametrize(
    ("pictures", "actions", "words"),
    [
        (_GOOD.pictures[:0], _GOOD.actions[:0], "There is no image to learn from."),
        (_GOOD.pictures, _GOOD.actions[:3], "4 images and 3 actions"),
        (_GOOD.pictures, _GOOD.actions[:, :1], r"shape \(4, 1\)"),
        (_GOOD.pictures[..., 0], _GOOD.actions, "Images must be uint8"),
        (_GOOD.pictures, np.full((4, 2), np.nan), r"action 0 is \[nan, nan\]"),
        (_GOOD.pictures, np.array([[0, 0], [0, 1], [0, 1.5], [3, 0]]), r"action 2 is \[0.0, 1.5\]"),
    ],
)
def test_invalid_demonstrations_are_refused(
    pictures: np.ndarray, actions: np.ndarray, words: str
) -> None:
    with pytest.raises(CloningError, match=words):
        clone(pictures, actions, settings=_QUICK, seed=0)


def test_episode_lengths_must_add_up() -> None:
    with pytest.raises(CloningError, match="5 images in total, but there are 4 images"):
        clone(_GOOD.pictures, _GOOD.actions, settings=_QUICK, seed=0, episodes=[2, 3])


@pytest.mark.parametrize(
    "wrong",
    [
        {"channels": ()},
        {"batch": 0},
        {"most_steps": 10},
        {"learning_rate": 0.0},
        {"held_out": 1.0},
        {"weight_decay": -1.0},
    ],
)
def test_settings_that_contradict_themselves_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(CloningError):
        CloneSettings(**wrong)  # pyright: ignore[reportArgumentType]
