"""`shapechanger demos record`: record an expert or a policy in an env."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
from gymnasium.wrappers import TimeLimit

from shapechanger.cli.console import Interrupted, StudyProgress, command_line, counted, say
from shapechanger.cli.env_arguments import Body, EnvId, options_of, require_seed
from shapechanger.contract.env_ref import EnvRef
from shapechanger.demos.drivers import EXPERT, pilot_of, record_steps
from shapechanger.demos.recording import RecordEpisodes
from shapechanger.envs.catalogue import VEHICLE_ENVS
from shapechanger.envs.naming import driven, env_ref
from shapechanger.errors import DemosError
from shapechanger.transfer.executor import use_one_thread


@dataclass(frozen=True)
class RecordDemonstrations:
    """Record an expert or a policy in an env."""

    env: EnvId
    """Id of the env, such as Car."""
    out: Path
    """Folder of the recording; new episodes are added to those there."""
    minutes: float = 10.0
    """Duration, minutes of the env's time."""
    driver: str = EXPERT
    """"expert", or the file of a policy."""
    corrected_by: str = ""
    """"expert" to let it take over where the policy would fail. Only the expert's steps are then
    learned from."""
    episode_s: float = 50.0
    """Longest episode, s; a collision ends it earlier."""
    body: Body = ""
    lenses: tuple[str, ...] = ()
    """Disturbances of a vehicle's camera, such as night."""
    put_back: bool = False
    """Put a vehicle back on its lane after a collision, instead of ending the episode."""
    options: str = ""
    """More arguments of the env as JSON, such as '{"courses": "held-out"}'."""
    seed: int = 0
    """Seed of the first episode; each later one has the next whole number."""

    def run(self) -> None:
        """Record and print a summary."""
        require_seed(self.seed)
        for name, value in (("minutes", self.minutes), ("episode-s", self.episode_s)):
            if not 0.0 < value < float("inf"):
                raise DemosError(f"--{name} is more than 0, got {value}.")
        ref = self._ref()
        try:
            made = ref.make(max_episode_steps=-1)
        except TypeError as error:
            reason = str(error).partition(" was raised from")[0]
            raise DemosError(f"{ref.id} cannot be made with these --options: {reason}.") from error
        try:
            hz = float(made.metadata.get("render_fps") or 20.0)
            longest = max(1, round(self.episode_s * hz))
            steps = max(1, round(self.minutes * 60.0 * hz))
            if self.driver != EXPERT:
                use_one_thread()  # Inference on single frames is slower with more threads.
            pilot = pilot_of(made, self.driver, self.corrected_by, self.seed)
            env = RecordEpisodes(
                TimeLimit(made, longest), self.out, driver="program", about=self._about(made)
            )
            with StudyProgress({ref.id: steps}) as progress:
                record_steps(
                    env, pilot, steps, self.seed, lambda done: progress(ref.id, done, done == steps)
                )
        except KeyboardInterrupt:
            raise Interrupted(
                f"Stopped; the recording so far is in {self.out}, complete."
            ) from None
        finally:
            made.close()
        if self.corrected_by:
            say(
                f"the expert corrected {pilot.corrected / max(pilot.steps, 1):.0%} of the steps, "
                f"{pilot.corrected} of {pilot.steps}, and took over "
                f"{counted(pilot.takeovers, 'time')}"
            )
        say(
            f"wrote {env.steps} steps, {env.seconds / 60.0:.1f} minutes, in "
            f"{counted(env.episodes, 'episode')} to {self.out}\n"
            f"look at them: shapechanger demos show {shlex.quote(str(self.out))} --out page.html"
        )

    def _ref(self) -> EnvRef:
        """Return the env with the requested options."""
        ref = env_ref(self.env, self.body)
        more: dict[str, Any] = {}
        if ref.id in VEHICLE_ENVS:
            more["state"] = True
            if self.lenses:
                driven(ref, self.lenses)
                more["lenses"] = list(self.lenses)
            if self.put_back:
                more["put_back"] = True
        elif self.lenses or self.put_back:
            raise DemosError(
                f"--put-back and --lenses are for vehicles, and {ref.id} is not one of them: "
                f"{', '.join(VEHICLE_ENVS)}."
            )
        return EnvRef(ref.id, {**ref.kwargs, **more, **options_of(self.options, "--options")})

    def _about(self, env: gym.Env[Any, Any]) -> dict[str, Any]:
        """Return further fields of the header."""
        world = getattr(env.unwrapped, "world", None)
        who = self.driver if self.driver == EXPERT else Path(self.driver).name
        notes: dict[str, Any] = {"driver": self.driver}
        if self.corrected_by:
            who += f", corrected by {self.corrected_by}"
            notes["corrected_by"] = self.corrected_by
        body = {} if world is None else {"body": world.vehicle.name}
        return {
            **body,
            "driver": who,
            "source": command_line(),
            "notes": notes,
        }
