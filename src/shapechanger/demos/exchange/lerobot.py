"""LeRobot datasets, version 3."""

from shapechanger.demos.exchange.format import Format
from shapechanger.demos.exchange.lerobot_export import write_lerobot
from shapechanger.demos.exchange.lerobot_import import is_lerobot, read_lerobot

FORMAT = Format(
    name="lerobot",
    title="LeRobot",
    sign="meta/info.json",
    detect=is_lerobot,
    read=read_lerobot,
    write=lambda e, f, c: write_lerobot(e, f, task=c.task, images=c.images, rewarded=c.rewarded),
    options=frozenset({"camera", "task", "images"}),
    consecutive=True,
    timed=False,
)
