"""Policies trained on a device act as on the CPU, and have files of the same format."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
import pytest
import torch

import shapechanger
from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import StudyError
from shapechanger.morphology import JointRange, to_json
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.export import export_limbs
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.rsl import RslLearner, RslVecEnv
from shapechanger.transfer.learners.settings import RslLimbSettings, RslPpoSettings
from shapechanger.transfer.limbs.device import DeviceRows, LimbModel, RslLimbLearner
from shapechanger.transfer.limbs.envs import fitted, rows_of_each
from shapechanger.transfer.limbs.policy import LimbPolicy
from shapechanger.transfer.runs import learner_of

PENDULUM = EnvRef("shapechanger/InvertedPendulum-v1")
SETTINGS = RslPpoSettings(
    n_envs=8,
    n_steps=64,
    batch_size=128,
    n_epochs=10,
    learning_rate=2e-3,
    normalise=True,
    steps=2048,
    eval_every=2048,
    device="cpu",
)


def worlds(**arguments: Any) -> Any:
    return shapechanger.make_vec("InvertedPendulum", 4, backend="warp", device="cpu", **arguments)


def test_a_short_training_raises_the_return(tmp_path: Path) -> None:
    """The return more than doubles, and the loaded policy acts as the trained one."""
    found: list[Evaluation] = []
    counted: list[int] = []
    learner = learner_of("rsl-ppo", SETTINGS)
    policy = learner.train(PENDULUM, 2048, 0, on_evaluation=found.append, on_steps=counted.append)
    assert [evaluation.steps for evaluation in found] == [0, 2048]
    assert counted == list(range(8, 2049, 8))
    assert found[-1].mean_return > 2.0 * found[0].mean_return
    assert policy.card.steps == 2048
    assert policy.card.settings == SETTINGS
    path = tmp_path / "pendulum.safetensors"
    save_policy(policy, path)
    again = load_policy(path)
    assert again.card == policy.card
    seen = np.random.default_rng(0).normal(size=(5, 4))
    np.testing.assert_array_equal(again.act(seen), policy.act(seen))
    assert learner.origin(path).steps == 2048


def test_a_policy_of_any_number_of_worlds_is_loaded(tmp_path: Path) -> None:
    """Policies of a device may have more worlds than other policies may have envs."""
    few = msgspec.structs.replace(SETTINGS, n_steps=2, batch_size=16, eval_every=16)
    trained = RslLearner("rsl-ppo", few).train(PENDULUM, 16, 0)
    many = msgspec.structs.replace(SETTINGS, n_envs=8192, eval_every=2**20)
    trained.carded(settings=many).save(tmp_path / "many.safetensors")
    loaded = load_policy(tmp_path / "many.safetensors")
    assert loaded.card.settings.n_envs == 8192
    seen = np.zeros((1, 4))
    np.testing.assert_array_equal(loaded.act(seen), trained.act(seen))


def test_worlds_have_the_interface_of_rsl_rl() -> None:
    envs = RslVecEnv(worlds(max_episode_steps=2), seed=0)
    assert (envs.num_envs, envs.num_actions, envs.max_episode_length) == (4, 1, 2)
    assert envs.get_observations()["policy"].shape == (4, 4)
    actions = torch.zeros(4, 1)
    assert not envs.step(actions)[2].any()
    assert envs.episode_length_buf.tolist() == [1] * 4
    observations, rewards, ends, extras = envs.step(actions)
    assert ends.all()
    assert extras["time_outs"].all()
    assert rewards.tolist() == [1.0] * 4
    assert observations["policy"].abs().max() <= 0.01
    envs.episode_length_buf = torch.tensor([1, 0, 0, 0])
    assert envs.step(actions)[2].tolist() == [True, False, False, False]


def test_callbacks_and_small_budgets_are_refused() -> None:
    learner = RslLearner("rsl-ppo", SETTINGS)
    with pytest.raises(StudyError, match="cannot use callbacks"):
        learner.train(PENDULUM, 2048, 0, callback=object())
    with pytest.raises(StudyError, match="is too small"):
        learner.train(PENDULUM, 512, 0)


ANT: Final = EnvRef("shapechanger/Ant-v1", {"max_episode_steps": 20})
EXTENDED: Final = EnvRef("shapechanger/ExtendedAnt-v1", {"max_episode_steps": 20})
# Bodies of 12 and of 8 limbs, whose observations have 137 and 105 numbers.
BOTH: Final = ANT.having({"bodies": ["ExtendedAnt", "Ant"]})
TINY: Final = RslLimbSettings(
    n_envs=3,
    n_steps=16,
    batch_size=24,
    n_epochs=2,
    learning_rate=1e-3,
    normalise=True,
    steps=48,
    source_steps=48,
    eval_every=48,
    eval_episodes=2,
    device="cpu",
)
# A policy of limbs needs no map.
_NO_MAP: Any = object()


def _learner(**changed: Any) -> RslLimbLearner:
    return RslLimbLearner("rsl-limbs", msgspec.structs.replace(TINY, **changed))


def _worlds(bodies: list[str]) -> RslVecEnv:
    envs = shapechanger.make_vec(
        "Ant", len(bodies), backend="warp", device="cpu", bodies=bodies, max_episode_steps=20
    )
    rows = rows_of_each([ANT.having({"body": body}) for body in bodies])
    return RslVecEnv(envs, 0, DeviceRows(envs, rows))


@pytest.fixture(scope="module")
def policy() -> TrainedPolicy:
    return _learner().train(BOTH, 48, 0)


def _net(policy: TrainedPolicy) -> LimbPolicy:
    net = policy.model.policy
    assert isinstance(net, LimbPolicy)
    return net


def test_networks_of_rsl_rl_equal_the_policy(policy: TrainedPolicy) -> None:
    """In bodies of 12 and of 8 limbs, rsl-rl's networks act as the policy does on the CPU."""
    worlds = _worlds(["ExtendedAnt", "Ant", "ExtendedAnt"])
    net = _net(policy)
    actor = LimbModel(net, net.actor_net, acts=True)
    critic = LimbModel(net, net.critic_net, acts=False)
    seen = worlds.get_observations()
    with torch.no_grad():
        actions = actor(seen)
        values = critic(seen)
    moved = worlds._rows.actions(actions.clamp(-1.0, 1.0))
    own = [part.numpy() for part in worlds.envs.reset(seed=0)[0]]
    for body, batch, place, world in (("ExtendedAnt", 0, 0, 0), ("Ant", 1, 0, 1)):
        env = fitted(ANT.having({"body": body}).make(), policy.card.observation)
        rows = env.rows.of(own[batch][place])
        expected = env.rows.actions(policy.act(rows[None])[0])
        np.testing.assert_allclose(moved[batch][place], expected, atol=1e-5)
        size = rows.size
        np.testing.assert_allclose(seen["policy"][world, :size], rows, atol=1e-5)
        assert not seen["policy"][world, size:].any()
        value = net.predict_values(torch.as_tensor(rows[None]))
        np.testing.assert_allclose(values[world].item(), value.item(), atol=1e-5)
    assert values.shape == (3, 1)


def test_probabilities_equal_the_policys(policy: TrainedPolicy) -> None:
    """Limbs that a body lacks, and limbs without a motor, have no effect on probabilities."""
    worlds = _worlds(["ExtendedAnt", "Ant", "ExtendedAntPassive"])
    net = _net(policy)
    actor = LimbModel(net, net.actor_net, acts=True)
    with torch.no_grad():
        actor.distribution.log_std_param.copy_(net.log_std)
        seen = worlds.get_observations()
        actions = actor(seen, stochastic_output=True)
        found = actor.get_output_log_prob(actions)
        _, expected, entropy = net.evaluate_actions(seen["policy"], actions)
    torch.testing.assert_close(found, expected)
    torch.testing.assert_close(actor.output_entropy, entropy)
    assert entropy[1].item() == pytest.approx(entropy[2].item())
    assert entropy[0].item() == pytest.approx(1.5 * entropy[1].item())


def test_batches_of_worlds_with_equal_spaces_share_a_tensor() -> None:
    """Rows and actions of all batches are in one tensor, like the vector env's."""
    bodies = ["Swimmer", to_json([JointRange("free_body_rot", -2.0, 2.0)])]
    swimmer = EnvRef("shapechanger/Swimmer-v1")
    envs = shapechanger.make_vec("Swimmer", 2, backend="warp", device="cpu", bodies=bodies)
    assert len(envs.batches) == 2
    rows = rows_of_each([swimmer.having({"body": body}) for body in bodies])
    worlds = RslVecEnv(envs, 0, DeviceRows(envs, rows))
    own = envs.reset(seed=0)[0].numpy()
    for i, one in enumerate(rows):
        np.testing.assert_allclose(
            worlds.get_observations()["policy"][i], one.of(own[i]), atol=1e-5
        )
    limbs = torch.tensor([[0.5, -0.5], [1.0, -2.0]])
    moved = worlds._rows.actions(limbs)
    np.testing.assert_allclose(moved[1], rows[1].actions(limbs[1].numpy()))
    assert worlds.step(limbs)[0]["policy"].shape == (2, rows[0].constant.size)


def test_training_changes_every_layer(policy: TrainedPolicy) -> None:
    """A second update in bodies with different spaces changes all weights."""
    found: list[Evaluation] = []
    counted: list[int] = []
    trained = _learner().train(BOTH, 96, 0, on_evaluation=found.append, on_steps=counted.append)
    assert [evaluation.steps for evaluation in found] == [0, 48, 96]
    assert counted == list(range(3, 97, 3))
    before = _net(policy).state_dict()
    for name, weights in _net(trained).state_dict().items():
        assert not torch.equal(weights, before[name]), name
    statistics = trained.normalisation
    assert statistics is not None
    # Rows are already scaled; rewards are divided by the deviation of their returns.
    assert (statistics.observation.var == 1.0).all()
    assert statistics.reward.count == pytest.approx(96, abs=1)


def test_the_file_acts_in_an_unseen_body(policy: TrainedPolicy, tmp_path: Path) -> None:
    """It is loaded, evaluated, fine-tuned and exported, as any other policy file."""
    path = tmp_path / "ants.safetensors"
    save_policy(policy, path)
    loaded = load_policy(path)
    assert loaded.card == policy.card
    assert loaded.card.settings == TINY
    unseen = ANT.having({"body": "AmputatedAnt"})
    zero_shot = _learner().evaluate(unseen, loaded, _NO_MAP)
    assert zero_shot == _learner().evaluate(unseen, policy, _NO_MAP)
    found: list[Evaluation] = []
    tuned = _learner().train(
        unseen, 48, 1, start=loaded, body_map=_NO_MAP, on_evaluation=found.append
    )
    assert found[0].mean_return == zero_shot.mean_return
    assert tuned.card.start_log_std == pytest.approx([0.0], abs=0.1)
    with EXTENDED.make() as env:
        export_limbs(loaded, env, EXTENDED, tmp_path / "ant.onnx")
        acting = fitted(env, loaded.card.observation)
        observation, _ = env.reset(seed=0)
        expected = acting.rows.actions(loaded.act(acting.rows.of(observation[None])))
    exported = load_policy(tmp_path / "ant.onnx")
    np.testing.assert_allclose(exported.act(observation[None]), expected, atol=1e-5)
