"""Camera driver that replays a folder of JPEG files in a loop."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan, Frame, Pace
from shapechanger.robot.cameras.jpeg import checked_frame

_SUFFIXES: Final = (".jpg", ".jpeg")


class Folder:
    """Camera that replays the files of a folder in the order of their names; see `Camera`.

    Its setting is the folder, `path`.
    """

    def __init__(self, plan: CameraPlan) -> None:
        folder = Path(plan.settings["path"]).expanduser()
        try:
            self._files = sorted(
                file for file in folder.iterdir() if file.suffix.lower() in _SUFFIXES
            )
        except OSError as error:
            raise RobotError(f"The folder of pictures cannot be read: {error}.") from error
        if not self._files:
            raise RobotError(f"There is no .jpg or .jpeg file in {folder}.")
        self._plan = plan
        self._next = 0
        self._pace = Pace(plan.fps)

    def read(self) -> Frame:
        """Wait for the next frame; see `Camera.read`. A bad file is reported once, then skipped."""
        captured_ns = self._pace.wait()
        file = self._files[self._next]
        self._next = (self._next + 1) % len(self._files)
        try:
            return checked_frame(file.read_bytes(), captured_ns, self._plan)
        except (OSError, RobotError) as error:
            raise RobotError(f"{file}: {error}") from error

    def close(self) -> None:
        """Interrupt a waiting `read`."""
        self._pace.close()
