"""A process's log: what it keeps, where its lines go, what is on the bus, and how readers put them in order."""

import json
import logging
import math
import os
import threading
from collections.abc import Iterator
from itertools import count

import pytest

from support.limits import LIMIT
from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.clock import monotonic
from zteam.errors import BusError, EncodeError
from zteam.messages import Log, LogLevel, Time
from zteam.node import log_client, logs
from zteam.node.log_client import HOLD, LogOrder, LogPublisher, LogReader, level_name, line_of, message_of
from zteam.node.logs import KEEPER, KEPT, LONGEST, MAX_TEXT, LogKeeper, LogLine, start_logging

LOGGER = logging.getLogger("somewhere.deep")


@pytest.fixture
def keeper(monkeypatch: pytest.MonkeyPatch) -> Iterator[LogKeeper]:
    """The process's keeper keeps the lines of this test, from a logger without any output."""
    monkeypatch.setattr(LOGGER, "propagate", False)
    monkeypatch.setattr(LOGGER, "handlers", [logging.NullHandler()])
    monkeypatch.setattr(LOGGER, "level", logging.INFO)
    made = LogKeeper()
    for module in (logs, log_client):
        monkeypatch.setattr(module, "KEEPER", made)
    end = made.begin()
    yield made
    end()


def texts(keeper: LogKeeper) -> list[str]:
    """The kept texts."""
    return [line.text for line in keeper.kept("p")]


# What is kept


def test_a_line_has_time_level_place_and_process(keeper: LogKeeper) -> None:
    """A kept line says when, where and by which process it was logged; what is below the logger's level is not kept."""
    LOGGER.debug("detail")
    LOGGER.warning("speed %.1f", 0.5)
    (line,) = keeper.kept("robot_1")
    assert (line.process, line.level, line.text) == ("robot_1", logging.WARNING, "speed 0.5")
    assert (line.file, line.function) == (__file__, "test_a_line_has_time_level_place_and_process")
    assert line.line > 0 and line.time_ns > 0


def test_the_newest_lines_are_kept(keeper: LogKeeper, monkeypatch: pytest.MonkeyPatch) -> None:
    """A long log costs bounded memory. Equal lines within one step of the host's clock can be told apart."""
    clock = count()
    monkeypatch.setattr("zteam.node.logs.wall_ns", lambda: next(clock) // 3)
    for number in range(KEPT + 5):
        LOGGER.info("%d", number)
    times = [line.time_ns for line in keeper.kept("p")]
    assert texts(keeper) == [str(number) for number in range(5, KEPT + 5)]
    assert times == sorted(set(times))


def test_any_record_makes_a_text_that_can_be_sent(
    keeper: LogKeeper, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The text of an exception ends with it, a huge text is cut, and what UTF-8 or a C string cannot carry is escaped.
    Python's own handler reports arguments that do not fit. A record of another process is not a line."""
    try:
        raise ValueError("out of plans")
    except ValueError:
        LOGGER.exception("failed")
    LOGGER.info("x" * (MAX_TEXT + 1))
    # Without handlers: pytest's own report cannot carry such a text.
    logging.getLogRecordFactory()(LOGGER.name, logging.INFO, __file__, 1, "ä \udcff \0", (), None)
    logging.makeLogRecord({"msg": "elsewhere"})
    monkeypatch.setattr(LOGGER, "handlers", [logging.StreamHandler()])
    LOGGER.info("speed %d", "fast")
    assert "Logging error" in capsys.readouterr().err
    failed, *others = texts(keeper)
    assert failed.startswith("failed\nTraceback") and failed.endswith("ValueError: out of plans")
    assert others == ["x" * MAX_TEXT + f"… ({MAX_TEXT + 1} characters)", r"ä \udcff \x00", "speed %d"]


def test_each_new_line_is_passed_on(keeper: LogKeeper) -> None:
    """In the thread that logs, until it is taken away. A sink may fail, and a line that it logs itself is kept and not
    passed on, so that there is an end."""
    passed: list[tuple[str, int]] = []

    def sink(line: LogLine) -> None:
        passed.append((line.text, threading.get_ident()))
        LOGGER.warning("cannot send %s", line.text)
        raise RuntimeError("no room")

    end = keeper.pass_to(sink)
    LOGGER.info("one")
    LOGGER.info("two")
    end()
    LOGGER.info("three")
    assert passed == [("one", threading.get_ident()), ("two", threading.get_ident())]
    assert texts(keeper) == ["one", "cannot send one", "two", "cannot send two", "three"]


def test_threads_log_together(keeper: LogKeeper) -> None:
    """Lines of several threads are all passed on, and kept in the order of their times. No lock is held while an
    argument's own code makes the text: it may wait for another thread that logs."""
    passed: list[LogLine] = []
    keeper.pass_to(passed.append)

    class Argument:
        def __str__(self) -> str:
            if passed:
                # pytest's own handler makes the text once more.
                return "argument"
            threads = [threading.Thread(target=lambda: [LOGGER.info("%d", i) for i in range(40)]) for _ in range(4)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join(LIMIT)
                assert not thread.is_alive()
            return "argument"

    LOGGER.info("%s", Argument())
    times = [line.time_ns for line in keeper.kept("p")]
    assert (len(passed), len(times), texts(keeper)[-1]) == (161, 161, "argument")
    assert times == sorted(times)


def test_the_last_of_several_ends_counts(keeper: LogKeeper) -> None:
    """Of two nodes in one program each keeps its lines when the other ends; after the last one they are forgotten, and
    Python makes its records as before. A wrapper of other code stays, and does no harm."""
    end_node = keeper.begin()
    LOGGER.info("one")
    end_node()
    LOGGER.info("two")
    assert texts(keeper) == ["one", "two"]
    before, other = logging.getLogRecordFactory(), LogKeeper()
    end = other.begin()
    LOGGER.info("three")
    end()
    assert (texts(other), logging.getLogRecordFactory()) == ([], before)
    end = other.begin()
    ours = logging.getLogRecordFactory()
    logging.setLogRecordFactory(lambda *a, **k: ours(*a, **k))
    end()
    other.begin()
    LOGGER.warning("once")
    assert texts(other) == ["once"]
    logging.setLogRecordFactory(before)


@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_a_forked_child_sends_nothing() -> None:
    """A forked child that logs neither uses its parent's session nor waits for a lock that a lost thread held."""
    passed: list[str] = []
    ends = KEEPER.begin(), KEEPER.pass_to(lambda line: passed.append(line.text))
    with KEEPER._lock:
        child = os.fork()
        if child == 0:
            logger = threading.Thread(target=LOGGER.warning, args=("child",), daemon=True)
            logger.start()
            logger.join(LIMIT)
            os._exit(len(passed) + 2 * logger.is_alive())
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    LOGGER.warning("parent")
    for end in ends:
        end()
    assert passed == ["parent"]


# Where the log of a command goes


@pytest.fixture
def command() -> Iterator[None]:
    """What a command sets up comes back after the test: loggers, and how records are made."""
    factory, changed = logging.getLogRecordFactory(), [logging.getLogger(name) for name in ("zteam", "", "PIL")]
    before = [(log, log.level, [*log.handlers], log.propagate) for log in changed]
    yield
    logging.setLogRecordFactory(factory)
    for log, level, handlers, propagate in before:
        log.setLevel(level)
        log.handlers, log.propagate = handlers, propagate


@pytest.mark.usefixtures("command")
def test_a_users_module_logs_like_zteam(keeper: LogKeeper, capsys: pytest.CaptureFixture[str]) -> None:
    """Its logger and zteam's write one line an event to stderr, from the same level up, under the last name; the
    handlers of other code stay, and a library that reads pictures shows no debug lines. Lines are kept from here on."""
    other = logging.NullHandler()
    logging.getLogger().addHandler(other)
    start_logging("robot_1", "info")
    for name in ("zteam", "my_behavior"):
        logging.getLogger(name).info("turns")
        logging.getLogger(name).debug("unseen")
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition(" ")[2] for line in lines] == ["[robot_1] turns"] * 2
    assert texts(keeper) == ["turns", "turns"]
    start_logging("two", "debug", "json")
    for name in ("my_behavior", "PIL.PngImagePlugin"):
        logging.getLogger(name).debug("turns")
    (line,) = capsys.readouterr().err.splitlines()
    assert json.loads(line)["process"] == "two"
    assert other in logging.getLogger().handlers


# The log on the bus


def hear(hub: MemoryHub) -> list[tuple[str, Log]]:
    """What comes on all logs from here on."""
    heard: list[tuple[str, Log]] = []
    hub.bus().subscribe(names.log_key("*"), Log, lambda key, message: heard.append((key, message)))
    return heard


def test_lines_are_published_and_answered(hub: MemoryHub, keeper: LogKeeper, monkeypatch: pytest.MonkeyPatch) -> None:
    """A subscriber gets new lines; the query has those from before the session as well, equal to those that come over
    the bus. Without subscribers no message is made, and after the session's end a line is only kept."""
    made: list[LogLine] = []
    monkeypatch.setattr(log_client, "message_of", lambda name, line: made.append(line) or message_of(name, line))
    LOGGER.warning("starting")
    bus = hub.bus()
    publisher = LogPublisher(bus, "robot_1")
    LOGGER.warning("unheard")
    heard = hear(hub)
    LOGGER.error("ä\nb")
    ((key, message),) = heard
    assert (key, message.name, message.level, message.msg) == ("robot_1/log", "robot_1", LogLevel.ERROR, "ä\nb")
    assert (message.file, message.function) == (__file__, "test_lines_are_published_and_answered")
    kept = keeper.kept("robot_1")
    assert hub.bus().ask("robot_1/log", list[LogLine]) == kept
    assert (line_of("robot_1", message), len(made)) == (kept[-1], 1)
    bus.close()
    LOGGER.warning("closed")
    publisher.close()
    LOGGER.warning("forgotten")
    assert (len(heard), texts(keeper)[-2:]) == (1, ["closed", "forgotten"])


@pytest.mark.usefixtures("keeper")
@pytest.mark.parametrize("logged", [["boot"], []])
def test_a_subscriber_gets_the_start_of_a_process(hub: MemoryHub, logged: list[str]) -> None:
    """What was logged before the session is sent once, in its order, and nothing is sent twice."""
    heard = hear(hub)
    for text in ("imported", "ready"):
        LOGGER.warning(text)
    publisher = LogPublisher(hub.bus(), "robot_1")
    for text in logged:
        LOGGER.warning(text)
    for _ in range(2):
        publisher.catch_up()
    LOGGER.warning("drives")
    assert [message.msg for _, message in heard] == [*logged, "imported", "ready", "drives"]


@pytest.mark.parametrize("fails", [False, True])
def test_a_line_about_a_line_is_not_sent(
    hub: MemoryHub, keeper: LogKeeper, monkeypatch: pytest.MonkeyPatch, fails: bool
) -> None:
    """A subscriber in the same process that logs each line that it gets, gets no line about it; a failed publish
    neither reaches the code that logs nor makes a line of its own."""
    bus, heard = hub.bus(), list[str]()
    LogPublisher(bus, "robot_1")

    def fail(_name: str, _line: LogLine) -> Log:
        raise EncodeError("a stamp after the year 2038")

    def take(_key: str, message: Log) -> None:
        heard.append(message.msg)
        LOGGER.warning("got %s", message.msg)

    bus.subscribe("robot_1/log", Log, take)
    if fails:
        monkeypatch.setattr(log_client, "message_of", fail)
    LOGGER.warning("one")
    assert heard == ([] if fails else ["one"])
    assert texts(keeper) == (["one"] if fails else ["one", "got one"])


# The logs of several processes


def line(time_ns: int, process: str = "sim") -> LogLine:
    """A line of level info."""
    return LogLine(time_ns, process, 20, "x")


def test_lines_come_in_order_of_time() -> None:
    """A new line is handed out after the hold, together with an older one that came after it. A younger one goes on
    waiting, and one that is older than what was handed out before comes next."""
    order = LogOrder(hold=0.2)
    order.take([line(20)], now=10.0)
    assert (order.waiting, order.ready(10.1)) == (True, [])
    order.take([line(10, "tf"), line(30)], now=10.15)
    assert order.left(10.15) == pytest.approx(0.05)
    assert order.ready(10.2) == [line(10, "tf"), line(20)]
    order.take([line(5)], now=10.2)
    assert order.ready(10.4) == [line(5), line(30)]
    assert (order.waiting, order.left(10.4)) == (False, 0.0)


def test_what_is_known_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line is handed out once, live or in a history, and the oldest line of a process is forgotten, not one of
    another process. Long lines are cut, and equal ones stay equal."""
    monkeypatch.setattr(log_client, "_REMEMBERED", 3 * KEPT)
    order, lines = LogOrder(hold=0.0), [line(i) for i in range(4 * KEPT)]
    order.take([line(0, "tf"), *lines], now=1.0)
    assert order.ready(1.0) == [line(0, "tf"), *lines]
    order.take([line(0, "tf")], now=1.0)
    assert order.ready(1.0) == []
    order.take(lines[-KEPT:], now=2.0)
    assert order.ready(2.0) == []
    order.take(lines[:1], now=2.0)
    assert order.ready(2.0) == lines[:1]
    for _ in range(2):
        order.take([LogLine(1, "sim", 20, "x" * 10**6, "f" * 10**6, "g" * 10**6)], now=4.0)
    (found,) = order.ready(4.0)
    assert found.text == "x" * LONGEST + "… (the line is longer)"
    assert (len(found.file), len(found.function)) == (LONGEST, LONGEST)


@pytest.mark.parametrize(
    ("level", "name"), [(0, "debug"), (10, "debug"), (25, "info"), (30, "warning"), (40, "error"), (60, "critical")]
)
def test_levels_have_pythons_names(level: int, name: str) -> None:
    """A level between two has the name of the lower one."""
    assert level_name(level) == name


class Talker:
    """A process with a log."""

    def __init__(self, hub: MemoryHub, name: str, *kept: LogLine) -> None:
        self.name, self.bus, self.kept = name, hub.bus(), [*kept]
        self._publisher = self.bus.publisher(names.log_key(name), Log)
        self.bus.serve(names.log_key(name), NoRequest, lambda _: self.kept)
        self.bus.declare_token(names.token_key(name, self.bus.instance))

    def say(self, time_ns: int, text: str, level: int = 20) -> None:
        """Log a line; a ROS 2 node may put any name into its message."""
        self.kept.append(LogLine(time_ns, self.name, level, text))
        self._publisher.put(Log(Time(0, time_ns), level, "talker.child", text))


def read(hub: MemoryHub, *patterns: str, level: int = 0) -> LogReader:
    """A reader that follows."""
    reader = LogReader(hub.bus(), patterns or ["*"], lambda: None, level)
    reader.follow()
    return reader


def found_by(reader: LogReader) -> list[tuple[str, str]]:
    """Process and text of all that the reader has."""
    return [(line.process, line.text) for line in reader.ready(math.inf)]


def test_history_and_new_lines_are_one_log(hub: MemoryHub) -> None:
    """What the processes keep and what they log next come in order of time, each line once, from the level up; a
    process that joins adds its start. A process whose query fails does not stop the reader."""
    kept = [LogLine(1, "sim", 30, "a"), LogLine(2, "sim", 20, "low"), LogLine(5, "sim", 30, "c")]
    sim, robot = Talker(hub, "sim", *kept), Talker(hub, "robot_0", LogLine(3, "robot_0", 40, "b"))
    hub.bus().serve(names.log_key("tf"), NoRequest, lambda _: math.inf)
    reader = read(hub, "sim", "robot_$*", "tf", level=30)
    robot.say(9, "d", 30)
    robot.say(9, "low", 20)
    assert reader.fetch() == {"sim", "robot_0"}
    reader.fetch_joined()
    assert reader.pending()
    late, _ = Talker(hub, "robot_7", LogLine(4, "robot_7", 30, "late")), Talker(hub, "planner", line(1, "planner"))
    assert (reader.fetch_joined(), reader.fetch_joined()) == ({"robot_7"}, set())
    sim.say(8, "between", 30)
    late.say(10, "e", 30)
    assert found_by(reader) == [
        ("sim", "a"), ("robot_0", "b"), ("robot_7", "late"), ("sim", "c"), ("sim", "between"), ("robot_0", "d"),
        ("robot_7", "e"),
    ]  # fmt: skip
    assert not reader.pending()


def test_many_that_join_are_asked_with_one_question(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """Any program may hold tokens, of any names."""
    reader = read(hub)
    late = Talker(hub, "robot_7", LogLine(1, "robot_7", 20, "starting"))
    for number in range(20):
        late.bus.declare_token(names.token_key(f"z{number}", "a"))
    transport, asked = reader._bus.transport, list[str]()
    ask = transport.get
    monkeypatch.setattr(transport, "get", lambda key, *rest: asked.append(key) or ask(key, *rest))
    assert reader.fetch_joined() == {"robot_7"}
    assert (len(asked), found_by(reader)) == (1, [("robot_7", "starting")])


def test_a_line_is_of_the_process_whose_key_it_came_on(hub: MemoryHub) -> None:
    """Access control protects the key, not what is in an answer; numbers out of bounds make no line."""
    Talker(hub, "robot_2", line(1, "robot_0"))
    reader = read(hub)
    reader.fetch()
    assert found_by(reader) == [("robot_2", "x")]
    for wrong in (line(2**63), line(-(2**63) - 1), LogLine(1, "robot_3", 256, "x")):
        hub.bus().serve(names.log_key("robot_3"), NoRequest, lambda _, wrong=wrong: [wrong])
    with pytest.raises(BusError):
        hub.bus().query(names.log_key("robot_3"), list[LogLine])


def test_a_new_line_wakes_the_caller_and_is_ready_after_a_while(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A line and a joining process each call `on_news`; a process that leaves does not."""
    start, calls = monotonic(), list[int]()
    monkeypatch.setattr("zteam.node.log_client.monotonic", lambda: start)
    reader = LogReader(hub.bus(), ["*"], lambda: calls.append(1))
    reader.follow()
    assert reader.left(start) == 0.0
    robot = Talker(hub, "robot_0")
    robot.say(1, "now")
    robot.bus.close()
    assert len(calls) == 2
    assert (reader.left(start), reader.ready(start)) == (pytest.approx(HOLD), [])
    assert [line.text for line in reader.ready(start + HOLD)] == ["now"]
