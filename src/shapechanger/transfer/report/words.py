"""What the measures are called, and what each of them says, in one line."""

from __future__ import annotations

from typing import Final

__all__ = [
    "ASYMPTOTIC_GAIN",
    "AUC_RATIO",
    "EXPLANATIONS",
    "FORWARD_TRANSFER",
    "JUMPSTART",
    "PURE_NUMBER",
    "TIME_TO_THRESHOLD",
    "TOTAL_REWARD_GAIN",
]

JUMPSTART: Final = "Jumpstart"
TOTAL_REWARD_GAIN: Final = "Total reward gain"
ASYMPTOTIC_GAIN: Final = "Asymptotic gain"
AUC_RATIO: Final = "auc_ratio"
FORWARD_TRANSFER: Final = "Forward transfer"
TIME_TO_THRESHOLD: Final = "Time to threshold"

PURE_NUMBER: Final = "pure number"

_TAYLOR_STONE: Final = "Taylor & Stone, JMLR 10, 2009"

EXPLANATIONS: Final[dict[str, str]] = {
    JUMPSTART: "How much better the arm is than scratch at its first evaluation on the target; in "
    "total steps, than scratch after as many steps as the source has cost. Above 0: transfer "
    f"helped. ({_TAYLOR_STONE})",
    TOTAL_REWARD_GAIN: "How much higher the arm's learning curve lies than that of scratch, on "
    f"average over the whole budget. Above 0: transfer helped. ({_TAYLOR_STONE}, divided by the "
    "budget)",
    ASYMPTOTIC_GAIN: "How much better the arm is at the end of the budget. Above 0: transfer "
    f"helped. ({_TAYLOR_STONE})",
    AUC_RATIO: "Area under the arm's learning curve over that of scratch, both in scores. Above 1: "
    f"transfer helped. ({_TAYLOR_STONE}, who call it the transfer ratio)",
    FORWARD_TRANSFER: "The share of the area between scratch's curve and the score 1 that the arm "
    "wins, with scores cut off at 0 and 1. At most 1; above 0: transfer helped. (Wołczyk et al., "
    "Continual World, NeurIPS 2021)",
    TIME_TO_THRESHOLD: "How many steps sooner than scratch the arm reaches a score for the first "
    "time. Runs that never do count with the whole budget, none is dropped. Above 0: transfer "
    f"helped. ({_TAYLOR_STONE}; Royston & Parmar, BMC Med. Res. Methodol. 13, 2013)",
}
