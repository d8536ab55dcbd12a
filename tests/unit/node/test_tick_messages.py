"""When a message counts in lock-step."""

from functools import partial
from random import Random
from typing import Any

import pytest
from hypothesis import given

from support.arrivals import TICK, TICKS, Data, Opened, Sent, arrive, orders, sent_messages
from zteam.messages import Header, Point, Pose, PoseStamped, Twist, time_from_ns
from zteam.node.tick_messages import MAX_AHEAD, MOST, MOST_OF_KEY, HeldMessage, TickMessages, stamp_of, tick_of

SCAN = "robot_0/base_scan"
Handled = list[tuple[int, str, float]]
"""Tick (0 = none was open), key and content of what was handled, in order."""


def pose(stamp: int, value: float = 0.0) -> PoseStamped:
    """A message with a stamp (ns)."""
    return PoseStamped(Header(time_from_ns(stamp)), Pose(Point(value)))


def handle_all(sent: list[Sent], random: Random) -> Handled:
    """What a node handles to which these messages come, which others send, and a scan in each tick."""
    messages, handled = TickMessages(), Handled()
    sessions = random.sample(["a", "b", "c"], 3)
    opened = (TICKS[0] - 1) * TICK

    def handle(key: str, message: PoseStamped, _tick: int) -> None:
        handled.append((opened // TICK, key, message.pose.position.x))

    for event in arrive(sent, random):
        if isinstance(event, Opened):
            opened = event.tick * TICK
            messages.handle_due(opened)
        elif isinstance(event, Data):
            # A tick that is not answered is sent again with its data.
            for _ in range(2):
                scan = HeldMessage(0, SCAN, pose(event.tick * TICK), "sim", True, None, handle)
                messages.take(scan, opened, is_open=False)
        else:
            key, message = f"topic_{event.topic}", pose(event.stamp_ns, event.value)
            arrival = HeldMessage(1, key, message, sessions[event.source], False, None, handle)
            messages.take(arrival, opened, is_open=random.random() < 0.5)
    return handled


@given(sent_messages(topics=2), orders())
def test_the_order_of_arrival_changes_nothing(sent: list[Sent], ways: list[Random]) -> None:
    """The same messages of three senders in two orders are handled in the same ticks and in the same order."""
    first, second = (handle_all(sent, random) for random in ways)
    assert first == second
    assert len(first) == len(sent) + len(TICKS)


@given(sent_messages(topics=2, sources=1), orders())
def test_each_message_is_handled_in_the_next_tick(sent: list[Sent], ways: list[Random]) -> None:
    """Those of one sender are handled in the tick after the one in which they were sent, in the order of each key."""
    timely = [s for s in sent if s.stamp != "later"]
    handled = [entry for entry in handle_all(timely, ways[0]) if entry[1] != SCAN]
    for topic in (0, 1):
        mine = [(tick, value) for tick, key, value in handled if key == f"topic_{topic}"]
        assert mine == [(s.tick + 1, s.value) for s in timely if s.topic == topic]


def _keep(kept: dict[str, Any], key: str, message: PoseStamped, _tick: int) -> None:
    kept[key] = message


def test_of_two_senders_the_one_that_counts_is_handled_last() -> None:
    """A callback that keeps the newest message keeps the same one as a robot would, whichever came first."""
    for first, second in (("a", "b"), ("b", "a")):
        messages, kept = TickMessages(), dict[str, Any]()
        for source in (first, second):
            stamp = TICK if source == "a" else 2 * TICK
            arrival = HeldMessage(1, "goal", pose(stamp), source, False, None, partial(_keep, kept))
            messages.take(arrival, 2 * TICK, is_open=True)
        messages.handle_due(3 * TICK)
        assert kept == {"goal": pose(2 * TICK)}


def test_after_the_last_tick_all_is_handled() -> None:
    """Without ticks nothing waits for one."""
    messages, kept = TickMessages(), list[str]()
    for told, due in (("a", None), ("a of a tick", 2 * TICK)):
        arrival = HeldMessage(1, told, pose(TICK), "", False, due, lambda told, *_: kept.append(told))
        messages.take(arrival, TICK, is_open=True)
    messages.handle_due(None)
    assert kept == ["a", "a of a tick"]


def test_what_a_step_waits_for_is_handled_in_its_tick() -> None:
    """At once while that tick is open, with it if it comes first."""
    messages, kept = TickMessages(), list[int]()

    def take(due: int | None, stamp: int) -> str:
        arrival = HeldMessage(
            1, "path", pose(due or 0), "planner", False, due, lambda _, path, __: kept.append(stamp_of(path))
        )
        return messages.take(arrival, stamp, is_open=True)

    take(2 * TICK, TICK)
    assert kept == []
    messages.handle_due(2 * TICK)
    take(2 * TICK, 2 * TICK)
    assert kept == [2 * TICK] * 2


class Waiting:
    """The messages that a node keeps, tick 2 being open, and what it has handled of them."""

    def __init__(self) -> None:
        self.messages, self.handled, self._open = TickMessages(), list[str](), 2 * TICK

    def take(self, key: str, stamp: int = 0, due: int | None = None, source: str = "a", data: bool = False) -> str:
        """A message comes; why it is dropped."""
        handle = lambda told, *_: self.handled.append(told)  # noqa: E731
        arrival = HeldMessage(1, key, pose(stamp), source, data, due, handle)
        return self.messages.take(arrival, self._open, is_open=True)

    def next(self) -> list[str]:
        """What is handled in the next tick."""
        self.handled.clear()
        self._open += TICK
        self.messages.handle_due(self._open)
        return self.handled


@pytest.mark.parametrize("key", [SCAN, "robot_2/status"])
@pytest.mark.parametrize("stamp", [3 * TICK, 2 * TICK + MAX_AHEAD, 2**31 * 10**9])
def test_data_of_a_far_tick_delays_no_message_for_good(key: str, stamp: int) -> None:
    """Whoever sends it with the simulator's id, on whatever key: what others send after the next tick is handled in the
    tick after it. On a key that is not the simulator's it delays nothing at all."""
    waiting = Waiting()
    waiting.take(key, stamp, data=True)
    waiting.take("robot_1/status")
    assert waiting.next() == ([] if key == SCAN and stamp <= 2 * TICK + MAX_AHEAD else ["robot_1/status"])
    waiting.take("robot_0/status")
    assert "robot_0/status" in waiting.next()


@pytest.mark.few(1)
@pytest.mark.parametrize("due", [None, 3 * TICK])
def test_one_key_does_not_keep_out_the_others(due: int | None) -> None:
    """A node that hears no tick keeps so many messages of a key, and those of other keys besides, MOST in all; when
    they are handled, there is room again. One session after the other may send them."""
    waiting = Waiting()
    problems = [waiting.take("near/distance", 0, due, str(i)) for i in range(MOST_OF_KEY + 1)]
    assert [bool(problem) for problem in problems] == [False] * MOST_OF_KEY + [True]
    keys = [f"near/{i % 20}" for i in range(20 * MOST_OF_KEY)]
    assert sum(not waiting.take(key, 0, due) for key in keys) == MOST - MOST_OF_KEY
    assert len(waiting.next()) == MOST
    assert not waiting.take("near/distance", 0, due)
    assert not (waiting.messages._ticks.keys() - {("a", "near/distance")})


def test_what_a_step_would_wait_for_in_a_far_tick_is_refused() -> None:
    """It would stay for ever: ten thousand of them leave room for all others."""
    waiting = Waiting()
    far = 2 * TICK + MAX_AHEAD + 1
    assert {waiting.take("near/distance", far, far) for _ in range(MOST)} == {"its stamp is far ahead of the open tick"}
    assert not waiting.take("robot_1/status")


def test_a_stamp_tells_the_tick_also_before_that_tick_comes() -> None:
    """A message that overtakes its own tick belongs to that tick, not to the one that is open when it comes."""
    assert tick_of(pose(3 * TICK), 3 * TICK) == 3 * TICK
    assert tick_of(pose(3 * TICK), 2 * TICK) == 3 * TICK


def test_what_tells_no_tick_counts_by_its_arrival() -> None:
    """A message without a header, without a stamp, with an old one or with one of another clock is of the open tick."""
    late, wall = pose(TICK), pose(3 * TICK + MAX_AHEAD + 1)
    assert [tick_of(message, 3 * TICK) for message in (Twist(), PoseStamped(), late, wall)] == [3 * TICK] * 4


def test_a_robot_takes_the_last_message_of_each_tick() -> None:
    """The message of the tick before stays until its step; of two of one tick the last one counts, and none waits that
    another has replaced."""
    messages, taken = TickMessages(), list[tuple[float, int]]()

    def hold(stamp: int, value: float) -> None:
        take = lambda _, sent, tick: taken.append((sent.pose.position.x, tick))  # noqa: E731
        messages.hold(HeldMessage(1, "goal", pose(stamp, value), "a", False, None, take, newest_only=True), 2 * TICK)

    hold(2 * TICK, 1.0)
    for _ in range(MOST + 1):
        hold(3 * TICK, 2.0)
    hold(0, 3.0)
    messages.handle_due(3 * TICK)
    assert taken == [(1.0, 2 * TICK)]
    messages.handle_due(4 * TICK)
    assert taken[1:] == [(3.0, 3 * TICK)]
