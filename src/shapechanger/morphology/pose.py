"""The robot in a model and the poses that follow from it: limits, feet on the floor, height.

A file may contain a robot and objects, in any order. Trunk, standing height, mass, start poses and
limbs describe the robot: all bodies that the actuators move, directly or by a coupling.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.certificate.numbers import kinds_of
from shapechanger.morphology.spec.carried import CLOSED, SINGULAR, close, equality_rows, largest

_Array = NDArray[np.float64]
_J: Final = mujoco.mjtJoint
GROUND: Final = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))
"""Types of geoms that a body can stand on."""

# A joint starts at least this share of its range inside its limits, because the spring of a limit
# pushes at the limit itself.
_INSIDE: Final = 0.1
_FAR_M: Final = 1000.0  # Largest distance at which a floor is searched.
_LOCKED: Final = 1e5  # A joint is locked if damping slows it by more than this factor per step.
_VERTICAL: Final = 1e-6  # Tolerance of the vertical part of an axis that counts as vertical.
_MOST_STEPS: Final = 40  # Largest number of steps to close the loops of a start pose.
_START_CLOSED: Final = 1e-4  # Violation up to which a start pose counts as closed, m or rad.
_SHARES: Final = (0.5, 0.25, 0.125)  # Shares of a drawn deviation, tried until the loops close.
# If the pose of the file is outside its limits, random deviations of the drawn pose are tried too,
# because the steps do not close loops from a stretched arm. One in ten closes the loop of
# Metaworld's Sawyer.
_BEND: Final = 0.6  # Size of a deviation, rad or m.
_MOST_BENDS: Final = 40  # Largest number of deviations.


def robot_bodies(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Return whether each body is part of the robot, shape (nbody,).

    The robot is every kinematic tree that an actuator moves, through a joint, tendon, site or body;
    every tree that an active equality couples to one of these, such as the second finger of a
    gripper or a link of a closed loop; and the fixed bodies that carry these trees. In a model
    without actuators, every tree is part of the robot. The world is never part of it.
    """
    trees, of_tree = moved_trees(model), model.body_treeid
    roots = model.body_rootid[np.isin(of_tree, trees)]
    mask = np.isin(of_tree, trees) | ((of_tree < 0) & np.isin(model.body_rootid, roots))
    mask[0] = False
    return mask


def moved_trees(model: mujoco.MjModel) -> list[int]:
    """Return the kinematic trees of the robot; the one that most actuators move comes first."""
    everything = list(range(int(model.ntree)))
    if len(everything) < 2 or not model.nu:
        return everything
    kinds, moved, of_body = kinds_of(model), Counter[int](), model.body_treeid.tolist()
    carriers = {"joints": model.jnt_bodyid, "sites": model.site_bodyid, "geoms": model.geom_bodyid}
    found: dict[str, list[set[int]]] = {"bodies": [{tree} for tree in of_body]}
    found |= {kind: [{of_body[body]} for body in on.tolist()] for kind, on in carriers.items()}
    on_path: list[int] = model.wrap_objid.tolist()
    ways = zip(kinds["wrap_kinds"], on_path, strict=True)
    wraps = [found[kind][at] if kind else set[int]() for kind, at in ways]
    paths = zip(model.tendon_adr.tolist(), model.tendon_num.tolist(), strict=True)
    found["tendons"] = [set[int]().union(*wraps[at : at + n]) for at, n in paths]

    def trees(kind: str, *ends: int) -> set[int]:
        known = found.get(kind, [])  # A flex has no entry.
        return set[int]().union(*(known[at] for at in ends if at >= 0 and known)) - {-1}

    pulled = zip(kinds["actuator_target_kinds"], model.actuator_trnid.tolist(), strict=True)
    for kind, ends in pulled:
        moved.update(trees(kind, *(ends if kind == "sites" else ends[:1])))
    pairs = zip(kinds["eq_kinds"], model.eq_obj1id.tolist(), model.eq_obj2id.tolist(), strict=True)
    coupled = [trees(*pair) for pair, on in zip(pairs, model.eq_active0, strict=True) if on]
    for _ in everything:  # Trees that an equality couples to a moved tree count as moved.
        for tied in coupled:
            if not tied.isdisjoint(moved):
                moved.update(dict.fromkeys(tied, 0))
    return sorted(moved, key=lambda tree: (-moved[tree], tree)) or everything


class Lift(NamedTuple):
    """The coordinate of a pose that raises the trunk.

    Attributes:
        place: Its index in qpos.
        up: 1 if a larger value is higher; -1 for a slide that points down.
        at_zero_m: Height of the trunk's origin in the world at the value 0, m.
    """

    place: int
    up: float
    at_zero_m: float

    def raise_by(self, pose: _Array, distance_m: float) -> None:
        """Move the trunk of a pose (nq,) up, in place."""
        pose[self.place] += self.up * distance_m

    def height(self, pose: _Array) -> float:
        """Return the height of the trunk's origin at a pose (nq,), m."""
        return float(self.at_zero_m + self.up * pose[self.place])

    def number_at(self, height_m: float) -> float:
        """Return the coordinate's value at which the trunk's origin is this high."""
        return self.up * (height_m - self.at_zero_m)


def travelling_body(model: mujoco.MjModel) -> int | None:
    """Return the index of the robot's body that can travel; None if no body can.

    This is the body with the robot's free joint or, if it has none, the body on the world with its
    first slide without limits (runners in a plane). Free objects are not part of the robot,
    see `robot_bodies`. Of several free robots, the one that most actuators move is used.
    """
    joints = _travelling_joints(model)
    return int(model.jnt_bodyid[joints[0]]) if joints else None


def trunk_lift(model: mujoco.MjModel) -> Lift | None:
    """Return the coordinate that raises the trunk; None for a body that cannot be raised.

    It belongs to the robot's free joint or, if it has none, to its first vertical slide without
    limits on a body on the world. A slide with limits is a hoist, and its body does not stand.
    """
    for joint in _travelling_joints(model):
        place, body, axis = int(model.jnt_qposadr[joint]), model.jnt_bodyid[joint], np.zeros(3)
        if model.jnt_type[joint] == _J.mjJNT_FREE:
            return Lift(place + 2, 1.0, 0.0)
        mujoco.mju_rotVecQuat(axis, model.jnt_axis[joint], model.body_quat[body])
        if abs(axis[2]) > 1.0 - _VERTICAL:
            up = float(np.sign(axis[2]))
            # `ref` is the value at which the body is where the model puts it.
            return Lift(place, up, float(model.body_pos[body, 2] - up * model.qpos0[place]))
    return None


def _moving_dofs(model: mujoco.MjModel) -> NDArray[np.bool_]:
    # Some files lock a joint with a damping of 1e11; MuJoCo diverges unless the joint is at rest.
    return model.dof_damping * model.opt.timestep <= _LOCKED * model.dof_M0


def _travelling_joints(model: mujoco.MjModel) -> list[int]:
    """Return the robot's free joints or, if it has none, its slides without limits on the world."""
    slides = (model.jnt_type == _J.mjJNT_SLIDE) & (model.jnt_limited == 0)
    slides &= _moving_dofs(model)[model.jnt_dofadr]
    slides &= model.body_parentid[model.jnt_bodyid] == 0
    return _in_robot(model, model.jnt_type == _J.mjJNT_FREE) or _in_robot(model, slides)


def _in_robot(model: mujoco.MjModel, joints: NDArray[np.bool_]) -> list[int]:
    found = np.flatnonzero(joints).tolist()
    if model.ntree < 2 or not found:
        return found
    of_tree = model.body_treeid[model.jnt_bodyid]
    return [joint for tree in moved_trees(model) for joint in found if of_tree[joint] == tree]


def start_pose(model: mujoco.MjModel, inside: float = _INSIDE) -> _Array:
    """Return the model's own pose, shape (nq,), made feasible.

    Each joint of the robot is moved inside its limits by at least the share `inside` of its range,
    equalities are satisfied, and a trunk that can be raised stands no lower than its feet need.
    """
    rules = StartRules(model)
    pose = rules.keep_within_limits(model.qpos0, inside)
    return rules.feasible(pose, mujoco.MjData(model))


def standing_pose(model: mujoco.MjModel, pose: _Array) -> _Array:
    """Return a pose (nq,) with the trunk at the height at which the robot just touches the floor.

    The pose is returned unchanged if no joint raises the trunk or no floor is below it.
    """
    rules, pose = StartRules(model), pose.copy()
    if rules.lift is not None and (gap := rules.floor_gap(posed(model, pose))) < _FAR_M:
        rules.lift.raise_by(pose, -gap)
    return pose


def standing_height(model: mujoco.MjModel, pose: _Array | None = None) -> float | None:
    """Return the world height of the trunk's origin when the lowest point touches the floor, m.

    Without a pose (nq,), each joint is in the middle of its range and the trunk upright. A body
    that no joint raises, or that has no floor to stand on, has no height: None.
    """
    rules = StartRules(model)
    if rules.lift is None:
        return None
    if pose is None:
        pose = model.qpos0.copy()
        pose[rules.limited_places] = 0.5 * (rules.lowest + rules.highest)
    gap = rules.floor_gap(posed(model, pose))
    return None if gap >= _FAR_M else rules.lift.height(pose) - gap


def floor_height(model: mujoco.MjModel, pose: _Array) -> float:
    """Return the height in the world of the floor nearest to a robot in a pose, m; 0 for none."""
    data, ends, nearest = posed(model, pose), np.zeros(6), (_FAR_M, 0.0)
    for floor, geom in StartRules(model).floor_pairs:
        gap = mujoco.mj_geomDistance(model, data, floor, geom, _FAR_M, ends)
        nearest = min(nearest, (gap, float(ends[2])))
    return nearest[1]


def posed(model: mujoco.MjModel, pose: _Array) -> mujoco.MjData:
    """Return data of a model in a pose (nq,), up to date with `mj_kinematics`."""
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    return data


class StartRules:
    """Rules for feasible start poses, read from a model once.

    Attributes:
        lift: The coordinate that raises the trunk; see `trunk_lift`.
        limited_places: Indices in qpos of the robot's hinges and slides with limits.
        lowest: Lower limits of these joints, rad or m.
        highest: Upper limits of these joints, rad or m.
        floor_pairs: Each floor with each geom of the robot that it can touch.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.lift = trunk_lift(model)
        self._model = model
        limited = (model.jnt_type > int(_J.mjJNT_BALL)) & (model.jnt_limited != 0)
        # A single tree is the robot. Runners make these rules at each reset, so skip the search.
        self._robot = robot_bodies(model) if model.ntree > 1 else np.arange(model.nbody) > 0
        joints = np.flatnonzero(limited & self._robot[model.jnt_bodyid])
        self.lowest, self.highest = model.jnt_range[joints].T
        self.limited_places = model.jnt_qposadr[joints]
        self.floor_pairs: list[tuple[int, int]] = []
        of_world = model.body_weldid[model.geom_bodyid] == 0
        own = ~of_world & self._robot[model.geom_bodyid]
        kinds, others = model.geom_contype, model.geom_conaffinity
        for floor in np.flatnonzero(of_world & np.isin(model.geom_type, GROUND)).tolist():
            touching = (kinds & others[floor]) | (others & kinds[floor])
            geoms = np.flatnonzero(own & (touching != 0)).tolist()
            self.floor_pairs += [(floor, geom) for geom in geoms]

    @property
    def robot_places(self) -> NDArray[np.bool_]:
        """Whether each number of qpos is one of the robot's, shape (nq,)."""
        model = self._model
        # Each number belongs to the last joint that begins at or before it.
        joints = np.searchsorted(model.jnt_qposadr, np.arange(model.nq), side="right") - 1
        return self._robot[model.jnt_bodyid[joints]]

    @property
    def robot_dofs(self) -> NDArray[np.bool_]:
        """Whether each number of qvel is one of the robot's, and not locked, shape (nv,)."""
        return _moving_dofs(self._model) & self._robot[self._model.dof_bodyid]

    def keep_within_limits(self, pose: _Array, inside: float = 0.0) -> _Array:
        """Return a pose, shape (nq,), with the robot's hinges and slides moved inside their limits.

        Their distance from the limits is at least the share `inside` of their range.
        """
        result, margin = pose.copy(), inside * (self.highest - self.lowest)
        low, high = self.lowest + margin, self.highest - margin
        # `np.clip` takes four times as long, a tenth of the reset of a pendulum.
        result[self.limited_places] = np.minimum(np.maximum(pose[self.limited_places], low), high)
        return result

    def floor_gap(self, data: mujoco.MjData) -> float:
        """Return the clearance of the robot's lowest point above the floor, m; negative inside it.

        The floor is every plane and height field that is fixed to the world and can touch the
        robot's geoms. Without a floor, 1000 is returned. `data` must be up to date with
        `mj_kinematics`.
        """
        gaps = (
            mujoco.mj_geomDistance(self._model, data, floor, geom, _FAR_M, None)
            for floor, geom in self.floor_pairs
        )
        return min(gaps, default=_FAR_M)

    def feasible(self, drawn: _Array, data: mujoco.MjData, start: _Array | None = None) -> _Array:
        """Return a feasible pose near a drawn one, (nq,); the pose in `data` is overwritten.

        Joints are moved inside their limits, orientations normalised, equalities satisfied as well
        as they are at the pose `start` (nq,), by default the model's own, and a trunk whose feet
        are in the floor is lifted.
        """
        pose = self.keep_within_limits(drawn)
        mujoco.mj_normalizeQuat(self._model, pose)
        self._lift(pose, data)
        if self._model.neq:
            start = self._model.qpos0 if start is None else start
            goal = max(_START_CLOSED, self._violation(start, data) + CLOSED)
            pose = self._closed(pose, start, goal, data)
            lifted = pose.copy()
            self._lift(lifted, data)
            # Do not lift a robot that hangs on a weld or a rope.
            if self._violation(lifted, data) <= goal:
                pose = lifted
        return pose

    def still(self, pose: _Array, velocity: _Array, data: mujoco.MjData) -> _Array:
        """Return the velocity (nv,) nearest to a drawn one that violates no equality at a pose."""
        if not self._model.neq:
            return velocity
        self._violation(pose, data)
        jacobian = np.where(self.robot_dofs, equality_rows(self._model, data)[2], 0.0)
        return velocity - np.linalg.pinv(jacobian, SINGULAR) @ (jacobian @ velocity)

    def _lift(self, pose: _Array, data: mujoco.MjData) -> None:
        """Lift the trunk of a pose until its feet are not in the floor, in place."""
        if self.lift is not None:
            data.qpos[:] = pose
            mujoco.mj_kinematics(self._model, data)
            if (gap := self.floor_gap(data)) < 0.0:
                self.lift.raise_by(pose, -gap)

    def _violation(self, pose: _Array, data: mujoco.MjData) -> float:
        data.qpos[:] = pose
        mujoco.mj_fwdPosition(self._model, data)
        return largest(equality_rows(self._model, data)[1])

    def _closed(self, drawn: _Array, start: _Array, goal: float, data: mujoco.MjData) -> _Array:
        """Return a pose near `drawn` that violates at most `goal`; else the start or best try."""
        is_inside = bool(np.all(start == self.keep_within_limits(start)))
        best, least = start.copy() if is_inside else drawn, np.inf
        for pose in self._tries(drawn, start, is_inside):
            self._violation(pose, data)
            violation = close(self._model, data, self.robot_dofs, _MOST_STEPS)
            if violation <= goal:
                return data.qpos.copy()
            if violation < least and not is_inside:
                best, least = data.qpos.copy(), violation
        return best

    def _tries(self, drawn: _Array, start: _Array, is_inside: bool) -> Iterator[_Array]:
        """Yield the drawn pose, poses nearer to the start and, if needed, random ones around it."""
        yield drawn
        deviation, rng = np.zeros(self._model.nv), np.random.default_rng(0)
        mujoco.mj_differentiatePos(self._model, deviation, 1.0, start, drawn)
        for share in _SHARES:
            yield self._moved(start, share * deviation)
        for _ in range(0 if is_inside else _MOST_BENDS):
            bend = rng.uniform(-_BEND, _BEND, self._model.nv)
            yield self._moved(drawn, np.where(self.robot_dofs, bend, 0.0))

    def _moved(self, pose: _Array, step: _Array) -> _Array:
        moved = pose.copy()
        mujoco.mj_integratePos(self._model, moved, step, 1.0)
        return self.keep_within_limits(moved)
