"""Resolve the names of envs that users give: ids, short names and files of robots."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import gymnasium as gym

from shapechanger.contract.env_ref import EnvRef
from shapechanger.envs.catalogue import (
    CATALOGUE,
    FINGER_ENVS,
    MODEL_FILES,
    ODRL_ENVS,
    OWN_ROBOT,
    RANGES_ENVS,
    REMOTE_FINGER,
    REMOTE_FINGER_TRACK,
    VEHICLE_ENVS,
    WAYPOINT_ENVS,
    find,
    find_task,
)
from shapechanger.envs.opengl import require_known_gl
from shapechanger.errors import MorphologyError, StudyError, UnknownName

_IN_MODULE: Final = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^:]+")  # Such as `module:id`.


def env_ref(env_id: str, body: str = "") -> EnvRef:
    """Return a reference to an env, optionally with another body."""
    require_known_gl()
    file, at, own_task = env_id.partition("@")
    if file.endswith(MODEL_FILES):
        allow_own_modules(own_task)
        more = {"task": own_task} if at else {}
        return EnvRef(OWN_ROBOT, {"path": file, **more, **({"body": body} if body else {})})
    try:
        full = find_task(env_id) or find(env_id).id
    except UnknownName:
        # Accept third-party envs, as `module:id` or if registered; `make` checks them again.
        if not _IN_MODULE.fullmatch(env_id) and env_id not in gym.registry:
            raise
        allow_own_modules(env_id)
        full = env_id
    if body and full not in {*CATALOGUE, *ODRL_ENVS, OWN_ROBOT}:
        raise MorphologyError(f"{full} takes no body; these do: {', '.join(CATALOGUE)}.")
    return EnvRef(full, {"body": body} if body else {})


def short_name(env_id: str) -> str:
    """Return the name of an env as a part of a folder's name."""
    file, _, own_task = env_id.partition("@")
    if file.endswith(MODEL_FILES):
        return "-".join(filter(None, (Path(file).stem, own_task.rpartition(":")[2])))
    return env_id.replace("odrl/", "odrl-").rpartition("/")[2].removesuffix("-v1")


def allow_own_modules(*names: str | None) -> None:
    """Let names such as `my_methods:warm-start` import modules of the current folder.

    Only names that the user gives may import modules: a class named in a policy's file must not be
    found in the same folder.
    """
    here = str(Path.cwd())
    own = any(name and (":" in name or name.endswith(".toml")) for name in names)
    if own and here not in sys.path:
        sys.path.append(here)  # Worker processes inherit the path.


def default_learner(env: EnvRef) -> str:
    """Return the learner tuned on the env's family; for other envs, the ant's."""
    learners = {
        **dict.fromkeys(VEHICLE_ENVS, "cloning"),
        **dict.fromkeys(WAYPOINT_ENVS, "waypoint"),
        **dict.fromkeys(RANGES_ENVS, "ppo-drive"),
        **dict.fromkeys((REMOTE_FINGER, REMOTE_FINGER_TRACK), "ppo-rig"),
    }
    entry = CATALOGUE.get(env.id) or ODRL_ENVS.get(env.id) or FINGER_ENVS.get(env.id)
    return entry.learner if entry else learners.get(env.id, "ppo-run")


def driven(env: EnvRef, lenses: Sequence[str] = ()) -> EnvRef:
    """Return a vehicle's env with the options of studies, which put it back after a collision."""
    if lenses and env.id not in VEHICLE_ENVS:
        raise StudyError(f"{env} has no camera; these have one: {', '.join(VEHICLE_ENVS)}.")
    if env.id not in {*VEHICLE_ENVS, *WAYPOINT_ENVS, *RANGES_ENVS}:
        return env
    more: dict[str, Any] = {"lenses": list(lenses)} if lenses else {}
    return EnvRef(env.id, {**env.kwargs, "put_back": True, **more})
