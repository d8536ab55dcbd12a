"""When a message counts in lock-step."""

from collections.abc import Set
from random import Random

import pytest
from hypothesis import given

from support.arrivals import TICK, TICKS, Data, Opened, Sent, arrive, orders, sent_messages
from zteam.messages import Header, Message, Point, Pose, PoseStamped, Twist, time_from_ns
from zteam.node import tick_messages
from zteam.node.screen import FROM_TICK
from zteam.node.tick_messages import MAX_AHEAD, HeldMessage, TickMessages, tick_of

SCAN = "robot_0/base_scan"
MOST, MOST_OF_KEY = 200, 20
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


@pytest.fixture
def keeps_few(monkeypatch: pytest.MonkeyPatch) -> None:
    """A node keeps fewer messages than it does."""
    monkeypatch.setattr(tick_messages, "MOST", MOST)
    monkeypatch.setattr(tick_messages, "MOST_OF_KEY", MOST_OF_KEY)


class Waiting:
    """The messages that a node keeps, tick 2 being open, and what it has handled of them, with the tick of each."""

    def __init__(self) -> None:
        self.messages, self.handled, self._open = TickMessages(), list[tuple[str, int]](), 2 * TICK

    def take(
        self,
        key: str,
        stamp: int = 0,
        due: int | None = None,
        source: str = "a",
        *,
        data: bool = False,
        newest_only: bool = False,
        told: str = "",
        latched: bool = False,
    ) -> str:
        """A message comes; why it is dropped."""
        handle = lambda *content: self.handled.append((told or key, content[2]))  # noqa: E731
        arrival = HeldMessage(1, key, pose(stamp), source, data, due, handle, newest_only, latched)
        return self.messages.take(arrival, self._open, is_open=True)

    def next(self, sessions: Set[str] | None = None) -> list[str]:
        """What is handled in the next tick, which lists these sessions."""
        self.handled.clear()
        self._open += TICK
        self.messages.handle_due(self._open, sessions)
        return [told for told, _ in self.handled]


def test_of_a_process_that_has_left_nothing_counts() -> None:
    """Not even what it sent before it left in that tick. What the simulator sends counts."""
    waiting = Waiting()
    for source in "ab":
        waiting.take("goal", source=source, told=source)
    waiting.take(SCAN, 3 * TICK, 3 * TICK, source="sim", data=True)
    assert waiting.next({"b", "sim"}) == ["b", SCAN]


def test_what_a_tick_carries_is_of_the_tick_before() -> None:
    """Whatever its stamp says, and whatever data has come already."""
    waiting = Waiting()
    waiting.messages.hear(3 * TICK, 2 * TICK)
    for stamp in (0, TICK, 9 * TICK):
        waiting.take("goal", stamp, source=FROM_TICK)
    assert waiting.next() == ["goal"] * 3


def test_before_the_first_tick_latched_messages_count() -> None:
    """And what the simulator has sent for that tick."""
    waiting = Waiting()
    waiting.take("goal")
    waiting.take("map", latched=True)
    waiting.take(SCAN, 3 * TICK, 3 * TICK, source="sim", data=True)
    waiting.messages.forget_others()
    assert waiting.next() == ["map", SCAN]


@pytest.mark.parametrize("sources", ["ab", "ba"])
def test_of_two_senders_the_one_that_counts_is_handled_last(sources: str) -> None:
    """A callback that keeps the newest message keeps the same one as a robot would, whichever came first."""
    waiting = Waiting()
    for source in sources:
        waiting.take("goal", {"a": TICK, "b": 2 * TICK}[source], source=source, told=source)
    assert waiting.next() == ["a", "b"]


def test_after_the_last_tick_all_is_handled() -> None:
    """Without ticks nothing waits for one."""
    waiting = Waiting()
    waiting.take("a", TICK)
    waiting.take("a of a tick", TICK, 3 * TICK)
    waiting.messages.handle_due(None)
    assert [told for told, _ in waiting.handled] == ["a", "a of a tick"]


def test_what_a_step_waits_for_is_handled_in_its_tick() -> None:
    """At once while that tick is open, with it if it comes first."""
    waiting = Waiting()
    waiting.take("path", 2 * TICK, 2 * TICK)
    waiting.take("next path", 3 * TICK, 3 * TICK)
    assert waiting.handled == [("path", 0)]
    assert waiting.next() == ["next path"]


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


@pytest.mark.parametrize("due", [None, 3 * TICK])
def test_one_key_does_not_keep_out_the_others(due: int | None, keeps_few: None) -> None:
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


def test_what_a_step_would_wait_for_in_a_far_tick_is_refused(keeps_few: None) -> None:
    """It would stay for ever: MOST of them leave room for all others."""
    waiting = Waiting()
    far = 2 * TICK + MAX_AHEAD + 1
    assert {waiting.take("near/distance", far, far) for _ in range(MOST)} == {"its stamp is far ahead of the open tick"}
    assert not waiting.take("robot_1/status")


@pytest.mark.parametrize(
    ("message", "tick"),
    [(pose(4 * TICK), 4), (pose(3 * TICK), 3), (pose(TICK), 3), (pose(3 * TICK + MAX_AHEAD + 1), 3), (Twist(), 3)],
)
def test_a_stamp_tells_the_tick_also_before_that_tick_comes(message: Message, tick: int) -> None:
    """A message that overtakes its own tick belongs to that tick. One without a header or a stamp, with an old one or
    with one of another clock is of the open tick."""
    assert tick_of(message, 3 * TICK) == tick * TICK


def test_a_robot_takes_the_last_message_of_each_tick(keeps_few: None) -> None:
    """The message of the tick before stays until its step; of two of one tick the last one counts, and none waits that
    another has replaced."""
    waiting = Waiting()
    waiting.take("goal", 2 * TICK, newest_only=True, told="1")
    for told in (*["2"] * (MOST + 1), "3"):
        assert not waiting.take("goal", 3 * TICK, newest_only=True, told=told)
    assert (waiting.next(), waiting.handled) == (["1"], [("1", 2 * TICK)])
    assert (waiting.next(), waiting.handled) == (["3"], [("3", 3 * TICK)])
