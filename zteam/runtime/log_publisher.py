"""The log of this process on the bus: `<name>/log` carries each new line, and the query of that key the newest ones."""

from collections.abc import Callable

from zteam import names
from zteam.bus import Bus, NoRequest
from zteam.messages import Log, time_from_ns
from zteam.runtime.log_keeper import KEEPER
from zteam.services.log_lines import LogLine


def publish_log(bus: Bus, name: str) -> Callable[[], None]:
    """Publish this process's log under `name` until the bus is closed; returns a function that forgets the bus."""
    key = names.log_key(name)
    publisher = bus.publisher(key, Log)

    def send(line: LogLine) -> None:
        if publisher.has_subscribers:
            publisher.put(message_of(name, line))

    bus.serve(key, NoRequest, lambda _: KEEPER.kept(name))
    return KEEPER.pass_to(send)


def message_of(process: str, line: LogLine) -> Log:
    """The message of a line; its stamp is the host's time."""
    return Log(time_from_ns(line.time_ns), line.level, process, line.text, line.file, line.function, line.line)
