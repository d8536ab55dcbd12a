"""Messages that a process sent before it heard that time had jumped back."""

from hypothesis import given
from hypothesis import strategies as st

from zteam.node.ended_time import EndedTime

TICK = 100_000_000
ticks = st.integers(2, 500)


def has(ended: EndedTime, stream: str, stamp: int, now: int) -> bool:
    """Whether a message of this stamp is of the ended time."""
    return ended.has(stream, lambda: stamp, now)


@given(ticks, st.lists(st.integers(0, 1), max_size=3), st.integers(1, 500))
def test_each_message_is_told_apart(end: int, repeats: list[int], last: int) -> None:
    """What was sent in the last two ticks of the old time is of the old time, and all from the new first tick on is
    not, each in a tick that is open or that comes next."""
    ended = EndedTime()
    ended.jump(end * TICK, TICK)
    assert [has(ended, "a", (end - (k if end > 4 else 0)) * TICK, TICK) for k in repeats] == [True] * len(repeats)
    assert not any(has(ended, "a", k * TICK, max(1, k - k % 2) * TICK) for k in range(1, last))


def test_before_a_jump_nothing_is_of_another_time() -> None:
    """A stamp far ahead of the clock is none of an ended time."""
    ended = EndedTime()
    assert not has(ended, "a", 99 * TICK, TICK)


def test_each_stream_has_its_own_beginning() -> None:
    """Where one sender has gone over to the new time, another may not have; one without a stamp does not tell."""
    ended = EndedTime()
    ended.jump(60 * TICK, TICK)
    assert not has(ended, "a", TICK, TICK)
    assert not has(ended, "b", 0, TICK)
    assert has(ended, "b", 60 * TICK, 2 * TICK)
    ended.jump(60 * TICK, TICK)
    assert has(ended, "a", 60 * TICK, TICK)


def test_a_sender_that_comes_late_is_heard() -> None:
    """A process that begins when the new time is past the middle has sent nothing before the jump."""
    ended = EndedTime()
    ended.jump(60 * TICK, TICK)
    assert has(ended, "a", 60 * TICK, 30 * TICK)
    assert not has(ended, "a", 60 * TICK, 31 * TICK)
