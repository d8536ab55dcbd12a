"""Comparing two runs in lock-step by their recordings."""

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.examples import examples
from support.recorded import assorted, drive, entry, write
from zteam.errors import UsageError
from zteam.messages import Done, Input, LaserScan, Message, Odometry, String, Tick, Twist, Vector3, decode, encode
from zteam.record.comparing import Comparison, Difference, compare
from zteam.record.writing import Entry

TICKS = 8
Changed = Callable[[list[Entry]], list[Entry]]


@pytest.fixture
def compared(tmp_path: Path) -> Callable[..., Comparison]:
    """Compares a run with another list of messages, or with a changed copy of itself."""

    def compared(other: list[Entry] | None = None, run: list[Entry] | None = None, **options: object) -> Comparison:
        run = drive(TICKS) if run is None else run
        a = write(tmp_path / "a.mcap", run)
        return compare(a, write(tmp_path / "b.mcap", run if other is None else other), **options)  # type: ignore[arg-type]

    return compared


def at(run: list[Entry], key: str, tick: int) -> int:
    """The place of a message."""
    (place,) = (i for i, each in enumerate(run) if (each.key, each.tick) == (key, tick))
    return place


def moved(tick: int, by: float) -> list[Entry]:
    """The run in which robot 1 is elsewhere in a tick."""
    run = drive(TICKS)
    place = at(run, "robot_1/base_pose_ground_truth", tick)
    truth = decode(Odometry, run[place].data)
    truth.pose.pose.position.y += by
    run[place] = run[place]._replace(data=encode(truth))
    return run


def test_what_a_run_does_not_repeat_is_left_out(compared: Callable[..., Comparison]) -> None:
    """Sessions, counts of sent messages, logs, statuses and what was sent in the first tick may differ."""
    run = drive(TICKS)
    other = [entry("tool/note", String("from outside"), 0, 5), run[1], run[2], *drive(TICKS, session="another one")[1:]]
    found = compared(other)
    assert (found.difference, found.ticks, found.notes) == (None, TICKS - 1, [])
    assert found.left_out == ["sim/log", "tool/note"]
    assert {(topic.key, topic.a, topic.b) for topic in found.topics} >= {
        ("sim/tick", TICKS - 2, TICKS - 2), ("robot_0/done", TICKS - 1, TICKS - 1),
    }  # fmt: skip


def test_the_first_difference_is_named(compared: Callable[..., Comparison]) -> None:
    """Its tick, process, key, field and both values; the table counts the ticks."""
    found = compared(moved(5, 0.25))
    assert found.difference == Difference(
        5, "robot_1/base_pose_ground_truth", "sim", "pose.pose.position.y", "1.0", "1.25"
    )
    assert [(t.key, t.differing, t.first) for t in found.topics if t.differing] == [(found.difference.key, 1, 5)]


def test_what_came_from_outside_is_compared(compared: Callable[..., Comparison]) -> None:
    """By key, type and data, not by number; a tick that is sent again for another session is no second one."""

    def given(data: bytes, number: int, again: int) -> list[Entry]:
        run = drive(TICKS)
        came = [Input(number, "robot_0/goal_pose", "a/msg/B", np.frombuffer(data, np.uint8))]
        ticks = [Tick(tick=4, sessions=["x"] * i, inputs=came) for i in range(again)]
        run[at(run, "sim/tick", 4)] = entry("sim/tick", ticks[0], 4)
        place = at(run, "sim/tick", 4)
        run[place:place] = [entry("sim/tick", each, 4) for each in ticks[1:]]
        return run

    assert compared(given(b"go", 7, 2), given(b"go", 1, 1)).difference is None
    difference = compared(given(b"gp", 1, 1), given(b"go", 1, 1)).difference
    assert difference == Difference(4, "sim/tick", "sim", "inputs[0].data[1]", "111", "112")


def test_a_command_is_compared(compared: Callable[..., Comparison]) -> None:
    """A velocity in an answer is what its robot publishes."""
    run = drive(TICKS)
    run[at(run, "robot_1/done", 3)] = entry("robot_1/done", Done(1, 3, True, Twist(Vector3(1.5))), 3)
    difference = compared(run).difference
    assert difference == Difference(3, "robot_1/done", "robot_1", "command.linear.x", "1.0", "1.5")


def test_a_cause_comes_before_its_effect(compared: Callable[..., Comparison]) -> None:
    """Of the differences in a tick that of the ground truth is the first, and a sensor's comes before a command's."""
    run = moved(4, 1.0)
    run[at(run, "robot_0/done", 4)] = entry("robot_0/done", Done(1, 4, True), 4)
    difference = compared(run).difference
    assert difference is not None and difference.key == "robot_1/base_pose_ground_truth"
    run = drive(TICKS)
    run[at(run, "robot_0/done", 4)] = entry("robot_0/done", Done(1, 4, True), 4)
    run.insert(at(run, "sim/tick", 5), entry("robot_1/odom", Odometry(), 4))
    difference = compared(run).difference
    assert difference is not None and (difference.key, difference.text) == (
        "robot_1/odom", "tick 4: robot_1/odom of sim is in B alone",
    )  # fmt: skip


@pytest.mark.parametrize(("count", "told"), [(0, None), (2, "2 messages")])
def test_messages_that_are_missing_or_too_many(
    compared: Callable[..., Comparison], count: int, told: str | None
) -> None:
    """A topic of a tick with another number of messages differs."""
    run = drive(TICKS)
    place = at(run, "robot_0/base_pose_ground_truth", 5)
    run[place : place + 1] = [run[place]] * count
    key = "robot_0/base_pose_ground_truth"
    assert compared(run).difference == Difference(5, key, "sim", "", "1 message", told)


def test_a_run_that_ends_earlier_differs(compared: Callable[..., Comparison]) -> None:
    """The first tick that it lacks is in the other one alone, and no more of it is compared."""
    found = compared(drive(TICKS - 3))
    assert found.difference == Difference(TICKS - 3, "sim/tick", "sim", "", "1 message", None)
    assert found.ticks == TICKS - 3


def test_a_tolerance_in_the_units_of_the_field(compared: Callable[..., Comparison]) -> None:
    """A number that is off by no more than `atol` is the same, another one is not, and a missing one never is."""
    assert compared(moved(5, 1e-3), atol=1e-2).difference is None
    assert compared(moved(5, 1e-3), atol=1e-4).difference is not None
    assert compared(drive(TICKS)[:-8], atol=1e9).difference is not None
    both = moved(5, 0.25)
    place = at(both, "robot_1/base_pose_ground_truth", 6)
    both[place] = moved(6, 1e-3)[place]
    assert sum(topic.differing for topic in compared(both, atol=1e-2).topics) == 1


def test_ignored_keys(compared: Callable[..., Comparison]) -> None:
    """A key expression takes out all its keys, and the result says so."""
    found = compared(moved(5, 0.25), ignore=("robot_$*/base_pose_ground_truth",))
    assert found.difference is None and "robot_1/base_pose_ground_truth" in found.left_out


def test_arrays_are_compared_by_element(compared: Callable[..., Comparison]) -> None:
    """The index of the first beam is named; the same NaN and infinity are no difference, -0.0 for 0.0 is one."""

    def scans(*ranges: float) -> list[Entry]:
        scan = LaserScan(ranges=np.array(ranges, np.float32), range_max=np.inf)
        return [*drive(2), entry("robot_0/base_scan", scan, 2), *drive(TICKS)[11:]]

    nan = float("nan")
    quiet = [np.float32(nan), np.uint32(0x7FC00001).view(np.float32)]
    assert compared(scans(1.0, quiet[1], np.inf), scans(1.0, quiet[0], np.inf)).difference is None
    assert compared(scans(1.0, nan, np.inf), scans(1.0, nan, np.inf), atol=0.1).difference is None
    for other in (2.5, nan, np.inf):
        difference = compared(scans(1.0, other), scans(1.0, 2.0), atol=0.1).difference
        assert difference is not None and (difference.field, difference.a) == ("ranges[1]", "2.0")
    assert compared(scans(0.0), scans(-0.0)).difference is not None
    assert compared(scans(0.0), scans(-0.0), atol=1e-9).difference is None
    longer = compared(scans(1.0, 2.0), scans(1.0)).difference
    assert longer is not None and (longer.field, longer.a, longer.b) == ("ranges.length", "1", "2")


def test_two_writers_of_a_key_have_no_order(compared: Callable[..., Comparison]) -> None:
    """On a key of any process the messages of a tick may come in another order; those of a sensor may not."""

    def pair(key: str, *messages: Message) -> list[Entry]:
        run = drive(TICKS)
        run[at(run, "sim/tick", 3) : 0] = [entry(key, each, 2) for each in messages]
        return run

    one, two = String("one"), String("two")
    assert compared(pair("notes", two, one), pair("notes", one, two)).difference is None
    difference = compared(pair("robot_0/odom", two, one), pair("robot_0/odom", one, two)).difference
    assert difference is not None and (difference.tick, difference.field, difference.a) == (2, "data", "one")


def test_a_world_that_begins_anew_is_compared_again(compared: Callable[..., Comparison]) -> None:
    """Ticks of the second world are no ticks of the first one."""
    found = compared(drive(TICKS) + moved(5, 1.0), drive(TICKS) + drive(TICKS))
    assert found.ticks == 2 * (TICKS - 1)
    assert found.difference is not None and found.difference.tick == 5
    shorter = compared(drive(TICKS - 2) + drive(TICKS), drive(TICKS) + drive(TICKS))
    assert shorter.difference is not None and (shorter.difference.tick, shorter.difference.b) == (TICKS - 2, None)


def test_doubts_are_noted(tmp_path: Path) -> None:
    """A file that was cut off, one that lacks messages, and a process outside of its steps: one line each."""
    a = write(tmp_path / "a.mcap", drive(TICKS), finished=False)
    b = write(tmp_path / "b.mcap", drive(TICKS), gaps="tick 3: 1 of 2 messages of sim have come", stray="mine notes")
    found = compare(a, b)
    assert found.difference is None and len(found.notes) == 3


def test_a_message_behind_the_next_tick_belongs_to_its_own(compared: Callable[..., Comparison]) -> None:
    """Where an answer came late, and the next tick is in the file before it, the runs are the same."""
    run = drive(TICKS)
    late = run.pop(at(run, "robot_1/done", 4))
    run.insert(at(run, "sim/tick", 5) + 1, late)
    assert compared(run).difference is None


def test_a_run_without_ticks_is_refused(tmp_path: Path) -> None:
    """A recording of real time, or one without messages, has nothing to compare."""
    a, b = write(tmp_path / "a.mcap", drive(TICKS)), write(tmp_path / "b.mcap", [entry("clock", String(), 0, 1)])
    for other in (b, write(tmp_path / "c.mcap", [])):
        with pytest.raises(UsageError, match=f"^{other} has no ticks"):
            compare(a, other)


@examples(300)
@given(data=st.data())
def test_any_single_change_is_found(data: st.DataObject) -> None:
    """A message of a tick that is over, which is taken away or has another bit, is the difference, in that tick."""
    run = sorted([*assorted(TICKS), *drive(TICKS)], key=lambda each: (each.tick or 1, each.key != "sim/tick"))
    places = [i for i, each in enumerate(run) if 2 <= each.tick < TICKS and each.key in ("robot_0/base_scan", "clock")]
    place = data.draw(st.sampled_from(places))
    changed = bytearray(run[place].data)
    # All that both types begin with: a time.
    changed[data.draw(st.integers(4, 11))] ^= data.draw(st.sampled_from([1, 2, 64]))
    other = list(run)
    other[place : place + 1] = [run[place]._replace(data=bytes(changed))] if data.draw(st.booleans()) else []
    with tempfile.TemporaryDirectory() as folder:
        found = compare(write(Path(folder) / "a.mcap", run), write(Path(folder) / "b.mcap", other))
    assert found.difference is not None
    assert (found.difference.tick, found.difference.key) == (run[place].tick, run[place].key)
