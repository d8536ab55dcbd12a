"""A process's log on the bus."""

import logging
from collections.abc import Iterator

import pytest

from zteam import names
from zteam.bus import Bus, MemoryHub
from zteam.errors import EncodeError
from zteam.messages import Log, LogLevel
from zteam.node import log_client
from zteam.node.log_client import LogPublisher, line_of, message_of
from zteam.node.logs import LogKeeper, LogLine

LOGGER = logging.getLogger("somewhere")


@pytest.fixture
def keeper(monkeypatch: pytest.MonkeyPatch) -> Iterator[LogKeeper]:
    """The keeper that is published keeps the lines of this test alone."""
    made = LogKeeper()
    monkeypatch.setattr(log_client, "KEEPER", made)
    end = made.begin()
    yield made
    end()


def hear(hub: MemoryHub) -> list[tuple[str, Log]]:
    """What comes on all logs from here on."""
    heard: list[tuple[str, Log]] = []
    hub.bus().subscribe(names.log_key(), Log, lambda key, message: heard.append((key, message)))
    return heard


def ask(bus: Bus, name: str) -> list[str]:
    """The texts that a process keeps."""
    return [line.text for line in bus.ask(names.log_key(name), list[LogLine])]


@pytest.mark.usefixtures("keeper")
def test_lines_are_published_and_answered(hub: MemoryHub) -> None:
    """A subscriber gets new lines; the query has those from before the session as well."""
    LOGGER.warning("starting")
    LogPublisher(hub.bus(), "robot_1")
    heard = hear(hub)
    LOGGER.error("no plan")
    ((key, message),) = heard
    assert (key, message.name, message.level, message.msg) == ("robot_1/log", "robot_1", LogLevel.ERROR, "no plan")
    assert (message.file, message.function) == (__file__, "test_lines_are_published_and_answered")
    assert ask(hub.bus(), "robot_1") == ["starting", "no plan"]


def test_a_line_survives_the_way(keeper: LogKeeper, hub: MemoryHub) -> None:
    """A line that comes over the bus equals the one that the query has, so that readers know it again."""
    LogPublisher(hub.bus(), "robot_1")
    heard = hear(hub)
    LOGGER.warning("ä\nb")
    assert [line_of("robot_1", message) for _, message in heard] == keeper.kept("robot_1")
    assert hub.bus().ask("robot_1/log", list[LogLine]) == keeper.kept("robot_1")


@pytest.mark.usefixtures("keeper")
def test_without_subscribers_nothing_is_encoded(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """No message is made while no subscriber wants it."""
    LogPublisher(hub.bus(), "robot_1")
    made: list[LogLine] = []
    monkeypatch.setattr(log_client, "message_of", lambda name, line: made.append(line) or message_of(name, line))
    LOGGER.warning("unheard")
    assert made == []
    heard = hear(hub)
    LOGGER.warning("heard")
    assert len(made) == len(heard) == 1


@pytest.mark.usefixtures("keeper")
def test_a_subscriber_that_logs_does_not_loop(hub: MemoryHub) -> None:
    """A callback that logs each line that it gets, in the same process, gets no line about it."""
    bus = hub.bus()
    LogPublisher(bus, "robot_1")
    heard: list[str] = []

    def take(_key: str, message: Log) -> None:
        heard.append(message.msg)
        LOGGER.warning("got %s", message.msg)

    bus.subscribe("robot_1/log", Log, take)
    LOGGER.warning("one")
    assert heard == ["one"]
    assert ask(hub.bus(), "robot_1") == ["one", "got one"]


@pytest.mark.usefixtures("keeper")
def test_a_line_that_cannot_be_sent_is_kept(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """A failed publish neither reaches the code that logs nor makes a line of its own."""

    def fail(_name: str, _line: LogLine) -> Log:
        raise EncodeError("a stamp after the year 2038")

    LogPublisher(hub.bus(), "robot_1")
    hear(hub)
    monkeypatch.setattr(log_client, "message_of", fail)
    LOGGER.warning("one")
    assert ask(hub.bus(), "robot_1") == ["one"]


def test_after_the_end_nothing_is_sent(keeper: LogKeeper, hub: MemoryHub) -> None:
    """A line that is logged after the session's end is kept and harms nothing."""
    bus = hub.bus()
    publisher = LogPublisher(bus, "robot_1")
    heard = hear(hub)
    bus.close()
    LOGGER.warning("closed")
    publisher.close()
    LOGGER.warning("forgotten")
    assert heard == []
    assert [line.text for line in keeper.kept("robot_1")] == ["closed", "forgotten"]


@pytest.mark.usefixtures("keeper")
def test_a_subscriber_gets_the_start_of_a_process(hub: MemoryHub) -> None:
    """What was logged before the session is sent once to the subscribers that are there, and nothing is sent twice."""
    heard = hear(hub)
    LOGGER.warning("imported")
    publisher = LogPublisher(hub.bus(), "robot_1")
    LOGGER.warning("boot")
    assert [message.msg for _, message in heard] == ["boot"]
    publisher.catch_up()
    publisher.catch_up()
    LOGGER.warning("drives")
    assert [message.msg for _, message in heard] == ["boot", "imported", "drives"]


@pytest.mark.usefixtures("keeper")
def test_a_process_without_a_line_of_its_own_catches_up(hub: MemoryHub) -> None:
    """All lines of the start are sent in their order where none was sent before."""
    heard = hear(hub)
    LOGGER.warning("one")
    LOGGER.warning("two")
    LogPublisher(hub.bus(), "robot_1").catch_up()
    assert [message.msg for _, message in heard] == ["one", "two"]
