"""What a process remembers of the messages that it received and dropped."""

import pytest

from zteam.bus import receiving
from zteam.bus.receiving import OTHER, KeyCount, Receiver
from zteam.bus.transport import RawSample
from zteam.messages import Bool, encode, encoding_of


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The host's time, as the counters read it."""
    time = [100.0]
    monkeypatch.setattr(receiving, "monotonic", lambda: time[0])
    return time


def test_the_last_drop_counts(now: list[float]) -> None:
    """With its age and reason, of its key alone; good messages do not change it, and without a drop there is none. A
    reason that repeats what a sender wrote is cut."""
    found = Receiver()
    found.drop("a", "broken")
    found.drop("b", "x" * 10_000)
    found.of("a").received += 1
    found.of("c").received += 1
    now[0] += 10.0
    assert found.snapshot()["a"] == KeyCount(1, 1, 10.0, "broken")
    found.drop("a", "wrong type")
    assert found.snapshot() == {
        "a": KeyCount(1, 2, 0.0, "wrong type"),
        "b": KeyCount(0, 1, 10.0, "x" * 300),
        "c": KeyCount(1, 0, None, ""),
    }


def test_drops_beyond_the_bound_of_keys_are_told_together(now: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    """Keys that a sender invents have one count, age and reason in common."""
    monkeypatch.setattr(receiving, "MAX_KEYS", 1)
    found = Receiver()
    found.of("a").received += 1
    found.drop("b", "first")
    now[0] += 3.0
    found.drop("c", "second")
    now[0] += 1.0
    assert found.snapshot()[OTHER] == KeyCount(0, 2, 1.0, "second")
    assert set(found.snapshot()) == {"a", OTHER}


def test_a_cause_that_stays_is_warned_about_ever_less_often(now: list[float], caplog: pytest.LogCaptureFixture) -> None:
    """Ten messages a second for five minutes make ten warnings, not three hundred; a new reason is told at once."""
    found = Receiver()
    told = []
    for tenth in range(3000):
        now[0] = 100.0 + 0.1 * tenth
        found.drop("a", "no such robot")
        if caplog.records:
            told.append(tenth / 10)
            caplog.clear()
    assert told == [0.0, 1.0, 3.0, 7.0, 15.0, 31.0, 63.0, 123.0, 183.0, 243.0]
    found.drop("a", "wrong type")
    assert "wrong type (3001 so far)" in caplog.text
    # After a minute without drops the pauses begin anew.
    caplog.clear()
    for now[0] in (1000.0, 1000.5, 1001.5, 1062.0, 1063.0):
        found.drop("a", "no such robot")
    assert [record.args[-1] for record in caplog.records if isinstance(record.args, tuple)] == [3002, 3004, 3005, 3006]


def test_invented_robots_share_their_warnings(now: list[float], caplog: pytest.LogCaptureFixture) -> None:
    """Ten thousand robots of which nothing good came make one line; one that is known has its own."""
    found = Receiver()
    for _ in range(2):
        found.of("robot_1/cmd_vel").received += 1
    for robot in range(100, 10_100):
        now[0] += 1e-5
        found.of(f"robot_{robot}/cmd_vel").received += 1
        found.drop(f"robot_{robot}/cmd_vel", "the world has no such robot")
    found.drop("robot_1/cmd_vel", "wrong type")
    assert [record.args[0] for record in caplog.records if isinstance(record.args, tuple)] == [
        "robot_100/cmd_vel",
        "robot_1/cmd_vel",
    ]
    assert sum(count.dropped for count in found.snapshot().values()) == 10_001
    assert "robot_$*/cmd_vel" not in found.snapshot()


class Lamp:
    """A latched key, and what a subscriber has heard on it."""

    def __init__(self, now: list[float]) -> None:
        self._now = now
        self.heard: list[bool] = []
        handle = Receiver().messages(Bool, lambda _, message: self.heard.append(message.data), latched=True)
        self._take = handle

    def send(self, timestamp: int, lamp: bool, source: str = "old", delay: float = 0.0, after: float = 0.0) -> None:
        """A message comes `after` seconds."""
        self._now[0] += after
        self._take(RawSample("lamp", encode(Bool(lamp)), encoding_of(Bool), timestamp, source, delay))


def test_of_what_is_kept_the_newest_counts(now: list[float]) -> None:
    """When a subscriber comes, it gets what several writers have kept in any order."""
    lamp = Lamp(now)
    lamp.send(1000, True, "old")
    lamp.send(999, False, "other")
    lamp.send(998, False, "old")
    assert lamp.heard == [True]


@pytest.mark.parametrize("source", ["old", "new"])
def test_what_comes_later_counts_whatever_the_clock(now: list[float], source: str) -> None:
    """Another writer has taken the place of the first one, or the clock of its host was set back: a second later its
    messages count, also if they go on without a pause."""
    lamp = Lamp(now)
    lamp.send(10**6, True)
    for number in range(8):
        lamp.send(500 + number, bool(number % 2), source, after=0.3)
    assert lamp.heard == [True, True, False, True, False, True]


@pytest.mark.parametrize("source", ["old", "other"])
def test_a_stamp_that_is_ahead_hides_nothing(now: list[float], source: str) -> None:
    """Whoever put a message an hour ahead on the key, the next one counts at once."""
    lamp = Lamp(now)
    lamp.send(10**9, True, source, delay=-3600.0)
    lamp.send(1000, False)
    assert lamp.heard == [True, False]
