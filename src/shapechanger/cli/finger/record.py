"""`shapechanger finger record`: a finger moves its joints about, and a log is kept."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.cli.env_arguments import env_ref, options_of, require_seed
from shapechanger.errors import FingerError

__all__ = ["Record"]


@dataclass(frozen=True)
class Record:
    """Move all joints of a finger about, and keep a log of it."""

    env: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ENV")]
    """Id of the env, such as Finger."""
    out: Path
    """The log to write, such as finger.npz."""
    seconds: float = 10.0
    """How long, s."""
    seed: int = 0
    """Seed of the motions."""
    actions: str = "impedance"
    """What an action commands: impedance, tension or length."""
    gap: str = ""
    """Name of the gap that the finger is drawn from, such as real-like; empty for the nominal
    finger."""
    finger_seed: int = 0
    """Which finger of the gap."""
    options: str = ""
    """More arguments of the env as JSON, such as '{"robot": "my-finger"}'."""

    def run(self) -> None:
        """Record, and say what came of it."""
        from shapechanger.envs.finger.identification import record_babble
        from shapechanger.identify import save_log
        from shapechanger.transfer.env_ref import EnvRef
        from shapechanger.transfer.files import make_folder

        require_seed(self.seed)
        require_seed(self.finger_seed)
        if not 0.0 < self.seconds < float("inf"):
            raise FingerError(f"--seconds is more than 0, got {self.seconds}.")
        make_folder(self.out.parent)
        ref = env_ref(self.env)
        more: dict[str, Any] = {"actions": self.actions}
        if self.gap:
            more |= {"gap": self.gap, "finger_seed": self.finger_seed}
        ref = EnvRef(ref.id, {**ref.kwargs, **more, **options_of(self.options, "--options")})
        try:
            env = ref.make(max_episode_steps=-1)
        except TypeError as error:
            reason = str(error).partition(" was raised from")[0]
            raise FingerError(f"{ref.id} is no env of a finger: {reason}.") from error
        try:
            log = record_babble(env, self.seconds, self.seed, self.actions)
        finally:
            env.close()
        save_log(log, self.out)
        plain_console().print(
            f"wrote {len(log)} rows, {log.seconds:g} s, to {self.out}\n"
            f"find out what it is like: shapechanger finger identify {shlex.quote(str(self.out))}",
            soft_wrap=True,
        )
