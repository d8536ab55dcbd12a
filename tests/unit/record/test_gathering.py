"""Which tick each message is recorded in, whatever the order in which two sessions' messages come."""

from collections.abc import Iterable

from zteam.bus.transport import RawSample
from zteam.messages import Bool, Done, Float64, Header, LaserScan, Message, String, Tick, Twist, encode, time_from_ns
from zteam.messages.message import encoding_of
from zteam.record.gathering import Gatherer
from zteam.record.writing import Entry

SIM, ROBOT = "s0", "s1"
STEP = 100_000_000


def sample(key: str, message: Message, source: str) -> RawSample:
    """A message of a session."""
    return RawSample(key, encode(message), encoding_of(type(message)), source=source)


def tick(number: int, sent: int = 1) -> list[RawSample]:
    """A tick, and the simulator's scan of it before it; `sent` since the one before."""
    stamp = time_from_ns(number * STEP)
    scan = LaserScan(Header(stamp))
    began = Tick(stamp, 1, number, sessions=[ROBOT], sent=sent)
    return [sample("robot_0/base_scan", scan, SIM), sample("sim/tick", began, SIM)]


def answer(number: int) -> list[RawSample]:
    """What the robot sends in a tick."""
    done = Done(1, number, True, Twist(), sent=1)
    return [sample("notes", Float64(float(number)), ROBOT), sample("robot_0/done", done, ROBOT)]


def gathered(samples: Iterable[RawSample]) -> tuple[Gatherer, list[tuple[str, int]]]:
    """The keys and ticks of what is recorded of these, but for the hashes."""
    gatherer = Gatherer({SIM})
    found: list[Entry] = [entry for each in samples for entry in gatherer.take(each)]
    return gatherer, [(entry.key, entry.tick) for entry in found if entry.type != String.ros_type]


def run(*numbers: int) -> list[RawSample]:
    """Ticks, each with its answer."""
    return [each for number in numbers for each in (*tick(number), *answer(number))]


def test_answers_that_come_before_or_behind_a_tick() -> None:
    """An answer on the faster way, or on a slower one than the next tick's, is recorded in the tick that it answers."""
    usual, expected = gathered(run(1, 2, 3, 4, 5))
    assert not usual.gaps and ("notes", 3) in expected and ("robot_0/base_scan", 3) in expected
    early = [*run(1, 2), *answer(3), *tick(3), *tick(4), *answer(4), *run(5)]
    hasty = [*run(1, 2), *answer(3), answer(4)[0], *tick(3), *tick(4), answer(4)[1], *run(5)]
    late = [*run(1, 2), *tick(3), *tick(4), *answer(3), *answer(4), *run(5)]
    for samples in (early, hasty, late):
        gatherer, found = gathered(samples)
        assert sorted(found) == sorted(expected)
        assert (list(gatherer.gaps), gatherer.stray) == ([], {})


def test_a_scan_that_is_sent_again_is_no_other_one() -> None:
    """A participant that lacks a scan gets it once more behind the tick: neither is it recorded twice, nor stray, nor
    taken for a message without a stamp that says the same in each tick."""

    def stalls(number: int) -> list[RawSample]:
        return [sample("robot_0/stall", Bool(), SIM), *tick(number, sent=2)]

    again = tick(3)[0]
    samples = [*stalls(1), *answer(1), *stalls(2), *answer(2), *stalls(3), *answer(3)]
    stall, *rest = stalls(4)
    gatherer, found = gathered([*samples, stall, again, *rest, *answer(4), *stalls(5)])
    assert found.count(("robot_0/base_scan", 3)) == 1 and (list(gatherer.gaps), gatherer.stray) == ([], {})
    assert found.count(("robot_0/stall", 3)) == 1


def test_a_message_that_does_not_come_is_a_gap() -> None:
    """One message fewer than the answer says is named, with its tick; one more shows a process outside of its steps."""
    gatherer, _ = gathered([*run(1, 2), *tick(3), answer(3)[1], *run(4)])
    assert list(gatherer.gaps) == ["tick 3: 0 of 1 messages of robot_0 have come"]
    gatherer, _ = gathered([*run(1, 2), *tick(3), sample("notes", Float64(9.0), ROBOT), *answer(3), *run(4)])
    assert gatherer.stray == {"robot_0": "notes"}
