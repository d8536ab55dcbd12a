"""The order of the lines of several processes."""

import math

import pytest

from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.errors import BusError
from zteam.node.log_client import LogOrder, LogReader, level_name
from zteam.node.logs import KEPT, LONGEST, LogLine


def line(time_ns: int, process: str = "sim", text: str = "x") -> LogLine:
    """A line of level info."""
    return LogLine(time_ns, process, 20, text)


def test_lines_of_several_processes_come_in_order_of_time() -> None:
    """Histories of different processes are merged by the time of their lines."""
    order = LogOrder(hold=0.2)
    order.take([line(1), line(4)], now=10.0)
    order.take([line(2, "tf"), line(3, "tf")], now=10.0)
    assert [found.time_ns for found in order.ready(math.inf)] == [1, 2, 3, 4]


def test_a_line_waits_for_older_ones_of_other_processes() -> None:
    """A new line is handed out after the hold, together with an older one that came after it."""
    order = LogOrder(hold=0.2)
    assert not order.waiting
    order.take([line(20)], now=10.0)
    assert order.waiting
    assert order.ready(10.1) == []
    order.take([line(10, "tf")], now=10.15)
    assert order.left(10.15) == pytest.approx(0.05)
    assert [found.time_ns for found in order.ready(10.2)] == [10, 20]
    assert not order.waiting
    assert order.left(10.2) == 0.0


def test_a_younger_line_goes_on_waiting() -> None:
    """When the first line is ready, a younger one that has not waited long enough stays."""
    order = LogOrder(hold=0.2)
    order.take([line(10)], now=10.0)
    order.take([line(30)], now=10.1)
    assert [found.time_ns for found in order.ready(10.2)] == [10]
    assert [found.time_ns for found in order.ready(10.4)] == [30]


def test_a_line_that_comes_too_late_is_not_lost() -> None:
    """A line that is older than one handed out before is handed out next."""
    order = LogOrder(hold=0.0)
    order.take([line(20)], now=1.0)
    assert [found.time_ns for found in order.ready(1.0)] == [20]
    order.take([line(10, "tf")], now=2.0)
    assert [found.time_ns for found in order.ready(2.0)] == [10]


def test_a_line_of_history_and_feed_is_handed_out_once() -> None:
    """A line that came live and comes again with a history is skipped, also after it was handed out."""
    order = LogOrder(hold=0.0)
    order.take([line(1)], now=1.0)
    order.take([line(1), line(2)], now=1.0)
    assert [found.time_ns for found in order.ready(1.0)] == [1, 2]
    order.take([line(1), line(2), line(3)], now=2.0)
    assert [found.time_ns for found in order.ready(2.0)] == [3]


def test_what_is_known_of_a_process_is_bounded() -> None:
    """After many lines a whole history is still known again, and the oldest line is forgotten."""
    order = LogOrder(hold=0.0)
    lines = [line(i) for i in range(100 * KEPT)]
    for found in lines:
        order.take([found], now=1.0)
    order.ready(1.0)
    order.take(lines[-KEPT:], now=2.0)
    assert order.ready(2.0) == []
    order.take(lines[:1], now=2.0)
    assert order.ready(2.0) == lines[:1]


@pytest.mark.parametrize(
    ("level", "name"),
    [(10, "debug"), (0, "debug"), (20, "info"), (25, "info"), (30, "warning"), (40, "error"), (50, "critical")],
)
def test_levels_have_pythons_names(level: int, name: str) -> None:
    """A level between two has the name of the lower one."""
    assert level_name(level) == name


def test_a_long_line_is_cut() -> None:
    """Of text, file and function, so that a sender cannot fill the reader's memory; equal lines stay equal."""
    order = LogOrder(hold=0.0)
    long = LogLine(1, "sim", 20, "x" * 10**6, "f" * 10**6, "g" * 10**6)
    order.take([long], now=1.0)
    order.take([long], now=1.0)
    (found,) = order.ready(1.0)
    assert found.text == "x" * LONGEST + "… (the line is longer)"
    assert (len(found.file), len(found.function)) == (LONGEST, LONGEST)


def test_invented_processes_are_forgotten() -> None:
    """Their lines are handed out, but the reader does not remember all of them."""
    order = LogOrder(hold=0.0)
    order.take([line(1, f"p{k}") for k in range(5000)], now=1.0)
    assert len(order.ready(1.0)) == 5000
    assert len(order._known) <= 1000


def test_a_line_is_of_the_process_whose_key_it_came_on(hub: MemoryHub) -> None:
    """Access control protects the key, not what is in an answer; numbers out of bounds make no line."""
    hub.bus().serve(names.log_key("robot_2"), NoRequest, lambda _: [line(1, "robot_0")])
    reader = LogReader(hub.bus(), ["*"], lambda: None)
    reader.fetch()
    assert [(found.process, found.time_ns) for found in reader.ready(math.inf)] == [("robot_2", 1)]
    for wrong in (line(2**63), line(-(2**63) - 1), LogLine(1, "robot_3", 256, "x")):
        hub.bus().serve(names.log_key("robot_3"), NoRequest, lambda _, wrong=wrong: [wrong])
    with pytest.raises(BusError, match="unreadable answer"):
        hub.bus().query(names.log_key("robot_3"), list[LogLine])
