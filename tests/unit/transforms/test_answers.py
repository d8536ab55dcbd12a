"""The aggregator's answers: batches, waits, histories."""

import threading

import pytest

from support.limits import LIMIT
from support.transforms import S, stamped
from zteam.bus import Deferred, MemoryHub
from zteam.errors import BusError, UsageError
from zteam.tf import Buffer, LookupException, TransformException
from zteam.transforms.answers import answer_history, answer_lookups
from zteam.transforms.client import HistoryRequest, Lookup, LookupReply, LookupRequest, TransformClient


@pytest.fixture
def buffer() -> Buffer:
    """A robot that drives along x with 1 m/s, known from 1 s to 2 s at 10 Hz."""
    made = Buffer()
    for k in range(11):
        made.set_transform(stamped("map", "robot", S + k * S // 10, 1.0 + 0.1 * k), "t")
    return made


@pytest.mark.parametrize(
    "answer", [[], [LookupReply(), LookupReply()], [LookupReply(error="__name__")], [LookupReply(error="ZteamError")]]
)
def test_a_forged_answer_ends_nobody(hub: MemoryHub, answer: list[LookupReply]) -> None:
    """Any process may answer: an odd number of answers is an error of the bus, an odd error is one of transforms."""
    hub.bus().serve("tf/lookup", LookupRequest, lambda _: answer)
    with pytest.raises((BusError, TransformException)):
        TransformClient(hub.bus()).lookup_transform("map", "robot")


def test_a_batch_is_answered_in_order(buffer: Buffer) -> None:
    """Good and bad look-ups side by side, past times, slashes, and a fixed frame."""
    lookups = [
        Lookup("map", "/robot"),
        Lookup("map", "unknown"),
        Lookup("map", "robot", S + S // 20),
        Lookup("robot", "robot", 2 * S, fixed="map", source_time=S),
    ]
    replies = answer_lookups(buffer, LookupRequest(lookups))
    assert isinstance(replies, list)
    newest, unknown, past, fixed = replies
    assert (newest.stamp, newest.translation[0]) == (2 * S, pytest.approx(2.0))
    assert unknown.error == "LookupException"
    assert "unknown" in unknown.text
    assert past.translation[0] == pytest.approx(1.05)
    assert (fixed.stamp, fixed.translation[0]) == (2 * S, pytest.approx(-1.0))


def test_missing_data_is_waited_for(buffer: Buffer) -> None:
    """The answer comes once the data has come; what does not come in time is answered with tf2's exception."""
    later = answer_lookups(
        buffer, LookupRequest([Lookup("map", "robot", 3 * S), Lookup("map", "robot")], timeout=LIMIT)
    )
    assert isinstance(later, Deferred)
    replies = []
    waiter = threading.Thread(target=lambda: replies.extend(later.finish()))
    waiter.start()
    buffer.set_transform(stamped("map", "robot", 4 * S, 4.0), "t")
    waiter.join(LIMIT)
    assert [reply.error for reply in replies] == ["", ""]
    assert replies[0].translation[0] == pytest.approx(3.0)
    hopeless = answer_lookups(buffer, LookupRequest([Lookup("map", "unknown")], timeout=0.01))
    assert isinstance(hopeless, Deferred)
    assert [reply.error for reply in hopeless.finish()] == ["LookupException"]


def test_a_history_is_a_row_an_instant(buffer: Buffer) -> None:
    """From start to end in steps; before the data began there are no rows; from the end back by default."""
    rows = answer_history(buffer, HistoryRequest("map", "robot", S // 4, start=S // 2, end=2 * S)).rows
    assert [row[0] for row in rows] == [S, S + S // 4, S + S // 2, S + 3 * S // 4, 2 * S]
    assert [row[1] for row in rows] == pytest.approx([1.0, 1.25, 1.5, 1.75, 2.0])
    last = answer_history(buffer, HistoryRequest("map", "robot", S // 10, start=-S // 5)).rows
    assert [row[0] for row in last] == [2 * S - S // 5, 2 * S - S // 10, 2 * S]


def test_impossible_histories_are_refused(buffer: Buffer) -> None:
    """Too many rows, and frames that are not there."""
    with pytest.raises(UsageError, match="larger step"):
        answer_history(buffer, HistoryRequest("map", "robot", 1, start=S, end=2 * S))
    with pytest.raises(LookupException):
        answer_history(buffer, HistoryRequest("map", "unknown", S))
