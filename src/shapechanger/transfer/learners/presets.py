"""Shipped settings of learners, and settings that a user names or changes."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

import msgspec

from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.errors import StudyError, UnknownName
from shapechanger.files import place_of, read_text
from shapechanger.transfer.learners.settings import (
    CloningSettings,
    ImportedSettings,
    LimbSettings,
    OffPolicySettings,
    PpoSettings,
    RslLimbSettings,
    RslPpoSettings,
    Settings,
)

_Kind = TypeVar("_Kind", bound=msgspec.Struct)

# Tuned on the reaching finger only: each of four seeds ends with 200 of 200
# targets reached (`python -m benchmarks.run finger-learned`).
_FINGER: Final = PpoSettings(
    n_envs=16,
    n_steps=128,
    batch_size=256,
    n_epochs=10,
    learning_rate=5e-4,
    gamma=0.95,
    gae_lambda=0.9,
    log_std_init=-0.5,
    net_arch=(128, 128),
    normalise=True,
    steps=307_200,
    eval_every=30_720,
    # The 95 % interval (Wilson) of a share of 80 % is 58 % to 92 % with 20 targets, and with 60 it
    # is 68 % to 88 %.
    eval_episodes=60,
)

_RUN: Final = PpoSettings(
    n_envs=64,
    n_steps=128,
    batch_size=2048,
    n_epochs=10,
    learning_rate=3e-4,
    log_std_init=-1.0,
    normalise=True,
    steps=1_048_576,
    eval_every=65_536,
)
# Half the passes of `ppo-run`, since each costs three times as much; the rate was chosen on 32 half
# cheetahs, see docs/decisions.md.
_LIMBS: Final = LimbSettings(
    n_envs=64,
    n_steps=128,
    batch_size=2048,
    n_epochs=5,
    learning_rate=1e-3,
    log_std_init=-1.0,
    normalise=True,
    steps=1_048_576,
    eval_every=131_072,
)

# `ppo-balance` was tuned on InvertedPendulum and BigInvertedPendulum with actions in N, and a noise
# of 1 N at the start: within 24,576 steps the latter ended at 1,000 on 5 of 5 seeds
# (benchmarks/results/demo.json). SmallInvertedPendulum is harder: both of two seeds reached 1,000,
# and one had dropped to 744 at the end. `ppo-pendulum` is for them since actions are from -1 to 1.
# `ppo-run` was tuned on the ant, seed 0: three seeds walk at 2.1, 2.0 and 1.5 m/s after 1,048,576
# steps (the sources in benchmarks/results/atlas-ants-runs.json). `ppo-planar` has four times as
# many updates and more exploration noise at the start, with which half cheetahs end lower. The
# results are in `transfer/references`, and the reasons in docs/decisions.md.
LEARNERS: Final[dict[str, Settings]] = {
    "ppo-balance": PpoSettings(
        n_envs=16,
        n_steps=64,
        batch_size=128,
        n_epochs=10,
        learning_rate=1e-3,
        steps=24_576,
        eval_every=3072,
    ),
    # `ppo-balance` with less noise: see docs/decisions.md.
    "ppo-pendulum": PpoSettings(
        n_envs=16,
        n_steps=64,
        batch_size=128,
        n_epochs=10,
        learning_rate=1e-3,
        log_std_init=-0.7,
        steps=24_576,
        eval_every=3072,
    ),
    "ppo-run": _RUN,
    # The numbers of `ppo-run`, for which no GPU was there to tune others.
    "rsl-ppo": RslPpoSettings(**msgspec.structs.asdict(_RUN)),
    "ppo-planar": PpoSettings(
        n_envs=16,
        n_steps=128,
        batch_size=256,
        n_epochs=10,
        learning_rate=3e-4,
        normalise=True,
        steps=1_048_576,
        eval_every=65_536,
    ),
    "limbs": _LIMBS,
    "rsl-limbs": RslLimbSettings(**msgspec.structs.asdict(_LIMBS)),
    # What limbs are compared with; an extended ant has 12 limbs.
    "padded": msgspec.structs.replace(_LIMBS, network="padded", net_arch=(256, 256), room=12),
    # In smaller batches than `ppo-run`. With actions in the unit of its motors, which take 0.4, and
    # the same noise (a logarithm of -2) it ended at 653, and with `ppo-run` at 468. With both it
    # falls after two seconds, before it walks.
    "ppo-humanoid": PpoSettings(
        n_envs=16,
        n_steps=256,
        batch_size=256,
        n_epochs=5,
        learning_rate=1e-4,
        gae_lambda=0.9,
        log_std_init=-1.1,
        net_arch=(256, 256),
        normalise=True,
        steps=524_288,
        eval_every=65_536,
    ),
    # A swimming stroke takes longer than a stride, so the discount is closer to 1.
    "ppo-swim": PpoSettings(
        n_envs=16,
        n_steps=512,
        batch_size=512,
        n_epochs=10,
        learning_rate=6e-4,
        gamma=0.9999,
        gae_lambda=0.98,
        normalise=True,
        steps=1_048_576,
        eval_every=65_536,
    ),
    "ppo-finger": _FINGER,
    # Ten minutes of motion of the rig; source steps are simulated, and so cheap.
    "ppo-rig": msgspec.structs.replace(
        _FINGER, steps=30_720, source_steps=307_200, eval_every=6144
    ),
    "ppo-drive": PpoSettings(
        n_envs=16,
        n_steps=128,
        batch_size=256,
        n_epochs=10,
        learning_rate=3e-4,
        log_std_init=-0.5,
        normalise=True,
        steps=81_920,
        eval_every=20_480,
    ),
    # Half a minute, and 1, 2, 5 and 10 minutes, at 20 steps a second.
    "cloning": CloningSettings(
        budgets=(600, 1200, 2400, 6000, 12_000),
        episode_steps=200,  # So that half a minute already covers three courses.
        eval_episodes=4,
        eval_steps=400,
        # Early stopping on few held-out pictures is unreliable: it stopped after 150 steps.
        clone=CloneSettings(held_out=0.0),
    ),
    # 5, 15, 30 and 60 s of a target, and 6 minutes of a source. Each evaluation is of about 500 m,
    # so that a collision more or less decides nothing.
    "waypoint": CloningSettings(
        budgets=(100, 300, 600, 1200, 7200),
        episode_steps=200,
        eval_episodes=12,
        eval_steps=500,
        # A share of 0.5 or 0.8 of the source's demonstrations drives alike: docs/vehicles.md.
        clone=CloneSettings(held_out=0.0, passes=50.0, most_steps=3000, rehearsal=0.5),
    ),
    # Small networks and few random steps: a pole of 0.6 m is balanced after 12,000 steps.
    "sac-balance": OffPolicySettings(
        algorithm="SAC",
        net_arch=(64, 64),
        learning_rate=1e-3,
        batch_size=128,
        buffer_size=100_000,
        learning_starts=1000,
        steps=16_000,
        source_steps=16_000,
        eval_every=2000,
    ),
    # The settings that the papers of SAC and TQC share, and Stable-Baselines3's defaults.
    "sac": OffPolicySettings(algorithm="SAC", steps=200_000, eval_every=20_000),
    "tqc": OffPolicySettings(algorithm="TQC", steps=200_000, eval_every=20_000),
}


IN_MANY_BODIES: Final = {"rsl-ppo": "rsl-limbs"}
"""Learners of one body, each with the one that learns alike in many."""


TUNED_ON: Final[dict[str, tuple[str, ...]]] = {
    "ppo-balance": (),
    "ppo-pendulum": ("InvertedPendulum", "BigInvertedPendulum"),
    "ppo-run": ("Ant", "AmputatedAnt", "BigAnt", "ExtendedAnt", "HalfCheetah"),
    "ppo-swim": ("Swimmer",),
    "ppo-planar": ("Hopper", "Walker2d", "InvertedDoublePendulum"),
    "ppo-humanoid": ("Humanoid",),
    "limbs": ("HalfCheetah",),
    "padded": ("HalfCheetah",),
    "ppo-finger": ("Finger", "FingerTrack"),
    "ppo-rig": ("Finger",),
    "ppo-drive": ("CarRanges",),
    "cloning": ("Car", "Tank", "Truck", "Boat"),
    "waypoint": ("CarWaypoint", "TankWaypoint", "TruckWaypoint"),
    "sac-balance": ("InvertedPendulum",),
    "rsl-ppo": (),
    "rsl-limbs": (),
    "sac": (),
    "tqc": (),
}
"""The envs that the settings of each learner were tuned on.

Settings count as tuned on another body of the same family if a policy that ships, or a benchmark,
reached its target there with them as they are: `shapechanger policies list --references`, and the
rows `finger-learned`, `vehicles-clone` and `vehicles-waypoints`.
"""


def tuning_text(learner: str, env: str) -> str:
    """State whether the settings of a learner were tuned on an env.

    Args:
        learner: Name of the learner.
        env: Id of the env.
    """
    if not TUNED_ON.get(learner):
        return "It is not stated what these settings were tuned on."
    name = env.rpartition("/")[2].removesuffix("-v1")
    *first, last = TUNED_ON[learner]
    tuned = f"{', '.join(first)} and {last}" if first else last
    if name in TUNED_ON[learner]:
        return f"The settings were tuned on {tuned}."
    return f"The settings were tuned on {tuned}, not on {name}."


def learner_settings(name: str) -> Settings:
    """Return the shipped settings of a learner.

    Raises:
        UnknownName: If no learner has this name.
    """
    if name not in LEARNERS:
        raise UnknownName("learner", name, LEARNERS)
    return LEARNERS[name]


def resolve_learner(learner: str, changed: Mapping[str, Any]) -> tuple[str, Settings]:
    """Return the name and the settings of a learner, with some of them replaced.

    Args:
        learner: Name of shipped settings; a TOML file; or `module:name`, a class of models that is
            compatible with Stable-Baselines3, or a function that builds one.
        changed: New values by name, as TOML or JSON hold them. With `module:name`, those that are
            no settings of ours are arguments of the class or function.

    Raises:
        UnknownName: If there is no such learner, or it has no such setting.
        StudyError: If a value is of the wrong type, or impossible, or the file cannot be read.
    """
    if learner.endswith(".toml"):
        return _read_learner(Path(learner), changed)
    if ":" in learner:
        return learner, _imported(learner, changed)
    return learner, _changed(learner, learner_settings(learner), changed)


def _read_learner(path: Path, changed: Mapping[str, Any]) -> tuple[str, Settings]:
    """Read a TOML file that names a preset or an algorithm, and changes some of its settings."""
    try:
        text = read_text(path)
        given = tomllib.loads(text)
    except FileNotFoundError:
        raise UnknownName("learner", str(path), LEARNERS) from None
    except (OSError, ValueError) as error:  # TOMLDecodeError is one, too.
        raise StudyError(f"The learner {path} cannot be read: {error}.") from error
    start = given.pop("preset", None) or given.pop("algorithm", None)
    if not isinstance(start, str) or start.endswith(".toml"):
        raise StudyError(
            f"{path} must name what it starts from: `preset` is one of {', '.join(LEARNERS)}, or "
            "`algorithm` is a class or function as module:name."
        )
    try:
        _, settings = resolve_learner(start, {**given, **changed})
    except (StudyError, UnknownName) as error:
        raise StudyError(f"{path}{place_of(text, error)}: {error}") from error
    return path.stem, settings


def _imported(algorithm: str, changed: Mapping[str, Any]) -> Settings:
    from shapechanger.transfer.learners.algorithms import checked_settings

    ours = {field.name for field in msgspec.structs.fields(ImportedSettings)}
    own = {name: value for name, value in changed.items() if name in ours}
    own["arguments"] = {name: value for name, value in changed.items() if name not in ours}
    return checked_settings(
        _converted(algorithm, ImportedSettings, {"algorithm": algorithm, **own})
    )


def _changed(name: str, settings: Settings, changed: Mapping[str, Any]) -> Settings:
    known: dict[str, Any] = msgspec.structs.asdict(settings)
    for setting in changed:
        if setting not in known:
            raise UnknownName(f"setting of {name}", setting, known)
    values: dict[str, Any] = {**msgspec.to_builtins(settings), **changed}
    return _converted(name, type(settings), values)


def _converted(name: str, kind: type[_Kind], values: dict[str, Any]) -> _Kind:
    try:
        return msgspec.convert(values, kind, strict=True)
    except msgspec.ValidationError as error:
        raise StudyError(f"The settings of {name} are wrong: {str(error).rstrip('.')}.") from None
