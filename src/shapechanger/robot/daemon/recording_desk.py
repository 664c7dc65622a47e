"""What one client wants of the recorder and of what was recorded: who may, and one at a time."""

from __future__ import annotations

from collections.abc import Callable

from shapechanger.link.messages import (
    Browse,
    Fetch,
    Judge,
    Mark,
    Piece,
    Record,
    Recordings,
    Refused,
    RobotMessage,
    Undo,
)
from shapechanger.robot.daemon.lease import Holder, LeaseDesk
from shapechanger.robot.daemon.library import Answer, Library
from shapechanger.robot.daemon.outbox import Outbox
from shapechanger.robot.daemon.printable import printable
from shapechanger.robot.daemon.recorder import Recorder

__all__ = ["RecordingDesk"]


class RecordingDesk:
    """Passes the wishes of one client on, if it may have them.

    Args:
        recorder: Records what is driven.
        library: Knows what was recorded.
        lease: Who commands.
        outbox: What the client is to be told.
        tell: Puts a message there.
    """

    def __init__(
        self,
        recorder: Recorder,
        library: Library,
        lease: LeaseDesk,
        outbox: Outbox,
        tell: Callable[[RobotMessage], None],
    ) -> None:
        self._recorder = recorder
        self._library = library
        self._lease = lease
        self._outbox = outbox
        self._tell = tell
        self._asking = False

    def hear(self, message: Record | Mark | Undo | Browse | Fetch | Judge, who: Holder) -> None:
        """Do what the client says, or tell it why not."""
        if not isinstance(message, Browse | Fetch) and who.role != "person":
            self._tell(Refused(reason="Only a person records on this robot, and judges that."))
            return
        match message:
            case Record():
                refusal = self._record(message, who)
            case Mark():
                refusal = self._recorder.mark(printable(message.text), self._tell)
            case Undo():
                refusal = self._recorder.undo(message.seconds, self._tell)
            case Browse() | Fetch() | Judge():
                refusal = self._ask(message)
        if refusal:
            self._tell(Refused(reason=refusal))

    def _record(self, message: Record, who: Holder) -> str:
        if not message.on:
            return self._recorder.end()
        held = self._lease.holder
        driver = "" if held is None else held.name
        return self._recorder.begin(who, printable(message.name), driver, self._tell)

    def _ask(self, question: Browse | Fetch | Judge) -> str:
        """Ask the library; an answer may be large, so the next question waits until it has left."""
        if self._asking or self._outbox.holds(Recordings, Piece):
            return "Ask one question about recordings at a time."
        self._asking = True
        self._library.ask(question, self._answered)
        return ""

    def _answered(self, answer: Answer) -> None:
        self._asking = False
        self._tell(answer)
