"""What a process remembers of the messages that it received and dropped."""

import pytest

from zteam.bus import receiving
from zteam.bus.receiving import OTHER, Counters, KeyCount, Receiver
from zteam.bus.transport import RawSample
from zteam.messages import Bool, encode, encoding_of


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The host's time, as the counters read it."""
    time = [100.0]
    monkeypatch.setattr(receiving, "monotonic", lambda: time[0])
    return time


def test_a_drop_has_an_age_and_a_reason(now: list[float]) -> None:
    """The age grows with host time, and good messages do not change it."""
    found = Counters()
    found.drop("a", "broken")
    found.receive("a")
    now[0] += 61.5
    assert found.snapshot() == {"a": KeyCount(1, 1, 61.5, "broken")}


def test_the_last_drop_counts(now: list[float]) -> None:
    """A further drop replaces age and reason of its key, and of no other."""
    found = Counters()
    found.drop("a", "broken")
    found.drop("b", "too large")
    now[0] += 10.0
    found.drop("a", "wrong type")
    assert found.snapshot() == {"a": KeyCount(0, 2, 0.0, "wrong type"), "b": KeyCount(0, 1, 10.0, "too large")}


def test_without_a_drop_there_is_no_age() -> None:
    """A key with good messages only has neither age nor reason."""
    found = Counters()
    found.receive("a")
    assert found.snapshot() == {"a": KeyCount(1, 0, None, "")}


def test_drops_beyond_the_bound_of_keys_are_told_together(now: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    """Keys that a sender invents have one count, age and reason in common."""
    monkeypatch.setattr(receiving, "MAX_KEYS", 1)
    found = Counters()
    found.receive("a")
    found.drop("b", "first")
    now[0] += 3.0
    found.drop("c", "second")
    now[0] += 1.0
    assert found.snapshot()[OTHER] == KeyCount(0, 2, 1.0, "second")
    assert set(found.snapshot()) == {"a", OTHER}


def test_a_long_reason_is_cut() -> None:
    """A reason that repeats what a sender wrote does not fill the memory of its receivers."""
    found = Counters()
    found.drop("a", "x" * 10_000)
    assert len(found.snapshot()["a"].last_drop_reason) == 300


def test_a_cause_that_stays_is_warned_about_ever_less_often(now: list[float], caplog: pytest.LogCaptureFixture) -> None:
    """Ten messages a second for five minutes make ten warnings, not three hundred; a new reason is told at once."""
    found = Counters()
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


def test_a_cause_that_returns_after_a_minute_is_warned_about_at_once(
    now: list[float], caplog: pytest.LogCaptureFixture
) -> None:
    """The pauses begin anew."""
    found = Counters()
    for now[0] in (0.0, 1.5, 2.0, 62.0, 63.0, 63.5):
        found.drop("a", "no such robot")
    assert [record.args[-1] for record in caplog.records if isinstance(record.args, tuple)] == [1, 2, 4, 5]


def test_invented_robots_share_their_warnings(now: list[float], caplog: pytest.LogCaptureFixture) -> None:
    """Ten thousand robots of which nothing good came make one line; one that is known has its own."""
    found = Counters()
    for _ in range(2):
        found.receive("robot_1/cmd_vel")
    for robot in range(100, 10_100):
        now[0] += 1e-5
        found.receive(f"robot_{robot}/cmd_vel")
        found.drop(f"robot_{robot}/cmd_vel", "the world has no such robot")
    found.drop("robot_1/cmd_vel", "wrong type")
    assert [record.args[0] for record in caplog.records if isinstance(record.args, tuple)] == [
        "robot_100/cmd_vel",
        "robot_1/cmd_vel",
    ]
    assert sum(count.dropped for count in found.snapshot().values()) == 10_001
    assert "robot_$*/cmd_vel" not in found.snapshot()


def test_a_new_writer_of_a_latched_key_is_heard_whatever_its_clock(now: list[float]) -> None:
    """Of two writers that are there when a subscriber comes, the later message counts. One that comes afterwards has
    taken the place of the first, though its clock be behind; each one's own older messages are left out."""
    heard: list[bool] = []
    receiver = Receiver(Counters())
    take = receiver.messages(Bool, lambda _, message: heard.append(message.data), latched=True)

    def send(source: str, timestamp: int, lamp: bool) -> None:
        take(RawSample("lamp", encode(Bool(lamp)), encoding_of(Bool), timestamp, source))

    send("old", 1000, True)
    send("other", 999, False)
    assert heard == [True]
    now[0] += 2.0
    send("old", 998, False)
    assert heard == [True]
    send("new", 500, False)
    send("new", 501, True)
    send("new", 499, False)
    assert heard == [True, False, True]
