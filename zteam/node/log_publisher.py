"""The log of a process on the bus."""

from zteam import names
from zteam.bus import Bus, NoRequest
from zteam.messages import Log, time_from_ns
from zteam.node.log_client import LogLine
from zteam.node.logs import KEEPER


class LogPublisher:
    """The log of this process on the bus: `<name>/log` carries new lines, and the query of that key the newest ones."""

    def __init__(self, bus: Bus, name: str) -> None:
        self._name = name
        self._publisher = bus.publisher(names.log_key(name), Log)
        self._first_sent: int | None = None
        """Stamp of the first line that was sent, ns."""
        self._caught_up = False
        self._server = bus.serve(names.log_key(name), NoRequest, lambda _: KEEPER.kept(name))
        self._forget = KEEPER.pass_to(self._send)

    def close(self) -> None:
        """Publish and answer nothing more; also after the end of the session."""
        self._forget()
        self._server.close()
        self._publisher.close()

    def catch_up(self) -> None:
        """Send the lines from before the first one that was sent, to the subscribers that are there; once.

        A process that ends soon after its start may be gone before a reader asks it.
        """
        if self._caught_up:
            return
        self._caught_up = True
        first = self._first_sent
        for line in KEEPER.kept(self._name):
            if first is None or line.time_ns < first:
                self._send(line)

    def _send(self, line: LogLine) -> None:
        if line.process in ("", self._name) and self._publisher.has_subscribers:
            self._first_sent = self._first_sent or line.time_ns
            self._publisher.put(message_of(self._name, line))


def message_of(process: str, line: LogLine) -> Log:
    """The message of a line; its stamp is the host's time."""
    return Log(time_from_ns(line.time_ns), line.level, process, line.text, line.file, line.function, line.line)
