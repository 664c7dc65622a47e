"""What turns one of Gymnasium's MuJoCo envs into one whose body can be any of its family."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any, ClassVar, Final, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MissingExtra, SpaceMismatch
from shapechanger.headless import choose_gl, require_screen

try:
    import mujoco
    from gymnasium.envs.mujoco import MujocoEnv
except (ImportError, gym.error.DependencyNotInstalled) as error:
    raise MissingExtra("mujoco", "sim") from error

from shapechanger.bodies.families import BodyLike, Family
from shapechanger.envs.actions import check_action
from shapechanger.envs.layouts import action_layout, position_features, velocity_features
from shapechanger.envs.renderer import Renderer, body_reach, draw, halve_textures
from shapechanger.layout import Feature, Layout
from shapechanger.morphology import Body, compile_body, interpolate, reshape, to_json
from shapechanger.morphology.certificate import Certificate, Wrapped, certify
from shapechanger.morphology.pose import (
    StartRules,
    standing_height,
    start_pose,
    trunk_joint,
)

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec

__all__ = ["Reshapable"]

# How far the camera is from a body that it follows; 3.5 m for the ant.
_VIEW_DISTANCE_PER_REACH: Final = 3.0
# MuJoCo's warnings of a pose, a velocity or an acceleration that is not finite, or huge.
_DIVERGED: Final = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)


class Reshapable(MujocoEnv):
    """Mixed in before one of Gymnasium's MuJoCo envs: any body of a family, named spaces.

    The env keeps its rewards, terminations, infos and arguments. What follows from the body is
    derived from it: model, spaces, layouts, start pose.

    An env without a `render_mode` keeps textures of bodies and skies at half their width and
    height, which saves a third of its memory.

    One argument is ours and every env's: `shadows` says whether frames have shadows, reflections
    and smoothed edges; left out, frames of more than 256 x 256 pixels have, as films for people,
    and smaller ones do not, as those that a camera gives a learner twenty times faster.

    Attributes:
        family: The bodies that the env can have.
        body: The edits that make the present body from the family's model.
        observation_layout: What each number of the observation means.
        action_layout: What each number of the action means.
        standing_height: Height of the trunk above the floor when it stands with each joint in the
            middle of its range, m; None for a body that does not stand.
    """

    family: ClassVar[Family]

    body: Body
    observation_layout: Layout
    action_layout: Layout
    standing_height: float | None
    _spec: EnvSpec | None = None
    # Whether a start state is being drawn.
    _starting: bool = False

    def _begin(self, body: BodyLike, arguments: dict[str, Any]) -> None:
        """What must be there before Gymnasium's constructor compiles the model.

        Takes from the arguments what Gymnasium's constructor does not know.
        """
        self._shadows: bool | None = arguments.pop("shadows", None)
        self.body = self.family.body(body)
        mode = arguments.get("render_mode")
        self._draws = mode is not None
        if mode == "human":
            require_screen()
        elif mode is not None:
            choose_gl()
        self._given_camera: dict[str, Any] | None = arguments.get("default_camera_config")
        self._renderer_arguments = {
            "max_geom": arguments.get("max_geom", 1000),
            "camera_id": arguments.get("camera_id"),
            "camera_name": arguments.get("camera_name"),
            "visual_options": arguments.get("visual_options"),
            "shadows": self._shadows,
        }

    def _finish(self, arguments: dict[str, Any]) -> None:
        """What follows from the compiled model, and what a pickle needs to build it again."""
        self._follow_body()
        if self.observation_space.shape != (self.observation_layout.size,):
            # Gymnasium has written down the size of its own body's.
            shape = (self.observation_layout.size,)
            self.observation_space = gym.spaces.Box(-np.inf, np.inf, shape, np.float64)
        self._renew_renderer()
        # Gymnasium's constructor has recorded its own arguments; these are ours.
        self._ezpickle_args: tuple[Any, ...] = ()
        self._ezpickle_kwargs: dict[str, Any] = {"body": to_json(self.body), **arguments}
        if self._shadows is not None:
            self._ezpickle_kwargs["shadows"] = self._shadows

    # The spec is what `gym.make`, Minari and a vector env build the env from again.

    @property
    def spec(self) -> EnvSpec | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The registered spec, with the present body as JSON."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # pyright: ignore[reportIncompatibleVariableOverride]
        self._spec = copy.deepcopy(spec)
        self._record_body()

    def _record_body(self) -> None:
        """Write the present body where pickling and the spec look for it."""
        if self._spec is not None:
            self._spec.kwargs["body"] = to_json(self.body)
        self._ezpickle_kwargs["body"] = to_json(self.body)

    def _initialize_simulation(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Compile the present body in place of the file as it is."""
        model = compile_body(self._load_family(), self.body)
        # As in Gymnasium's own method: the frame buffer must be as large as the picture.
        model.vis.global_.offwidth = max(model.vis.global_.offwidth, self.width)
        model.vis.global_.offheight = max(model.vis.global_.offheight, self.height)
        return model, mujoco.MjData(model)

    def body_spec(self) -> mujoco.MjSpec:
        """What the model is compiled from: that of the family with the edits of the body."""
        return reshape(self._load_family(), self.body)

    def _load_family(self) -> mujoco.MjSpec:
        """The family's model; where nobody looks, with less to look at."""
        spec = self.family.load(self.fullpath)
        if not self._draws:
            halve_textures(spec)
        return spec

    def _follow_body(self) -> None:
        """Derive from the model what the env needs to know of it."""
        self.init_qpos = start_pose(self.model)
        self.init_qvel = np.zeros(self.model.nv)
        self.standing_height = standing_height(self.model)
        self.observation_layout = Layout(tuple(self._observation_features(self.model)))
        self.action_layout = action_layout(self.model)

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        """The features of this task's observation, in order."""
        return position_features(model) + velocity_features(model)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Start an episode.

        Args:
            seed: Seed of all randomness from here on; None goes on with the present state.
            options: `{"body": ...}` changes the body: the name of one, edits, or their JSON.

        Raises:
            SpaceMismatch: If the new body would change a space.
            UnknownName: If the body names what is not there.
            MorphologyError: If the body cannot be built.
        """
        if options is not None and "body" in options:
            self._change_body(self.family.body(options["body"]))
        return cast("Any", super()).reset(seed=seed, options=options)

    def step(self, action: Any) -> Any:
        """Act for one step, by Gymnasium's own methods.

        Where MuJoCo finds that the simulation has diverged, `info["diverged"]` is true until the
        next reset.

        Args:
            action: Shape (nu,), finite.

        Raises:
            BadAction: If the action is none; nothing has moved then.
        """
        check_action(self, action)
        result = cast("Any", super()).step(action)
        if self.diverged:
            result[-1]["diverged"] = True
        return result

    def step_into(
        self, action: Any, observation: NDArray[np.float64]
    ) -> tuple[Any, bool, bool, dict[str, Any]]:
        """Act for one step, as `step`, and write what is observed.

        Args:
            action: Shape (nu,), finite.
            observation: Is overwritten; shape of the observation space, float64, contiguous.

        Returns:
            Reward, terminated, truncated and info.
        """
        seen, *rest = self.step(action)
        observation[:] = seen
        reward, terminated, truncated, info = rest
        return reward, terminated, truncated, info

    @property
    def diverged(self) -> bool:
        """Whether MuJoCo has found a number in the simulation bad since the last reset.

        MuJoCo then starts over from the model's own pose by itself, unless the model forbids it.
        """
        return any(self.data.warning[kind].number for kind in _DIVERGED)

    def reset_model(self) -> NDArray[np.float64]:
        """Draw a start state as Gymnasium does, and make it possible.

        Joints that the noise moved beyond their limits are moved back, orientations become unit
        quaternions again, and a trunk whose feet the noise pushed into the floor is lifted.
        """
        self._starting = True
        try:
            return cast("Any", super()).reset_model()
        finally:
            self._starting = False

    def set_state(self, qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> None:
        """Put the body at a pose (nq,) with velocities (nv,)."""
        possible = self._possible(qpos) if self._starting else qpos
        cast("Any", super()).set_state(possible, qvel)

    def _possible(self, drawn: NDArray[np.float64]) -> NDArray[np.float64]:
        """The start pose that a drawn one becomes."""
        rules = self._start_rules()
        pose = rules.keep_within_limits(drawn)
        mujoco.mj_normalizeQuat(self.model, pose)
        if rules.lift is not None:
            self.data.qpos[:] = pose
            mujoco.mj_kinematics(self.model, self.data)
            gap = rules.floor_gap(self.model, self.data)
            if gap < 0.0:
                rules.lift.raise_by(pose, -gap)
        return pose

    def _start_rules(self) -> StartRules:
        """What makes a start pose possible, for the model as it is now."""
        return StartRules(self.model)

    def _change_body(self, body: Body) -> None:
        """Build another body of the same spaces; on any error the present one stays."""
        if body == self.body:
            return
        present = self.body
        self.body = body
        try:
            model, data = self._initialize_simulation()
            observation = Layout(tuple(self._observation_features(model)))
            self._require_same_spaces(observation, action_layout(model))
        except Exception:
            self.body = present
            raise
        self.model, self.data = model, data
        self._follow_body()
        self._record_body()
        self._renew_renderer()

    def _renew_renderer(self) -> None:
        """Draw the present body from here on."""
        renderer = self.mujoco_renderer
        renderer.close()
        trunk = trunk_joint(self.model)
        camera = self._given_camera or cast("dict[str, Any]", renderer.default_cam_config)
        if trunk is not None and self._given_camera is None:
            camera = {"distance": _VIEW_DISTANCE_PER_REACH * self.reach, "elevation": -20.0}
        self.mujoco_renderer = Renderer(
            self.model,
            self.data,
            camera,
            self.width,
            self.height,
            # Whoever says where to look is not turned away from it.
            follow=None
            if trunk is None or "lookat" in camera
            else int(self.model.jnt_bodyid[trunk]),
            **self._renderer_arguments,
        )

    def _require_same_spaces(self, observation: Layout, action: Layout) -> None:
        """Refuse layouts that would change a space that learners already hold."""
        for space, old, new in (
            ("observation", self.observation_layout, observation),
            ("action", self.action_layout, action),
        ):
            lost = [name for name in old.names if name not in new]
            gained = [name for name in new.names if name not in old]
            bounds_move = space == "action" and not (
                np.array_equal(old.low, new.low) and np.array_equal(old.high, new.high)
            )
            if old.names != new.names or bounds_move:
                change = "; ".join(
                    f"{word} {', '.join(names[:3])}{' and more' * (len(names) > 3)}"
                    for word, names in (("it loses", lost), ("it gains", gained))
                    if names
                )
                if not change:
                    change = "its bounds move" if bounds_move else "its order changes"
                raise SpaceMismatch(
                    f"This body would change the {space} space from {old.size} to {new.size} "
                    f"numbers ({change}): a reset cannot change a space, so "
                    "make another env with this body and cross over with a body map."
                )

    # What a transfer study asks of an env, whichever kind it is.

    @staticmethod
    def certify_shift(
        source: gym.Env[Any, Any], target: gym.Env[Any, Any], *, allow_empty: bool = False
    ) -> Certificate:
        """What changes from one env to the other, wrappers included; both are reset.

        Raises:
            EmptyShift: If nothing does, and `allow_empty` is false.
        """
        return certify(cast("Wrapped", source), cast("Wrapped", target), allow_empty=allow_empty)

    def body_towards(self, target: Reshapable, alpha: float) -> Body:
        """The body at the part `alpha` in [0, 1] of the way to the body of `target`."""
        return interpolate(self.body, target.body, alpha)

    @property
    def reach(self) -> float:
        """How far from the middle of the body its farthest point is when it starts, m."""
        return body_reach(self.model, self.init_qpos)

    def picture(
        self, width: int = 480, height: int = 360, reach: float | None = None
    ) -> NDArray[np.uint8]:
        """The body as it starts, shape (height, width, 3).

        Args:
            width: Width in pixels.
            height: Height in pixels.
            reach: Metres in view around the middle of the body; None for its own reach.

        Raises:
            RenderError: If nothing can be drawn here.
        """
        return draw(self.model, self.init_qpos, width, height, reach or self.reach)
