"""Reading the logs of a team."""

import math

import pytest

from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.clock import monotonic
from zteam.messages import Log, Time
from zteam.node.log_client import HOLD, LogReader
from zteam.node.logs import LogLine


class Talker:
    """A process with a log."""

    def __init__(self, hub: MemoryHub, name: str, *kept: str) -> None:
        self.name = name
        self.bus = hub.bus()
        self.kept = [LogLine(number, name, 20, text) for number, text in enumerate(kept, 1)]
        self._publisher = self.bus.publisher(names.log_key(name), Log)
        self.bus.serve(names.log_key(name), NoRequest, lambda _: self.kept)
        self.bus.declare_token(names.token_key(name, self.bus.instance))

    def say(self, time_ns: int, text: str, level: int = 20) -> None:
        """Log a line."""
        self.kept.append(LogLine(time_ns, self.name, level, text))
        self._publisher.put(Log(Time(0, time_ns), level, self.name, text))


def read(hub: MemoryHub, *patterns: str, level: int = 0) -> LogReader:
    """A reader that follows."""
    reader = LogReader(hub.bus(), patterns or ["*"], lambda: None, level)
    reader.follow()
    return reader


def texts(reader: LogReader) -> list[str]:
    """All that the reader has."""
    return [line.text for line in reader.ready(math.inf)]


def test_history_and_new_lines_are_one_log(hub: MemoryHub) -> None:
    """What the processes keep and what they log next come in order of time, each line once."""
    sim, robot = Talker(hub, "sim"), Talker(hub, "robot_0")
    sim.kept = [LogLine(1, "sim", 20, "a"), LogLine(5, "sim", 20, "c")]
    robot.kept = [LogLine(3, "robot_0", 20, "b")]
    reader = read(hub)
    robot.say(9, "d")
    assert reader.fetch() == {"sim", "robot_0"}
    assert reader.fetch_joined() == {"sim", "robot_0"}
    sim.say(8, "between")
    assert texts(reader) == ["a", "b", "c", "between", "d"]


def test_a_process_that_joins_tells_its_start(hub: MemoryHub) -> None:
    """The lines from before a process could publish come when it joins."""
    reader = read(hub)
    assert reader.fetch() == set()
    assert not reader.pending()
    late = Talker(hub, "robot_7", "starting")
    assert reader.pending()
    assert reader.fetch_joined() == {"robot_7"}
    assert reader.fetch_joined() == set()
    late.say(2, "ready")
    assert texts(reader) == ["starting", "ready"]


def test_many_that_join_are_asked_with_one_question(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """Any program may hold tokens, of any names."""
    bus = hub.bus()
    reader = LogReader(bus, ["*"], lambda: None)
    reader.follow()
    late = Talker(hub, "robot_7", "starting")
    for number in range(1000):
        late.bus.declare_token(names.token_key(f"z{number}", "a"))
    ask, asked = bus.transport.get, list[str]()
    monkeypatch.setattr(bus.transport, "get", lambda key, *rest: asked.append(key) or ask(key, *rest))
    assert reader.fetch_joined() == {"robot_7"}
    assert (len(asked), texts(reader)) == (1, ["starting"])


def test_patterns_choose_processes(hub: MemoryHub) -> None:
    """Lines and histories of other processes do not come."""
    talkers = [Talker(hub, name, f"{name} starts") for name in ("sim", "robot_0", "robot_1")]
    reader = read(hub, "robot_$*", "robot_0")
    assert reader.fetch() == {"robot_0", "robot_1"}
    for talker in talkers:
        talker.say(9, f"{talker.name} drives")
    assert sorted(texts(reader)) == ["robot_0 drives", "robot_0 starts", "robot_1 drives", "robot_1 starts"]


def test_lines_below_the_level_are_skipped(hub: MemoryHub) -> None:
    """The level holds for histories and for new lines."""
    robot = Talker(hub, "robot_0", "kept")
    reader = read(hub, level=30)
    reader.fetch()
    robot.say(2, "info")
    robot.say(3, "warning", 30)
    robot.say(4, "error", 40)
    assert texts(reader) == ["warning", "error"]


def test_the_key_tells_the_process(hub: MemoryHub) -> None:
    """A writer of another kind, such as a ROS 2 node, may put any name into its messages."""
    reader = read(hub)
    hub.bus().publisher("robot_3/log", Log).put(Log(Time(0, 1), 20, "talker.child", "hello"))
    (line,) = reader.ready(math.inf)
    assert (line.process, line.text) == ("robot_3", "hello")


def test_a_new_line_is_ready_after_a_while(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """A new line waits for older ones of other processes, and the reader tells how long."""
    start = monotonic()
    monkeypatch.setattr("zteam.node.log_client.monotonic", lambda: start)
    robot = Talker(hub, "robot_0")
    reader = read(hub)
    assert reader.left() == 0.0
    robot.say(1, "now")
    assert reader.left() == pytest.approx(HOLD)
    assert reader.ready() == []
    monkeypatch.setattr("zteam.node.log_client.monotonic", lambda: start + HOLD)
    assert [line.text for line in reader.ready()] == ["now"]


def test_news_wake_the_caller(hub: MemoryHub) -> None:
    """A line and a joining process each call `on_news`; a process that leaves does not."""
    calls: list[int] = []
    reader = LogReader(hub.bus(), ["*"], lambda: calls.append(1))
    reader.follow()
    robot = Talker(hub, "robot_0")
    assert len(calls) == 1
    robot.say(1, "hello")
    assert len(calls) == 2
    robot.bus.close()
    assert len(calls) == 2


def test_a_process_without_an_answer_does_not_stop_the_reader(hub: MemoryHub) -> None:
    """A query that fails leaves the name out; the others are read."""

    def fail(_request: NoRequest) -> None:
        raise ValueError("broken")

    hub.bus().serve(names.log_key("robot_0"), NoRequest, fail)
    Talker(hub, "sim", "a")
    reader = read(hub, "robot_0", "sim")
    assert reader.fetch() == {"sim"}
    assert texts(reader) == ["a"]
