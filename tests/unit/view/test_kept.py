"""What is kept of the messages that come: the newest of each key, and all of some topics for a while."""

from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest

from support.transforms import stamped
from zteam.messages import LaserScan, LogLevel, TFMessage, Twist, Vector3, encode, encoding_of
from zteam.node.logs import LogLine
from zteam.view import documents
from zteam.view.composing import MOST, samples_since
from zteam.view.documents import Documents
from zteam.view.received import KEPT, KEPT_BYTES, Received
from zteam.view.team_view import Places


def command(speed: float) -> bytes:
    """A message as it comes."""
    return encode(Twist(Vector3(speed)))


def take(received: Received, *speeds: float) -> None:
    """Commands come."""
    for speed in speeds:
        received.take("t", command(speed), encoding_of(Twist), topic="t")


def test_only_the_newest_of_a_key_is_kept() -> None:
    """Its number grows with every message of any key, and each is news."""
    news: list[int] = []
    received = Received(lambda: news.append(1))
    for content in (b"a", b"b"):
        received.take("x", content)
    received.take("y", b"c")
    assert [(arrival.key, arrival.content, arrival.number) for arrival in received.newest()] == [
        ("x", b"b", 2),
        ("y", b"c", 3),
    ]
    received.clear()
    assert (received.get("x"), len(news)) == (None, 3)


def test_a_message_is_decoded_once_for_all_readers() -> None:
    """As long as it is the newest; as another type it is none, and stays as it is."""
    received = Received(lambda: None)
    received.take("x", command(0.5), encoding_of(Twist))
    assert received.read("x", LaserScan) is None and received.read("y", Twist) is None
    (arrival, message), again = received.read("x", Twist) or (None, None), received.read("x", Twist)
    assert arrival and message and again
    assert again[1] is message and message.linear.x == 0.5
    assert (arrival.number, again[0].content) == (1, message)
    received.take("x", command(0.75), encoding_of(Twist))
    newer = received.read("x", Twist)
    assert newer is not None and (newer[0].number, newer[1].linear.x) == (2, 0.75)


def frames_told(received: Received, places: Places, queries: Any, robots: set[int]) -> list[str]:
    """The names of the frames in the document `tf`."""
    state: Any = SimpleNamespace(received=received, queries=queries, places=places, robots=lambda: robots)
    places.look(robots)
    return [row["name"] for row in msgspec.json.decode(Documents(state).transforms())["frames"]]


def test_frames_of_a_removed_robot_are_left_out() -> None:
    """Its transforms stay with this process; frames of no robot are always told."""
    received = Received(lambda: None)
    rows = [stamped("map", child, 0, 1.0) for child in ("robot_0/odom", "robot_1/odom", "camera")]
    received.take("tf_static", encode(TFMessage(rows)))
    queries = SimpleNamespace(sim=None, frames={}, alive=lambda _name: True)
    places = Places(received)
    assert frames_told(received, places, queries, {1}) == ["camera", "robot_0/odom", "robot_1/odom"]
    queries.sim = SimpleNamespace()
    assert frames_told(received, places, queries, {1}) == ["camera", "robot_1/odom"]


def test_frames_are_told_that_came_before_they_were_asked_for() -> None:
    """While the world stands none comes again."""
    received = Received(lambda: None)
    queries = SimpleNamespace(sim=None, frames={}, alive=lambda _name: True)
    places = Places(received)
    for child in ("robot_0/odom", "robot_1/odom"):
        received.take("tf", encode(TFMessage([stamped("map", child, 1, 1.0)])))
        places.look(())
    assert frames_told(received, places, queries, set()) == ["robot_0/odom", "robot_1/odom"]


def test_history_gives_what_came_after_a_number() -> None:
    """Each page has its own number; the oldest are dropped in the end."""
    received = Received(lambda: None)
    take(received, *range(KEPT + 5))
    everything = received.since("t", 0)
    assert (len(everything), everything[0].number, everything[-1].number) == (KEPT, 6, KEPT + 5)
    assert [event.number for event in received.since("t", KEPT + 3)] == [KEPT + 4, KEPT + 5]
    received.forget("t")
    assert received.since("t", 0) == []


def test_history_of_large_messages_is_short() -> None:
    """A plot of a map's field does not fill the memory."""
    received = Received(lambda: None)
    for _ in range(10):
        received.take("map", bytes(KEPT_BYTES // 4), topic="map")
    assert [event.number for event in received.since("map", 0)] == [7, 8, 9, 10]


def test_samples_have_the_values_of_a_field() -> None:
    """Messages without a header get the time at which they came, in the team's time."""
    received = Received(lambda: None)
    take(received, 1.0, 2.0)
    number, pairs = samples_since(received, "t", "linear.x", 0, team_from_host=-1e6)
    assert (number, pairs[:, 1].tolist()) == (2, [1.0, 2.0])
    assert pairs[0, 0] == received.since("t", 0)[0].time - 1e6
    assert samples_since(received, "t", "linear.x", 2, 0.0)[1].size == 0


def test_fields_that_are_no_numbers_give_no_samples() -> None:
    """Neither a part of the message, nor a field that it lacks, nor nonsense."""
    received = Received(lambda: None)
    take(received, 1.0)
    assert all(samples_since(received, "t", field, 0, 0.0)[1].size == 0 for field in ("linear", "speed", "a..b", "[1]"))


def test_many_samples_are_thinned_evenly() -> None:
    """In fast lock-step there are more messages than pixels; the newest is always among them."""
    received = Received(lambda: None)
    take(received, *range(1000))
    _, pairs = samples_since(received, "t", "linear.x", 0, 0.0)
    assert len(pairs) == MOST
    assert pairs[-1, 1] == 999.0
    assert len({round(step) for step in (pairs[1:, 1] - pairs[:-1, 1])}) == 1


def test_the_distance_to_an_obstacle_is_the_least_range_that_is_one() -> None:
    """What is no return or invalid does not count, and a scan without any return gives no sample."""
    received = Received(lambda: None)
    for ranges in ([2.0, 0.01, np.nan, 1.5, np.inf], [5.0, np.inf]):
        scan = LaserScan(range_min=0.1, range_max=5.0, ranges=np.array(ranges, np.float32))
        received.take("s", encode(scan), encoding_of(LaserScan), topic="s")
    _, pairs = samples_since(received, "s", "min(ranges)", 0, 0.0)
    assert pairs[:, 1].tolist() == [1.5]
    assert samples_since(received, "s", "min(header)", 0, 0.0)[1].size == 0


def test_log_lines_come_in_order_of_time_and_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines of the history of a process that came live too are not repeated."""
    late, early = (
        LogLine(2_000_000_000, "b", LogLevel.INFO, "two\x1b[0m"),
        LogLine(1_000_000_000, "a", LogLevel.WARN, "one"),
    )
    state: Any = SimpleNamespace(received=Received(lambda: None), queries=SimpleNamespace(kept_log=[late]))
    shown = Documents(state)

    def told(number: int, now: float) -> tuple[int, list[dict[str, Any]]]:
        monkeypatch.setattr(documents, "monotonic", lambda: now)
        return shown.log(number)

    assert told(0, 10.0) == (0, [])
    state.queries.kept_log = [early, late]
    assert told(0, 10.1) == (0, [])
    number, lines = told(0, 11.0)
    assert [(line["time"], line["level"], line["text"]) for line in lines] == [
        (1.0, "warning", "one"),
        (2.0, "info", "two\ufffd[0m"),
    ]
    assert told(number, 12.0) == (number, [])
