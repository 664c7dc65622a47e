"""`shapechanger demos evaluate`: how well a policy does what a driver did."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from shapechanger.cli.console import plain_console
from shapechanger.cli.demos.train import Shrinking, print_judgement

__all__ = ["Evaluate"]


@dataclass(frozen=True)
class Evaluate:
    """Compare what a policy does with what a driver did; the last line is the accuracy."""

    policy: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="POLICY")]
    """A policy that `demos train` or `train` wrote."""
    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """A recording, one episode of it, or anything that `demos import` reads."""
    report: Path | None = None
    """A page to write, with the worst frames as pictures; the numbers come beside it as JSON."""

    def run(self) -> None:
        """Judge, and print."""
        from shapechanger.demos.cloning.judge import judge
        from shapechanger.demos.cloning.policy import CameraPolicy
        from shapechanger.demos.dataset import load_dataset

        policy = CameraPolicy.load(self.policy)
        shrinking = Shrinking(policy.card.framing)
        data = load_dataset(self.data, shrink=shrinking)
        console = plain_console()
        judgement = judge(policy, data)
        told = f"These are the {len(data)} steps of {self.data}."
        learned = policy.card.data.get("learned", 0)
        if policy.card.data.get("digest") == shrinking.digest(data.actions):
            told = f"The policy learned from the first {learned} of these {len(data)} steps."
            if learned < len(data):
                unseen = judge(policy, data, np.arange(len(data)) >= learned)
                told += f" On the others its accuracy is {unseen.accuracy:.3f}."
            console.print(told, soft_wrap=True)
        if self.report is not None:
            from shapechanger.reports.clone import write_clone_report, write_numbers
            from shapechanger.transfer.files import make_folder

            make_folder(self.report.parent)
            name = self.policy.name
            write_clone_report(self.report, name, policy, data, judgement, None, told)
            numbers = self.report.with_suffix(".json")
            write_numbers(numbers, policy, judgement, None)
            console.print(f"wrote {self.report} and {numbers}", soft_wrap=True)
        print_judgement(console, judgement)
