"""`shapechanger robot doctor`: diagnose a robot's set-up."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.errors import ShapechangerError

_MARKS = {"good": "good   ", "missing": "MISSING", "unknown": "?      "}


@dataclass(frozen=True)
class Doctor:
    """Check everything that a robot's safety and operation depend on, without moving it."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The robot's profile."""
    port: int = 5000
    """Port that it will be served at."""
    credentials: Path | None = None
    """Folder of its key and certificate, if not the one that `init` made."""

    def run(self) -> None:
        """Print the findings and exit with 1 if something is missing."""
        from shapechanger.cli.robot.serve import credentials_of
        from shapechanger.robot.profile.load import find_profile, load_profile
        from shapechanger.robot.setup.doctor import Finding, examine_robot

        profile = load_profile(find_profile(self.profile))
        console = plain_console()
        findings = [Finding("profile", "good", f"{profile.path} holds together.")]
        try:
            folder = credentials_of(profile.name, self.credentials, make=False).key_file.parent
            findings.append(Finding("credentials", "good", f"Key and certificate: {folder}."))
        except ShapechangerError as error:
            findings.append(Finding("credentials", "missing", str(error)))
        if profile.calibrated is None:
            sentence = f"Never calibrated: shapechanger robot calibrate {profile.path}"
            findings.append(Finding("calibration", "unknown", sentence))
        findings += examine_robot(
            profile.guard_plan(), profile.camera, self.port, profile=profile.path.absolute()
        )
        for finding in findings:
            console.print(
                f"{_MARKS[finding.level]}  {finding.check}: {finding.sentence}", soft_wrap=True
            )
        missing = sum(finding.level == "missing" for finding in findings)
        if missing:
            console.print(f"\n{missing} of {len(findings)} to mend.")
            sys.exit(1)
