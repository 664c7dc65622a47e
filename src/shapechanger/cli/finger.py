"""`shapechanger finger`: record, identify and export a finger."""

from __future__ import annotations

import dataclasses
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro
from rich.table import Table

from shapechanger.cli.console import print_table, say
from shapechanger.cli.env_arguments import EnvId, opened, options_of
from shapechanger.envs.catalogue import env_ref
from shapechanger.errors import FingerError, OutputError, StudyError, check_seed
from shapechanger.files import read_file, reading, require_file, write_atomic
from shapechanger.finger.anatomy import JOINTS, TENDONS
from shapechanger.finger.gap import resolve_gap, shipped_rig
from shapechanger.finger.identify import identify, load_log, save_log
from shapechanger.finger.identify.log import record_babble
from shapechanger.finger.model import finger_mjcf
from shapechanger.finger.parameters import NOMINAL, PARAMETER_SETS, FingerParameters, named_set
from shapechanger.finger.report import (
    arm_cell,
    finger_html,
    interval,
    label,
    number,
    summary_line,
    unknown,
)
from shapechanger.finger.tensions import drive_of

# Size of the largest file of parameters, bytes; a usual file has some kilobytes.
_MOST_BYTES: Final = 1 << 20


@dataclass(frozen=True)
class FingerIdentify:
    """Identify a finger's parameters from a log, with confidence intervals."""

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="LOG")]
    """The log, as `shapechanger finger record` writes it."""
    out: Path | None = None
    """File for the parameters, such as finger.json; finger envs accept it as `parameters`."""
    report: Path | None = None
    """The HTML page to write; by default next to the log."""
    geared: bool = False
    """Assume the geared servos of the shipped rig if the log does not describe its motors. Logs
    that `record` has written from a rig describe them."""

    def run(self) -> None:
        page = self.report or self.log.with_name(f"{self.log.stem}.html")
        files = [path for path in (self.out, page) if path is not None]
        for path in files:
            if path.resolve() == self.log.resolve():
                raise OutputError(f"Cannot write {path}: it is the log.")
        log = load_log(self.log)
        if self.geared and log.motors is None:
            log = dataclasses.replace(log, motors=shipped_rig())
        for path in files:
            require_file(path)
        found = identify(log, lambda text: say(f"{text} …", stderr=True))
        write_atomic(page, finger_html(found, self.log.name).encode())
        if self.out is not None:
            write_atomic(self.out, found.parameters.to_json().encode())
        cells = {e.name: arm_cell(e) for e in found.arms}
        arms = Table("moment arm [mm]", *JOINTS, box=None, pad_edge=False)
        for tendon in TENDONS:
            names = (f"moment_arms/{tendon}/{joint}" for joint in JOINTS)
            arms.add_row(tendon, *(cells.get(name, "") for name in names))
        print_table(arms)
        say("* the nominal arm is outside the 95 % interval\n")
        columns = ("parameter", "identified", "95 % interval", "nominal")
        others = Table(*columns, box=None, pad_edge=False)
        for e in found.estimates:
            if e not in found.arms:
                others.add_row(label(e), number(e, e.value), interval(e), number(e, e.nominal))
        print_table(others)
        for name, why in unknown(found):
            say(f"{name} is unknown: {why}")
        for name, why in found.undetermined:
            say(f"{name} cannot be determined: {why}")
        say(f"wrote {' and '.join(str(path) for path in files)}")
        say(summary_line(found))


@dataclass(frozen=True)
class FingerRecord:
    """Excite all joints of a finger and log the motion."""

    env: EnvId
    out: Path
    """The log to write, such as finger.npz."""
    seconds: float = 10.0
    """Duration, s."""
    seed: int = 0
    """Seed of the motions."""
    actions: str = "impedance"
    """Meaning of an action: impedance, tension or length."""
    gap: str = ""
    """Name of the gap (ranges of parameters) that the finger is drawn from, such as real-like;
    the nominal finger if not given."""
    finger_seed: int = 0
    """Seed of the finger drawn from the gap."""
    options: str = ""
    """More arguments of the env as JSON, such as '{"robot": "my-finger"}'."""

    def run(self) -> None:
        for seed in (self.seed, self.finger_seed):
            check_seed(seed, StudyError)
        if not 0.0 < self.seconds < float("inf"):
            raise FingerError(f"--seconds must be above 0, got {self.seconds}.")
        require_file(self.out)
        of_gap = {"gap": self.gap, "finger_seed": self.finger_seed} if self.gap else {}
        more = {"actions": self.actions, **of_gap, **options_of(self.options, "--options")}
        with opened(env_ref(self.env).having(more), max_episode_steps=-1) as env:
            log = record_babble(env, self.seconds, self.seed, self.actions)
        save_log(log, self.out)
        say(
            f"wrote {len(log)} rows, {log.seconds:g} s, to {self.out}\n"
            f"identify the finger: shapechanger finger identify {shlex.quote(str(self.out))}"
        )


@dataclass(frozen=True)
class FingerExport:
    """Export a finger as MJCF, which MuJoCo loads without Shapechanger."""

    out: Path
    """The file to write, such as finger.xml."""
    parameters: str = ""
    """File that `shapechanger finger identify --out` has written, or the name of a set, such as
    an-1983; the nominal finger if not given."""
    actions: str = "impedance"
    """Meaning of a control: impedance, tension or length."""
    gap: str = ""
    """Name of a gap (ranges of parameters) to draw the finger from, instead of --parameters."""
    finger_seed: int = 0
    """Seed of the finger drawn from the gap."""

    def run(self) -> None:
        import numpy as np

        check_seed(self.finger_seed, StudyError)
        require_file(self.out)
        if self.gap and self.parameters:
            raise FingerError("Give either --parameters or --gap, not both.")
        finger, path = NOMINAL, Path(self.parameters)
        if self.parameters in PARAMETER_SETS or (
            self.parameters and not (path.suffix or path.exists())
        ):
            finger = named_set(self.parameters)
        elif self.parameters:
            with reading(path, FingerError):
                finger = FingerParameters.from_json(read_file(path, _MOST_BYTES))
        elif self.gap:
            finger = resolve_gap(self.gap).draw(np.random.default_rng(self.finger_seed))
        text = finger_mjcf(finger, drive_of(self.actions, NOMINAL))
        write_atomic(self.out, text.encode())
        say(f"wrote {self.out}")
