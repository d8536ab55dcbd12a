"""What a recorder makes of the messages that come: their ticks and times, repeats, and what has not come."""

from collections.abc import Iterable, Sequence

import pytest

from support.lockstep_doubles import INTERVAL
from zteam.bus.transport import RawSample
from zteam.messages import (
    Bool,
    Clock,
    Done,
    Float64,
    Header,
    Input,
    LaserScan,
    Message,
    Odometry,
    String,
    Tick,
    Twist,
    encode,
    encoding_of,
    time_from_ns,
)
from zteam.record.gathering import TRUTH, Gatherer
from zteam.record.writing import Entry

SIM, ROBOT, TOOL = "51", "b0", "f1"
"""Sessions."""


class Desk:
    """A gatherer, and the sessions of a simulator, a robot that takes part, and a tool."""

    def __init__(self) -> None:
        self.gatherer = Gatherer({SIM})
        self.entries: list[Entry] = []

    def say(self, session: str, key: str, message: Message) -> None:
        """A message of a session comes."""
        sample = RawSample(key, encode(message), encoding_of(type(message)), source=session)
        self.entries += self.gatherer.take(sample)

    def tick(self, number: int, sent: int = 0, *, epoch: int = 1, listed: Sequence[str] = ("robot_0",)) -> None:
        """A tick comes, before which the simulator has sent so many messages."""
        sessions = [ROBOT] if listed else []
        stamp = time_from_ns(number * INTERVAL)
        self.say(SIM, "sim/tick", Tick(stamp, epoch, number, participants=list(listed), sessions=sessions, sent=sent))

    def done(self, number: int, sent: int = 0, *, epoch: int = 1) -> None:
        """The robot answers."""
        self.say(ROBOT, "robot_0/done", Done(epoch, number, sent=sent))

    def odom(self, number: int, key: str = "robot_0/odom") -> None:
        """The simulator sends odometry of a tick."""
        self.say(SIM, key, Odometry(Header(time_from_ns(number * INTERVAL))))

    def word(self, text: str, session: str = ROBOT) -> None:
        self.say(session, "robot_0/word", String(text))

    def end(self) -> None:
        """The recording ends."""
        self.entries += self.gatherer.rest()

    def take(self, *keys: str) -> list[tuple[str, int, int]]:
        """Of what was recorded since the last call on these keys: key, time in ticks, tick."""
        found, self.entries = [each for each in self.entries if each.key in keys], []
        return [(each.key, each.time // INTERVAL, each.tick) for each in found]


@pytest.fixture
def desk() -> Desk:
    """The robot has answered the first two ticks."""
    desk = Desk()
    for number in (1, 2):
        desk.tick(number)
        desk.done(number)
    desk.entries.clear()
    return desk


def test_a_message_has_the_tick_of_its_sender(desk: Desk) -> None:
    """Of a participant that which it answers, of the simulator that which it measures, before its tick or after it.
    What comes from elsewhere, and statuses, have none."""
    desk.odom(3)
    desk.tick(3, 1)
    desk.say(SIM, "robot_0/stall", String("no stamp"))
    desk.word("inside")
    desk.word("outside", TOOL)
    desk.say(ROBOT, "robot_0/status", String("by the clock"))
    desk.done(3, 1)
    desk.tick(4, 1)
    keys = "robot_0/odom", "robot_0/stall", "robot_0/word", "robot_0/status"
    assert sorted(desk.take(*keys)) == [
        ("robot_0/odom", 3, 3),
        ("robot_0/stall", 3, 3),
        ("robot_0/status", 3, 0),
        ("robot_0/word", 3, 0),
        ("robot_0/word", 3, 3),
    ]
    assert not (desk.gatherer.gaps or desk.gatherer.stray)


def test_what_comes_again_is_recorded_once(desk: Desk) -> None:
    """The data of a tick that is sent again, before the tick or after it, and the answer to it."""
    desk.odom(3)
    desk.odom(3)
    desk.tick(3, 1)
    desk.odom(3)
    desk.tick(3, 1)
    for _ in range(2):
        desk.word("once")
        desk.done(3, 1)
    desk.odom(4)
    desk.tick(4, 1)
    desk.odom(5)
    desk.tick(5, 1)
    found = desk.take("robot_0/odom", "robot_0/word", "robot_0/done", "sim/tick")
    assert [each for each in found if each[0] == "robot_0/odom"] == [("robot_0/odom", n, n) for n in (3, 4, 5)]
    # The answers to the tick before and to this one.
    assert len(found) == 3 + 1 + 2 + 3
    assert not (desk.gatherer.gaps or desk.gatherer.stray)


def test_what_a_process_has_sent_in_the_tick_of_its_end_belongs_to_none(desk: Desk) -> None:
    """Whether it has answered it or not: chance says how much of that has come."""
    desk.tick(3)
    desk.word("in the step")
    desk.done(3, 1)
    desk.word("at its end")
    # Sent again without it.
    stamp = time_from_ns(3 * INTERVAL)
    desk.say(SIM, "sim/tick", Tick(stamp, 1, 3, sessions=[ROBOT]))
    desk.tick(4, listed=())
    assert desk.take("robot_0/word", "robot_0/done") == [
        ("robot_0/done", 2, 2),
        ("robot_0/word", 3, 0),
        ("robot_0/done", 3, 0),
        ("robot_0/word", 4, 0),
    ]


def test_the_last_tick_is_recorded_too(desk: Desk) -> None:
    """At the end, when no other tick follows."""
    desk.tick(3)
    desk.word("in the step")
    desk.done(3, 1)
    desk.end()
    assert ("robot_0/word", 3, 3) in desk.take("robot_0/word")


@pytest.mark.parametrize("lost", ["of the simulator", "of the robot"])
def test_a_message_that_has_not_come_is_a_gap(desk: Desk, lost: str) -> None:
    """In the tick, and of the process, that lacks it."""
    desk.odom(3)
    desk.tick(3, 2 if lost == "of the simulator" else 1)
    desk.done(3, 1 if lost == "of the robot" else 0)
    desk.tick(4)
    (gap,) = desk.gatherer.gaps
    assert ("tick 3" in gap and "robot_0" in gap) if lost == "of the robot" else "sim" in gap


def test_a_process_that_publishes_between_its_steps_is_named(desk: Desk) -> None:
    """Its answer counts the messages of its step alone."""
    desk.tick(3)
    desk.done(3)
    desk.word("between")
    desk.tick(4)
    desk.word("in the step")
    desk.done(4, 1)
    assert desk.gatherer.stray == {"robot_0": "robot_0/word"}


def test_a_process_that_does_not_say_what_it_reads_is_named(desk: Desk) -> None:
    """Its answers end behind the command."""
    desk.tick(3)
    short = encode(Done(1, 3))[:76]
    desk.entries += desk.gatherer.take(RawSample("robot_0/done", short, "", source=ROBOT))
    assert desk.gatherer.stray == {"robot_0": "robot_0/done"}


def test_a_request_that_is_handed_on_hides_no_message(desk: Desk) -> None:
    """The answer comes again with it, after the next tick's first message; where the tick comes again, so does what was
    sent in it, perhaps in another form."""
    desk.tick(3)
    desk.done(3)
    desk.word("of the next tick")
    desk.say(ROBOT, "robot_0/done", Done(1, 3, inputs=[Input(1, "robot_0/set", Input.REQUEST)]))
    desk.tick(4)
    desk.done(4, 1)
    desk.word("both in one")
    desk.done(4, 1)
    desk.tick(5)
    desk.done(5)
    assert not (desk.gatherer.gaps or desk.gatherer.stray)


def test_each_tick_has_a_hash_of_its_ground_truth(desk: Desk) -> None:
    """Equal where the ground truth is."""
    key = "robot_0/base_pose_ground_truth"
    for number, pose in ((3, 0.0), (4, 0.0), (5, 1.0)):
        desk.tick(number, 0 if number == 3 else 1)
        message = Odometry()
        message.pose.pose.position.x = pose
        desk.say(SIM, key, message)
    desk.tick(6, 1)
    hashes = [each.data for each in desk.entries if each.key == TRUTH and each.tick > 2]
    assert len(hashes) == 3
    assert hashes[0] == hashes[1] != hashes[2]


def test_ticks_of_no_simulator_count_nothing(desk: Desk) -> None:
    """They are recorded as any message."""
    desk.say(TOOL, "sim/tick", Tick(tick=9))
    assert desk.gatherer.tick is not None
    assert desk.gatherer.tick.tick == 2
    assert desk.take("sim/tick") == [("sim/tick", 2, 0)]


def test_in_real_time_the_clock_shows_what_has_not_come() -> None:
    """Ticks that are missing between two, also where the clock begins late or the world begins anew."""
    desk = Desk()
    for tick in (5, 6, 7, 10, 11, 1, 2, 4):
        desk.say(SIM, "clock", Clock(time_from_ns(tick * INTERVAL)))
    assert desk.gatherer.missed == 2 + 1


def test_in_real_time_the_clock_says_when() -> None:
    """A recording that begins in the middle of a run in lock-step is not whole."""
    desk = Desk()
    desk.word("before")
    desk.say(SIM, "clock", Clock(time_from_ns(7 * INTERVAL)))
    desk.word("after")
    assert desk.take("robot_0/word") == [("robot_0/word", 0, 0), ("robot_0/word", 7, 0)]
    desk.tick(8)
    assert not desk.gatherer.is_whole


def sample(key: str, message: Message, source: str) -> RawSample:
    """A message of a session."""
    return RawSample(key, encode(message), encoding_of(type(message)), source=source)


def tick(number: int, sent: int = 1) -> list[RawSample]:
    """A tick, and the simulator's scan of it before it; `sent` since the one before."""
    stamp = time_from_ns(number * INTERVAL)
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
