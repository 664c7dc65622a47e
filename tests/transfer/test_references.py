"""The shipped references and their policies."""

from __future__ import annotations

import pytest

from shapechanger.contract.env_ref import EnvRef, measures_of
from shapechanger.envs.catalogue import CATALOGUE
from shapechanger.envs.naming import default_learner
from shapechanger.errors import UnknownName
from shapechanger.policy import load_policy
from shapechanger.transfer.identities import ENV, identify, known
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED, evaluate
from shapechanger.transfer.references import FOLDER, load_references, reference_of, reference_policy

REFERENCES = load_references()


def test_every_env_of_the_catalogue_has_one() -> None:
    assert set(REFERENCES) == set(CATALOGUE)
    assert {path for path in FOLDER.glob("*.safetensors")} == {
        reference_policy(env) for env in REFERENCES
    }


@pytest.mark.parametrize("env_id", REFERENCES)
def test_a_policy_has_the_skill_of_its_numbers(env_id: str) -> None:
    """The card is the reference's, and an episode is far above the floor."""
    env, reference = EnvRef(env_id), REFERENCES[env_id]
    policy = load_policy(reference_policy(env_id))
    assert policy.card.env == env
    assert (policy.card.steps, policy.card.seed) == (reference.steps, reference.policy_seed)
    assert policy.card.learner == reference.learner
    assert policy.card.identity == known({ENV: identify(env)})
    # The pendulums' were trained when learners acted in N.
    in_newtons = "Pendulum" in env_id and "Double" not in env_id
    assert default_learner(env) == ("ppo-pendulum" if in_newtons else reference.learner)
    made = env.make()
    try:
        measures = [measure.name for measure in measures_of(made)]
        found = evaluate(policy.act, [made], EVALUATION_SEED, episodes=1)
    finally:
        made.close()
    assert list(reference.ends) == measures
    measure = measures[0]
    floor = max(values[measure] for values in reference.floor.values())
    end = reference.ends[measure][reference.seeds.index(reference.policy_seed)]
    assert found.value(measure) > floor + 0.25 * (end - floor)


def test_other_bodies_have_none() -> None:
    assert reference_of(EnvRef("shapechanger/Ant-v1")) is not None
    assert reference_of(EnvRef("shapechanger/Ant-v1", {"body": "BigAnt"})) is None
    assert reference_of(EnvRef("Ant-v5")) is None
    with pytest.raises(UnknownName, match="reference policy"):
        reference_policy("shapechanger/Car-v1")
