"""What a tick sends, and in which order."""

from collections.abc import Iterator

import pytest

from support.simulator_parts import SimulatorParts
from zteam import names
from zteam.bus import MemoryHub
from zteam.messages import Bool, Clock, LaserScan, Odometry, TFMessage, encode


@pytest.fixture
def parts(hub: MemoryHub) -> Iterator[SimulatorParts]:
    """A simulator without a main loop."""
    made = SimulatorParts(hub)
    yield made
    made.close()


@pytest.fixture
def sent(hub: MemoryHub, parts: SimulatorParts) -> list[str]:
    """The topics that robot 0 and the clock publish, in order."""
    topics: list[str] = []
    for topic, kind in (
        (names.TF, TFMessage),
        (names.ODOM, Odometry),
        (names.BASE_SCAN, LaserScan),
        (names.STALL, Bool),
    ):
        hub.bus().subscribe(names.robot_key(0, topic), kind, lambda _key, _message, topic=topic: topics.append(topic))
    hub.bus().subscribe(names.CLOCK, Clock, lambda key, _: topics.append(key))
    return topics


def test_the_clock_comes_after_what_robots_need(parts: SimulatorParts, sent: list[str]) -> None:
    """Transforms first, then odometry and scan; the clock and the rest wake processes that can wait."""
    parts.whole_tick()
    sent.clear()
    parts.whole_tick()
    assert sent == [names.TF, names.ODOM, names.BASE_SCAN, names.CLOCK, names.STALL]


def test_the_first_tick_begins_with_the_clock(parts: SimulatorParts, sent: list[str]) -> None:
    """Processes that knew an earlier simulator see time jump back before the data; after a reset again."""
    parts.whole_tick()
    assert sent == [names.CLOCK, names.TF, names.ODOM, names.BASE_SCAN, names.STALL]
    parts.reset()
    sent.clear()
    parts.whole_tick()
    assert sent[0] == names.CLOCK


def test_a_repeat_has_no_clock(parts: SimulatorParts, sent: list[str]) -> None:
    """The last tick's data are sent again; time does not go on."""
    parts.whole_tick()
    sent.clear()
    parts.repeat()
    assert sent == [names.TF, names.ODOM, names.BASE_SCAN, names.STALL]


@pytest.mark.parametrize(
    ("missing", "expected"),
    [(["robot_0"], [names.TF, names.ODOM, names.BASE_SCAN]), (["robot_1"], [])],
)
def test_a_repeat_for_robots_has_their_inputs_alone(
    parts: SimulatorParts, sent: list[str], missing: list[str], expected: list[str]
) -> None:
    """A robot that has answered receives nothing again."""
    parts.whole_tick()
    sent.clear()
    parts.repeat_for(missing)
    assert sent == expected


def test_a_repeat_for_another_process_has_everything(parts: SimulatorParts, sent: list[str]) -> None:
    """The inputs that it needs are not known."""
    parts.whole_tick()
    sent.clear()
    parts.repeat_for(["robot_1", "planner"])
    assert sent == [names.TF, names.ODOM, names.BASE_SCAN, names.STALL]


def test_the_scans_of_the_last_tick_can_be_asked_for(hub: MemoryHub, parts: SimulatorParts) -> None:
    """They are those that are sent, also without a subscriber; a robot that is not there has none."""
    assert parts.scans([0]).scans == []
    parts.whole_tick()
    assert [scan.key for scan in parts.scans([0, 7]).scans] == [names.scan_key(0, 0)]
    heard: list[LaserScan] = []
    hub.bus().subscribe(names.scan_key(0, 0), LaserScan, lambda _key, scan: heard.append(scan))
    parts.whole_tick()
    [asked] = parts.scans([0]).scans
    assert asked.content == encode(heard[-1])
