"""Messages that a process sent before it heard that time had jumped back."""

from hypothesis import given
from hypothesis import strategies as st

from zteam.bus import MemoryHub
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop

TICK = 100_000_000


def node_after(*ticks: int) -> ProcessNode:
    """A process whose time was this, in ticks."""
    node = ProcessNode("a", MemoryHub().bus(), Stop(), "sim")
    for tick in ticks:
        node.set_time(tick * TICK)
    return node


@given(st.integers(3, 500), st.integers(0, 1), st.integers(1, 500))
def test_each_message_is_told_apart(end: int, earlier: int, last: int) -> None:
    """What was sent in the last two ticks of the old time is of the old time, and all from the new first tick on is
    not, each in a tick that is open or that comes next."""
    node = node_after(end, 1)
    assert node.is_of_ended_time((end - (earlier if end > 4 else 0)) * TICK)
    for tick in range(1, last):
        node.set_time(max(1, tick - tick % 2) * TICK)
        assert not node.is_of_ended_time(tick * TICK)


def test_before_a_jump_nothing_is_of_another_time() -> None:
    """A stamp far ahead of the clock is none of an ended time."""
    assert not node_after(1).is_of_ended_time(99 * TICK)


def test_a_message_without_a_stamp_counts() -> None:
    """It does not tell when it was sent."""
    assert not node_after(60, 1).is_of_ended_time(0)


def test_time_that_reaches_its_old_end_is_as_before() -> None:
    """Until then the stamps of the old time are far ahead, and afterwards its messages have all come."""
    assert node_after(60, 1, 29).is_of_ended_time(60 * TICK)
    assert not node_after(60, 1, 60).is_of_ended_time(99 * TICK)
