"""From which step on a message counts."""

from zteam.messages import Header, PoseStamped, Twist, Vector3, time_from_ns
from zteam.nodes.robot.newest import Newest
from zteam.runtime.tick_messages import MAX_AHEAD, tick_of

TICK = 100_000_000


def pose(tick: float) -> PoseStamped:
    """A message with the stamp of a tick."""
    return PoseStamped(Header(time_from_ns(round(tick * TICK))))


def test_a_stamp_tells_the_tick_also_before_that_tick_comes() -> None:
    """A message that overtakes its own tick belongs to that tick, not to the one that is open when it comes."""
    assert tick_of(pose(3), 3 * TICK) == 3 * TICK
    assert tick_of(pose(3), 2 * TICK) == 3 * TICK


def test_what_tells_no_tick_counts_by_its_arrival() -> None:
    """A message without a header, without a stamp, with an old one or with one of another clock is of the open tick."""
    late, wall = pose(1), PoseStamped(Header(time_from_ns(3 * TICK + MAX_AHEAD + 1)))
    assert [tick_of(message, 3 * TICK) for message in (Twist(), PoseStamped(), late, wall)] == [3 * TICK] * 4


def test_the_message_of_the_tick_before_stays_until_the_next_step() -> None:
    """A message of the open tick does not hide the one before it from a step that is still to come."""
    newest = Newest()
    newest.hold(pose(2), 2 * TICK)
    newest.hold(pose(3), 3 * TICK)
    newest.settle(3 * TICK)
    assert newest.message == pose(2)
    newest.settle(4 * TICK)
    assert newest.message == pose(3)
    assert not newest.is_coming


def test_the_last_message_of_a_tick_counts() -> None:
    """Of two messages of one tick the one that comes last counts; so does one without a stamp after one with it."""
    newest = Newest()
    newest.hold(pose(3), 2 * TICK)
    newest.hold(PoseStamped(Header(frame_id="last")), 2 * TICK)
    newest.settle(3 * TICK)
    assert newest.message is None
    newest.settle(4 * TICK)
    assert newest.message.header.frame_id == "last"


def test_messages_without_steps_take_no_room() -> None:
    """A robot that does not step keeps what its next step may need, and nothing that is older."""
    newest = Newest()
    for tick in range(1, 1000):
        newest.hold(pose(tick), tick * TICK)
    assert len(newest._coming) == 1
    assert newest.message == pose(998)


def test_in_real_time_a_message_counts_at_once() -> None:
    """The newest message replaces all before it, also what lock-step has left."""
    newest = Newest()
    newest.hold(pose(5), 5 * TICK)
    newest.take(Twist(Vector3(0.1)), TICK)
    newest.settle(9 * TICK)
    assert (newest.message, newest.stamp) == (Twist(Vector3(0.1)), TICK)
