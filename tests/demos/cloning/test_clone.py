"""Cloning: it learns, it goes on learning, it repeats itself, and it says what it cannot use."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
import torch

from shapechanger.demos.cloning.demonstrations import held_out
from shapechanger.demos.cloning.learn import MemberCheck, Training, clone
from shapechanger.demos.cloning.pictures import CloningError
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.settings import CloneSettings
from tests.demos.cloning.small import SMALL, error, shown

_QUICK = msgspec.structs.replace(SMALL, fewest_steps=4, most_steps=4, checks=2, warm_up=1)


@pytest.fixture(scope="module")
def learned() -> tuple[CameraPolicy, Training]:
    """A policy that has seen 600 pictures."""
    source = shown(600, 1)
    return clone(source.pictures, source.actions, settings=SMALL, seed=0)


def test_it_learns_to_drive(learned: tuple[CameraPolicy, Training]) -> None:
    """Far better than always doing what the driver mostly did, in corridors that it never saw."""
    test = shown(200, 2)
    steering, throttle = np.abs(learned[0].predict_many(test.pictures) - test.actions).mean(axis=0)
    guess = np.abs(test.actions - np.median(test.actions, axis=0)).mean(axis=0)
    assert steering < 0.35 * guess[0]
    assert throttle < 0.6 * guess[1]


def test_the_course_is_of_this_training(learned: tuple[CameraPolicy, Training]) -> None:
    """It counts what was learned from, and keeps the best check."""
    policy, training = learned
    assert training.learned == 540
    assert [check.step for check in training.checks] == [0, 30, 60, 90, 120, 150]
    best = min(training.checks, key=lambda check: check.error)
    assert training.best_steps == (best.step,)
    exam = shown(600, 1)
    done = policy.predict_many(exam.pictures[540:])
    errors = np.abs(done - exam.actions[540:]).mean(axis=0)
    np.testing.assert_allclose(errors.sum(), best.error, rtol=1e-5)


def test_few_pictures_of_another_vehicle_go_further_with_a_start(
    learned: tuple[CameraPolicy, Training],
) -> None:
    """The other vehicle steers half as much; what a corridor looks like is known already."""
    few = shown(30, 3, gain=0.5)
    test = shown(200, 4, gain=0.5)
    settings = msgspec.structs.replace(SMALL, fewest_steps=80, most_steps=80)
    scratch, _ = clone(few.pictures, few.actions, settings=settings, seed=0)
    further, _ = clone(few.pictures, few.actions, settings=settings, seed=0, start=learned[0])
    assert error(further, test) < 0.8 * error(scratch, test)
    assert error(further, test) < 0.8 * error(learned[0], test)


def test_what_is_rehearsed_is_not_forgotten(learned: tuple[CameraPolicy, Training]) -> None:
    """The target steers the other way: without rehearsal that is all that is left."""
    source, target = shown(100, 1), shown(60, 3, gain=-1.0)
    old = shown(200, 2)
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


def test_the_start_stays_as_it_is(learned: tuple[CameraPolicy, Training]) -> None:
    """Several targets may go on from one source."""
    policy, few = learned[0], shown(20, 3)
    before = policy.predict_many(few.pictures)
    # With nothing held out the last policy is kept, better or not.
    settings = msgspec.structs.replace(_QUICK, held_out=0.0)
    further, _ = clone(few.pictures, few.actions, settings=settings, seed=7, start=policy)
    np.testing.assert_array_equal(policy.predict_many(few.pictures), before)
    assert not np.array_equal(further.predict_many(few.pictures), before)
    assert (policy.card.seeds, further.card.seeds) == ((0,), (0, 7))


def test_a_start_brings_its_own_shape(learned: tuple[CameraPolicy, Training]) -> None:
    """Its weights fit no other."""
    few = shown(20, 3)
    other = msgspec.structs.replace(_QUICK, channels=(4, 4))
    further, _ = clone(few.pictures, few.actions, settings=other, seed=0, start=learned[0])
    assert further.card.channels == SMALL.channels


def test_the_same_seed_gives_the_same_policy() -> None:
    """Whatever has drawn from the global generator before; and another seed gives another."""
    few = shown(40, 5)

    def actions(seed: int) -> np.ndarray:
        policy, _ = clone(few.pictures, few.actions, settings=_QUICK, seed=seed)
        return policy.predict_many(few.pictures)

    first = actions(3)
    state = torch.random.get_rng_state()
    second = actions(3)
    assert torch.equal(torch.random.get_rng_state(), state)  # It leaves no trace there, either.
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first, actions(4))


def test_one_picture_is_enough_to_begin() -> None:
    """Nothing is held out then, and the last policy is kept."""
    one = shown(1, 0)
    policy, training = clone(one.pictures, one.actions, settings=_QUICK, seed=0)
    assert (training.best_steps, training.learned) == ((4,), 1)
    assert all(math.isnan(check.error) for check in training.checks)
    assert np.isfinite(policy.predict(one.pictures[0])).all()


def test_it_stops_when_it_gets_no_better() -> None:
    """Actions that no picture tells are learned by heart, and the held-out pictures notice."""
    noise = shown(40, 6)
    actions = np.random.default_rng(0).uniform(-1, 1, (40, 2)).astype(np.float32)
    settings = msgspec.structs.replace(
        SMALL, fewest_steps=60, most_steps=60, checks=30, patience=3, held_out=0.5
    )
    checks: list[MemberCheck] = []
    _, training = clone(noise.pictures, actions, settings=settings, seed=0, on_check=checks.append)
    assert checks[-1].step < 60
    assert training.best_steps == (checks[-1].step - 6,)
    assert repr(tuple(checks)) == repr(training.checks)  # NaN is not equal to itself.


def test_pictures_as_recorded_are_prepared() -> None:
    """Large or small, the policy is the same."""
    rng = np.random.default_rng(0)
    large = rng.integers(0, 256, (12, 60, 80, 3), np.uint8)
    actions = rng.uniform(-1, 1, (12, 2))
    settings = msgspec.structs.replace(_QUICK, checks=1)
    policy, _ = clone(large, actions, settings=settings, seed=0)
    assert policy.predict(large[0]).shape == (2,)


def test_arrays_that_may_not_be_written_to_will_do() -> None:
    """Parts of a file that is mapped into memory are such."""
    few = shown(12, 0)
    for array in (few.pictures, few.actions):
        array.flags.writeable = False
    clone(few.pictures, few.actions, settings=_QUICK, seed=0)


def test_the_end_of_each_episode_is_held_out() -> None:
    """And nothing of one that is too short."""
    mask = held_out(35, [20, 5, 10], 0.1)
    assert np.flatnonzero(mask).tolist() == [18, 19, 34]
    assert np.flatnonzero(held_out(20, [], 0.1)).tolist() == [18, 19]


def test_steps_follow_the_pictures() -> None:
    """Within their bounds."""
    settings = CloneSettings(batch=10, passes=2.0, fewest_steps=50, most_steps=100)
    assert [settings.steps(n) for n in (1, 400, 9000)] == [50, 80, 100]


_GOOD = shown(4, 0)


@pytest.mark.parametrize(
    ("pictures", "actions", "words"),
    [
        (_GOOD.pictures[:0], _GOOD.actions[:0], "There is no picture to learn from."),
        (_GOOD.pictures, _GOOD.actions[:3], "4 pictures and 3 actions"),
        (_GOOD.pictures, _GOOD.actions[:, :1], r"shape \(4, 1\)"),
        (_GOOD.pictures[..., 0], _GOOD.actions, "Pictures must be uint8"),
        (_GOOD.pictures, np.full((4, 2), np.nan), r"action 0 is \[nan, nan\]"),
        (_GOOD.pictures, np.array([[0, 0], [0, 1], [0, 1.5], [3, 0]]), r"action 2 is \[0.0, 1.5\]"),
    ],
)
def test_what_cannot_be_learned_from_is_refused(
    pictures: np.ndarray, actions: np.ndarray, words: str
) -> None:
    """The message says what is wrong, and where."""
    with pytest.raises(CloningError, match=words):
        clone(pictures, actions, settings=_QUICK, seed=0)


def test_episodes_add_up() -> None:
    """A wrong length would hold out the wrong pictures."""
    with pytest.raises(CloningError, match="5 pictures in total, but there are 4 pictures"):
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
    """Before anything is learned."""
    with pytest.raises(CloningError):
        CloneSettings(**wrong)  # pyright: ignore[reportArgumentType]
