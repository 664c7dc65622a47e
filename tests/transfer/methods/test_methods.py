"""Methods: loading them by name, and their effects on training."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
import pytest
import torch

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import RobotError, StudyError, UnknownName
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.reach import FingerReachEnv
from shapechanger.layout import Feature, Layout
from shapechanger.policy import load_policy
from shapechanger.registry import METHODS
from shapechanger.transfer.body_map import BodyMap, body_map
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.learners.presets import resolve_learner
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.learners.settings import OffPolicySettings
from shapechanger.transfer.methods import Method, load_method, register, training
from shapechanger.transfer.methods.basic import bodies_between, shuffle
from shapechanger.transfer.methods.training import (
    DomainClassifiers,
    MappedTeacher,
    Transitions,
    _mapped,  # pyright: ignore[reportPrivateUsage]
    collect,
)
from shapechanger.transfer.plan import ARMS, Run, TransferTask
from shapechanger.transfer.report.verdict import arm_rows, caveats
from shapechanger.transfer.runs import load_result, perform_run
from shapechanger.transfer.study import Study, default_arms, inspect_task, run_study
from tests.transfer.studies import BIG, SMALL, TINY, TINY_NORMALISED, tiny_plan
from tests.transfer.test_learners import SHORT


@pytest.fixture
def no_other(monkeypatch: pytest.MonkeyPatch) -> dict[str, type[Method]]:
    """The registered methods; empty at first."""
    found: dict[str, type[Method]] = {}
    monkeypatch.setattr(METHODS, "_registered", found)
    return found


@pytest.mark.parametrize("name", METHODS.names())
def test_shipped_methods_have_their_names(name: str) -> None:
    method = load_method(name)
    assert method.name == name
    assert type(method).__doc__
    assert method.paper or name in ("scratch", "zero-shot", "shuffled-map")


def test_a_name_that_does_not_exist(no_other: dict[str, type[Method]]) -> None:
    """The message suggests the nearest name; a missing module is an UnknownName."""
    with pytest.raises(UnknownName, match="'kickstart'"):
        load_method("kickstarts")
    with pytest.raises(UnknownName, match="no_such_module:patient"):
        load_method("no_such_module:patient")


def test_names_are_taken_once(no_other: dict[str, type[Method]]) -> None:
    def named(name: str) -> type[Method]:
        return type(f"Named{name}", (Method,), {"name": name})

    class First(Method):
        name = "mine"

    assert register(First) is register(First) is First
    for name in ("mine", "random"):
        with pytest.raises(StudyError, match=f"already a method '{name}'"):
            register(named(name))
    with pytest.raises(StudyError, match="must have only letters"):
        register(named("my method"))
    assert isinstance(load_method("mine"), First)
    no_other["broken"] = Path  # type: ignore[assignment]
    with pytest.raises(StudyError, match="not a subclass of Method"):
        load_method("broken")


def test_a_study_can_gain_arms() -> None:
    first = tiny_plan(steps=32)
    grown = tiny_plan(steps=32, arms=(*ARMS, "kickstart"))
    assert grown.extends(first)
    assert not first.extends(grown)
    assert not first.extends(first)


def test_seeds_do_not_depend_on_other_arms() -> None:
    small, large = tiny_plan(), tiny_plan(arms=("scratch", "kickstart", "fine-tune"))
    assert small.seed_of(Run("fine-tune", 1)) == large.seed_of(Run("fine-tune", 1))
    kinds = ("scratch", "fine-tune", "kickstart", "evolution", "a:b")
    assert len({small.seed_of(Run(kind, 0)) for kind in kinds}) == len(kinds)


ANT, EXTENDED = EnvRef("shapechanger/Ant-v1"), EnvRef("shapechanger/ExtendedAnt-v1")
_DEEP = msgspec.structs.replace(TINY_NORMALISED, net_arch=(8, 8))
_LEARNING = ("fine-tune", "frozen-trunk", "kickstart", "evolution")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Path]:
    """A small study of the methods that learn on the target, and its folder."""
    out = tmp_path_factory.mktemp("methods") / "study"
    plan = tiny_plan(_DEEP, arms=("scratch", *_LEARNING), steps=128, source_steps=32)
    return run_study(plan, out, executor=Serial()), out


def _weights(study: tuple[Study, Path], kind: str) -> dict[str, Any]:
    _, out = study
    return dict(load_policy(Run(kind, 0).policy_file(out)).model.policy.state_dict())


def test_curves_have_the_steps_of_scratch_and_fine_tuning_starts_with_the_source(
    study: tuple[Study, Path],
) -> None:
    made, _ = study
    for kind in ("scratch", *_LEARNING):
        assert [e.steps for e in made.of(kind)[0].curve] == [0, 32, 64, 96, 128], kind
    assert set(made.summaries) == set(_LEARNING)
    starts = {kind: made.of(kind)[0].curve[0].mean_return for kind in _LEARNING}
    assert starts["frozen-trunk"] == starts["evolution"] == starts["fine-tune"]


def test_a_frozen_trunk_stays(study: tuple[Study, Path]) -> None:
    """The policy's second layer equals the source's; its others and the value network change."""
    source, frozen = _weights(study, "source"), _weights(study, "frozen-trunk")
    tuned = _weights(study, "fine-tune")
    trunk = "mlp_extractor.policy_net.2.weight"
    assert torch.equal(frozen[trunk], source[trunk])
    assert not torch.equal(tuned[trunk], source[trunk])
    for name in ("mlp_extractor.policy_net.0.weight", "action_net.weight", "log_std"):
        assert not torch.equal(frozen[name], source[name]), name
    assert not torch.equal(
        frozen["mlp_extractor.value_net.2.weight"], source["mlp_extractor.value_net.2.weight"]
    )


def test_a_kickstarted_policy_imitates(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Distillation brings the policy closer to the source policy's actions."""
    settings = msgspec.structs.replace(
        TINY_NORMALISED, learning_rate=1e-2, n_steps=64, eval_every=512
    )
    plan = tiny_plan(settings, arms=("scratch", "kickstart"), steps=512, source_steps=512)
    monkeypatch.setattr(training, "_UNTIL", 1e9)  # The weight does not fall.
    observations = np.random.default_rng(0).normal(0.0, 0.1, (200, 4))
    away: list[float] = []
    for weight in (0.0, 1.0):
        monkeypatch.setattr(training, "_WEIGHT", weight)
        out = tmp_path / f"weight-{weight:g}"
        run_study(plan, out, executor=Serial())

        def acts(kind: str, out: Path = out) -> Any:
            return load_policy(Run(kind, 0).policy_file(out)).act

        shown = MappedTeacher(acts("source"), plan.body_map)(observations)
        away.append(float(np.abs(acts("kickstart")(observations) - shown).mean()))
    assert away[1] < 0.8 * away[0], away


def test_learned_actions_are_not_distilled() -> None:
    crossing = body_map(ANT.make(), EXTENDED.make(), rules={"foot_*/motor": "learn"})
    teacher = MappedTeacher(lambda observations: np.ones((len(observations), 8)), crossing)
    assert teacher.taught.sum() == 8
    shown = teacher(np.zeros((3, crossing.target_observation.size)))
    assert shown.shape == (3, 12)
    assert (shown[:, teacher.taught] == 1.0).all()
    block = Layout([Feature("wheels", "1", -1.0, 1.0, shape=(3,)), Feature("arm", "1", -1.0, 1.0)])
    blocks = BodyMap.between(crossing.source_observation, crossing.source_observation, block, block)
    assert MappedTeacher(lambda observations: observations, blocks).taught.shape == (4,)


def test_intermediate_bodies_grow() -> None:
    """They grow in equal steps, without the two ends, and belong to one family."""
    lengths = []
    for ref in bodies_between(SMALL, BIG, 2):
        made = ref.make()
        pole = made.unwrapped.model.geom("cpole")  # type: ignore[attr-defined]
        lengths.append(2.0 * float(pole.size[1]))
        made.close()
    np.testing.assert_allclose(lengths, [0.6, 0.9], rtol=1e-5)
    with pytest.raises(StudyError, match="must be bodies of one family"):
        bodies_between(ANT, BIG, 1)


def test_a_shuffled_map_has_the_same_rules() -> None:
    """The entries have the same rules in another order, which depends only on the generator."""
    right = body_map(ANT.make(), EXTENDED.make())
    wrong = shuffle(right, np.random.default_rng(0))
    for side in ("observation", "action"):
        ours, theirs = getattr(wrong, side), getattr(right, side)
        assert [entry.feature for entry in ours] == [entry.feature for entry in theirs]
        assert sorted(str(e.rule) for e in ours) == sorted(str(e.rule) for e in theirs)
        moved = sum(a.rule != b.rule for a, b in zip(ours, theirs, strict=True))
        assert moved > len(ours) // 2
    assert shuffle(right, np.random.default_rng(0)) == wrong


def test_a_randomised_source_draws_intermediate_bodies(tmp_path: Path) -> None:
    """The source env, with the argument `towards`, is written to the run's folder."""
    plan = tiny_plan(TINY, steps=64, source_steps=64, arms=("scratch", "randomised"))
    study = run_study(plan, tmp_path, executor=Serial())
    assert study.curves("randomised").n_evals == 1
    noted = json.loads((tmp_path / "runs" / "randomised-0" / "source.json").read_text())
    assert noted["id"] == SMALL.id
    assert noted["kwargs"]["towards"]


def short(**more: Any) -> OffPolicySettings:
    _, settings = resolve_learner("sac", {**SHORT, **more})
    assert isinstance(settings, OffPolicySettings)
    return settings


def test_methods_with_replay_buffers_are_evaluated_at_the_steps_of_scratch(tmp_path: Path) -> None:
    """The learner steps two envs at once."""
    arms = ("scratch", "prefilled-replay", "off-dynamics")
    plan = tiny_plan(short(n_envs=2), steps=64, source_steps=160, arms=arms)
    study = run_study(plan, tmp_path, executor=Serial())
    for arm in arms:
        assert study.curves(arm).steps.tolist() == [0.0, 32.0, 64.0]


def test_corrections_reward_target_like_steps() -> None:
    torch.manual_seed(0)
    classifiers = DomainClassifiers(1, 1, learning_rate=3e-3)

    def batch(goes: float) -> tuple[torch.Tensor, ...]:
        seen, acted = torch.randn(256, 1), torch.randn(256, 1)
        return seen, acted, seen + goes * torch.sign(acted)

    for _ in range(300):
        classifiers.fit(batch(1.0), batch(-1.0))
    of_source = classifiers.correction(*batch(1.0))
    of_target = classifiers.correction(*batch(-1.0))
    assert of_source.mean() < -1.0
    assert of_target.mean() > 1.0
    same = DomainClassifiers(1, 1, learning_rate=3e-3)
    for _ in range(300):
        same.fit(batch(1.0), batch(1.0))
    assert same.correction(*batch(1.0)).abs().mean() < 0.3


def test_transitions_follow_one_another() -> None:
    """Each transition starts where the last one ended, unless the episode ended."""
    policy = Sb3Learner("sac", short()).train(SMALL, 32, 0)
    seen = collect(SMALL, policy, 50, 3)
    assert seen.observations.shape == seen.next_observations.shape == (50, 4)
    goes_on = ~seen.terminated[:-1]
    np.testing.assert_array_equal(
        seen.next_observations[:-1][goes_on], seen.observations[1:][goes_on]
    )
    assert seen.terminated.any()
    again = collect(SMALL, policy, 50, 3)
    np.testing.assert_array_equal(again.actions, seen.actions)


def test_mapped_transitions_have_the_target_layouts() -> None:
    crossing = body_map(ANT.make(), EXTENDED.make())
    seen, sees = crossing.source_observation, crossing.target_observation
    acts, does = crossing.source_action, crossing.target_action
    rng = np.random.default_rng(0)
    ours = Transitions(
        rng.normal(size=(3, seen.size)),
        rng.uniform(-1.0, 1.0, size=(3, acts.size)).astype(np.float32),
        np.zeros(3),
        rng.normal(size=(3, seen.size)),
        np.zeros(3, bool),
    )
    theirs = _mapped(ours, crossing)
    assert theirs.observations.shape == (3, sees.size)
    assert theirs.actions.shape == (3, does.size)
    for name in set(seen.names) & set(sees.names):
        np.testing.assert_array_equal(
            theirs.observations[:, sees.slices[name]], ours.observations[:, seen.slices[name]]
        )


FINGER = EnvRef("shapechanger/Finger-v1", {"max_episode_steps": 50})
REAL_LIKE = FINGER.having({"gap": "real-like"})
_EVERY = (*ARMS, "randomised", "identified")
FOLLOWS = EnvRef("shapechanger/FingerTrack-v1")


@pytest.fixture(scope="module")
def gap(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Path, list[Any]]:
    """A small study of a gap between fingers, its folder, and the target fingers that moved."""
    moved: list[Any] = []

    # Identification itself is tested elsewhere.
    def recorded(env: gym.Env[Any, Any], seconds: float, seed: int, actions: str) -> None:
        moved.append((env.get_wrapper_attr("parameters"), actions, seed))

    found = SimpleNamespace(parameters=NOMINAL.replace(tendon_friction=0.25))

    out = tmp_path_factory.mktemp("gap") / "gap"
    task = TransferTask(FINGER, REAL_LIKE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("shapechanger.finger.identify.record_babble", recorded)
        patch.setattr("shapechanger.finger.identify.identify", lambda log: found)
        plan = tiny_plan(task=task, arms=_EVERY, source_steps=64)
        return run_study(plan, out, executor=Serial()), out, moved


def test_every_arm_of_a_gap_is_evaluated(gap: tuple[Study, Path, list[Any]]) -> None:
    """Policies of adapted sources are evaluated on the target without training."""
    made, _, _ = gap
    assert set(made.summaries) == {"zero-shot", "fine-tune", "randomised", "identified"}
    for kind in ("randomised", "identified"):
        assert [[e.steps for e in result.curve] for result in made.of(kind)] == [[0], [0]]
        assert made.summaries[kind].in_target_steps.jumpstart.value is not None


def test_each_seed_has_another_target(gap: tuple[Study, Path, list[Any]]) -> None:
    made, _, moved = gap
    assert made.plan.individual == "finger_seed"
    fingers = [made.plan.target_of(Run("zero-shot", i)).kwargs["finger_seed"] for i in range(2)]
    assert fingers == [0, 1]
    assert moved[0][0] != moved[1][0]
    for index, (parameters, _, seed) in enumerate(moved):
        one = gym.make(FINGER.id, gap="real-like", finger_seed=index)
        assert parameters == one.get_wrapper_attr("parameters")
        assert seed == made.plan.seed_of(Run("identified", index))
        one.close()


def test_adapted_sources_are_saved(gap: tuple[Study, Path, list[Any]]) -> None:
    made, out, _ = gap
    sources = {
        kind: json.loads((Run(kind, 0).folder(out) / "source.json").read_text())
        for kind in ("randomised", "identified")
    }
    assert sources["randomised"] == {
        "id": FINGER.id,
        "kwargs": {"max_episode_steps": 50, "gap": "wide", "reward": {"change": 5.0}},
    }
    assert sources["identified"]["kwargs"]["parameters"]["tendon_friction"] == 0.25
    assert all(Run(kind, 1).policy_file(out).exists() for kind in sources)
    assert made.plan.task.source == FINGER


def test_success_is_reported(gap: tuple[Study, Path, list[Any]]) -> None:
    """Every arm reports success, and so does the source policy in the source."""
    made, _, _ = gap
    successes = {row.kind: row.success for row in arm_rows(made)}
    assert set(successes) == {"source", "random", "zero-action", *_EVERY}
    assert successes["randomised"].startswith("0 % [0 %, 0 %]")
    assert made.plan.measure == "success"
    assert any("whose finger_seed is the index of the seed" in text for text in caveats(made))


def test_a_failed_evaluation_costs_no_training(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The policy is saved before it is evaluated, and the repeated run evaluates it."""
    plan = tiny_plan(
        task=TransferTask(FINGER, REAL_LIKE), arms=("scratch", "randomised"), source_steps=64
    )
    run = Run("randomised", 0)
    trained: list[Any] = []
    evaluate, train = Sb3Learner.evaluate, Sb3Learner.train

    def fails(*_: Any) -> Any:
        raise RobotError("The rig has stopped.")

    def counted(self: Sb3Learner, *arguments: Any, **more: Any) -> Any:
        trained.append(arguments[0])
        return train(self, *arguments, **more)

    monkeypatch.setattr(Sb3Learner, "train", counted)
    monkeypatch.setattr(Sb3Learner, "evaluate", fails)
    with pytest.raises(RobotError, match="has stopped"):
        perform_run(plan, run, str(tmp_path), None, lambda _: None)
    saved = run.policy_file(tmp_path).read_bytes()
    assert load_result(plan, tmp_path, run) is None
    monkeypatch.setattr(Sb3Learner, "evaluate", evaluate)
    perform_run(plan, run, str(tmp_path), None, lambda _: None)
    assert len(trained) == 1
    assert run.policy_file(tmp_path).read_bytes() == saved
    result = load_result(plan, tmp_path, run)
    assert result is not None
    assert [evaluation.steps for evaluation in result.curve] == [0]


def test_default_arms() -> None:
    """The arms that adapt the source need a target that supports them and has equal layouts."""
    assert default_arms(inspect_task(TransferTask(FINGER, REAL_LIKE))) == _EVERY
    assert default_arms(inspect_task(TransferTask(FINGER, FOLLOWS))) == ARMS
    assert default_arms(inspect_task(TransferTask(SMALL, BIG))) == ARMS


def test_a_plan_is_exclusive_if_its_target_is(monkeypatch: pytest.MonkeyPatch) -> None:
    task = TransferTask(FINGER, REAL_LIKE)
    assert not tiny_plan(task=task).exclusive
    monkeypatch.setattr(FingerReachEnv, "exclusive", True, raising=False)
    assert tiny_plan(task=task).exclusive


@pytest.mark.parametrize(
    ("arm", "task", "settings", "message"),
    [
        ("evolution", TransferTask(FINGER, REAL_LIKE), TINY, "needs two bodies of one family"),
        ("randomised", TransferTask(ANT, EXTENDED), TINY, "one family with the same spaces"),
        ("off-dynamics", TransferTask(ANT, EXTENDED), short(), "the same spaces"),
        ("off-dynamics", TransferTask(SMALL, BIG), short(normalise=True), "normalise=false"),
        ("frozen-trunk", TransferTask(SMALL, BIG), TINY, "at least 2 hidden layers"),
        ("identified", TransferTask(SMALL, BIG), TINY, "needs a target that can adapt"),
    ],
)
def test_unsuitable_arms_are_refused(
    arm: str, task: TransferTask, settings: Any, message: str
) -> None:
    with pytest.raises(StudyError, match=message):
        tiny_plan(settings, task=task, arms=("scratch", arm))
