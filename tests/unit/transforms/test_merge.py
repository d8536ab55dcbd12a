"""The merger: names, permitted frames, conflicts and bundles of the robots' transforms."""

import math
from random import Random
from typing import Any

import pytest
from hypothesis import given

from support.arrivals import TICK, Data, Event, Sent, arrive, orders, sent_messages
from support.transforms import S, stamped
from zteam import clock
from zteam.messages import (
    Quaternion,
    TFMessage,
    TransformStamped,
    ns_from_time,
)
from zteam.transforms.merge import MAX_CONFLICTS, MAX_HELD, Merger


def _names(transforms: list[TransformStamped]) -> list[tuple[str, str]]:
    return [(t.header.frame_id, t.child_frame_id) for t in transforms]


def _without_rotation(transform: TransformStamped) -> TransformStamped:
    transform.transform.rotation = Quaternion(0.0, 0.0, 0.0, 0.0)
    return transform


def test_a_second_authority_is_refused_and_named() -> None:
    """The first authority of a static frame stays, and the conflict names both."""
    merger = Merger([stamped("robot_0/base_link", "robot_0/camera", 0, 0.1)])
    merger.take_static(0, TFMessage([stamped("base_link", "camera", 0, 0.2)]))
    (conflict,) = merger.take_conflicts()
    assert "team_file" in conflict
    assert "robot_0" in conflict
    assert merger.statics.message().transforms[0].transform.translation.x == 0.1


def test_an_older_message_takes_back_no_newer_parent() -> None:
    """Late history of a source comes after its newer message: the newer parent of the frame stays."""
    merger = Merger()
    merger.take_static(0, TFMessage([stamped("base_link", "camera", 0)]), "driver", clock.Sent(2))
    merger.take_static(0, TFMessage([stamped("base_footprint", "camera", 0)]), "driver", clock.Sent(1))
    assert _names(merger.statics.message().transforms) == [("robot_0/base_link", "robot_0/camera")]


def test_a_robot_is_seen_from_another() -> None:
    """Start poses, odometry and static transforms of two robots form one path between them."""
    merger = Merger()
    for robot, y in ((0, 1.0), (3, 4.0)):
        start = [stamped("map", "odom", 0, 0.0, y), stamped("base_footprint", "base_link", 0, 0.1)]
        merger.take_static(robot, TFMessage(start))
        for stamp in (S // 2, (robot + 1) * S):
            merger.take(robot, TFMessage([stamped("odom", "base_footprint", stamp, float(robot))]))
    pose, stamp = merger.buffer.lookup_pose2("robot_0/base_link", "robot_3/base_link", 0)
    assert pose == pytest.approx((3.0, 3.0, 0.0))
    assert stamp == S


def test_stamps_and_numbers_are_passed_on_as_they_came() -> None:
    """The bundle has all robots' transforms in the order of their arrival, with their own stamps."""
    merger = Merger()
    for robot, stamp in ((2, 7 * S + 1), (0, 5 * S), (2, 7 * S + 2)):
        merger.take(robot, TFMessage([stamped("odom", "base_footprint", stamp, 0.25, 0.5, 1.0)]))
    pending = merger.take_pending()
    assert [ns_from_time(t.header.stamp) for t in pending] == [7 * S + 1, 5 * S, 7 * S + 2]
    assert [t.child_frame_id for t in pending] == [f"robot_{i}/base_footprint" for i in (2, 0, 2)]
    assert pending[1].transform == stamped("", "", 0, 0.25, 0.5, 1.0).transform
    assert merger.take_pending() == []


def test_a_ticks_bundle_ends_with_its_bases() -> None:
    """What was sent in the tick before stands before them; what was sent in the tick waits, whatever stamp it has."""
    merger = Merger()
    for frame, stamp, tick in (
        ("base_footprint", 2, 1),
        ("carrot", 1, 1),
        ("hat", 2, 2),
        ("flag", 9, 2),
        ("cap", 1, 2),
    ):
        merger.take(0, TFMessage([stamped("odom", frame, stamp * S)]), tick=tick * S)
    now = merger.take_pending(2 * S)
    assert [child for _, child in _names(now)] == ["robot_0/carrot", "robot_0/base_footprint"]
    later = merger.take_pending(3 * S)
    assert [child for _, child in _names(later)] == ["robot_0/cap", "robot_0/flag", "robot_0/hat"]


FRAMES = (("map", "odom"), ("odom", "carrot"), ("base_footprint", "carrot"), ("odom", "hat"))


def merge(events: list[Event]) -> list[Any]:
    """The bundles and the fixed transforms of each tick, and the conflicts."""
    merger, found = Merger(), list[Any]()
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 1.0)]))
    opened = 0
    for event in events:
        if isinstance(event, Data):
            # As the aggregator: all that the bundle waits for has come.
            opened = event.tick * TICK
            merger.take(0, TFMessage([stamped("odom", "base_footprint", opened)]), opened, opened)
            found += [merger.take_pending(opened), merger.statics.message().transforms]
        elif isinstance(event, Sent):
            parent, child = FRAMES[event.topic]
            frame = stamped(parent, child, event.stamp_ns, float(event.value))
            merger.take(0, TFMessage([frame]), opened, opened)
    return [*found, sorted(merger.conflicts())]


@given(sent_messages(len(FRAMES)), orders())
def test_the_order_of_arrival_changes_no_bundle(sent: list[Sent], ways: list[Random]) -> None:
    """Frames of three senders in a tick, in two orders, that may contradict each other: the same bundles, the same
    fixed transforms, the same refusals. Frames are taken by their arrival, because their stamps may be of the future.
    """
    first, second = (merge(arrive(sent, random, early=False)) for random in ways)
    assert first == second


def test_a_localiser_of_lock_step_takes_over_with_its_bundle() -> None:
    """Until the bundle that has its first pose, the static start pose holds: then it ends, and not before."""
    merger = Merger()
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 1.0)]))
    assert [child for _, child in _names(merger.statics.message().transforms)] == ["robot_0/odom"]
    merger.take(0, TFMessage([stamped("odom", "base_footprint", S)]))
    merger.take(0, TFMessage([stamped("map", "odom", S, 2.0)]), tick=S)
    assert not merger.statics.changed
    assert [child for _, child in _names(merger.take_pending(S))] == ["robot_0/base_footprint"]
    assert not merger.statics.changed
    assert merger.buffer.lookup_pose2("map", "robot_0/base_footprint", 0)[0].x == 1.0
    assert [child for _, child in _names(merger.take_pending(2 * S))] == ["robot_0/odom"]
    assert merger.statics.changed
    assert merger.statics.message().transforms == []
    assert merger.buffer.lookup_pose2("map", "robot_0/base_footprint", 0)[0].x == 2.0


def test_a_jump_back_forgets_what_waits_for_a_bundle() -> None:
    """Neither a localiser's pose nor a frame of the old time travels after a jump back in time."""
    merger = Merger()
    merger.take(0, TFMessage([stamped("map", "odom", S), stamped("odom", "carrot", S)]), tick=S)
    merger.jump_back()
    assert merger.take_pending(9 * S) == []


def test_what_is_refused_is_not_passed_on() -> None:
    """Samples that are too old, contradict a stored one or are not finite stay out of the bundle."""
    merger = Merger()
    merger.take(0, TFMessage([stamped("odom", "base", 50 * S, 1.0)]))
    merger.take_pending()
    for bad in (
        stamped("odom", "base", S),
        stamped("odom", "base", 50 * S, 2.0),
        stamped("odom", "base", 51 * S, math.nan),
        _without_rotation(stamped("odom", "base", 51 * S)),
    ):
        merger.take(0, TFMessage([bad]))
    assert merger.take_pending() == []
    conflicts = merger.take_conflicts()
    assert conflicts
    assert all("robot_0" in text for text in conflicts)


def test_one_bad_transform_does_not_spoil_a_message() -> None:
    """The other transforms of the message are stored."""
    merger = Merger()
    good, bad = stamped("odom", "base_footprint", S), stamped("map", "/robot_1/odom", S)
    merger.take(0, TFMessage([bad, good]))
    assert _names(merger.take_pending()) == [("robot_0/odom", "robot_0/base_footprint")]
    merger.take_static(0, TFMessage([bad, stamped("base_footprint", "base_link", 0)]))
    assert _names(merger.statics.message().transforms) == [("robot_0/base_footprint", "robot_0/base_link")]


def test_a_robot_may_not_bend_the_map() -> None:
    """No robot may publish a global frame, or a frame of a robot whose name begins with its own."""
    merger = Merger()
    for parent, child in (("earth", "map"), ("robot_1/base", "/map"), ("map", "/robot_10/odom"), ("/robot_10/x", "y")):
        merger.take(1, TFMessage([stamped(parent, child, S)]))
        merger.take_static(1, TFMessage([stamped(parent, child, 0)]))
    assert merger.buffer.frames() == {}
    assert merger.take_pending() == []
    assert merger.statics.message().transforms == []
    assert len(merger.take_conflicts()) == 3


def test_a_robots_loop_is_refused_and_reported_once() -> None:
    """A transform that closes a loop is refused, and the conflict names the robot."""
    merger = Merger()
    for _ in range(3):
        merger.take(4, TFMessage([stamped("odom", "a", S), stamped("a", "b", S), stamped("b", "odom", S)]))
    (conflict,) = merger.take_conflicts()
    assert "loop" in conflict
    assert "robot_4" in conflict
    assert _names(merger.take_pending())[:2] == [("robot_4/odom", "robot_4/a"), ("robot_4/a", "robot_4/b")]


@pytest.mark.parametrize(("parent", "child"), [("", "base"), ("odom", "")])
def test_a_robots_nameless_frames_are_refused(parent: str, child: str) -> None:
    """An empty name is refused, although a prefix would be put before it."""
    merger = Merger()
    merger.take(0, TFMessage([stamped(parent, child, S)]))
    merger.take_static(0, TFMessage([stamped(parent, child, 0)]))
    assert merger.buffer.frames() == {}
    assert merger.take_conflicts()


def test_two_publishers_of_one_edge_are_reported() -> None:
    """Two values for one frame at one time are a conflict: they must come from two sources."""
    merger = Merger()
    merger.take(0, TFMessage([stamped("odom", "base_footprint", S, 1.0)]))
    merger.take(0, TFMessage([stamped("odom", "base_footprint", S, 2.0)]))
    (conflict,) = merger.take_conflicts()
    assert "robot_0/base_footprint" in conflict


def test_an_exact_duplicate_is_not_sent_again() -> None:
    """A sample that is stored already is not bundled again."""
    merger = Merger()
    for _ in range(2):
        merger.take(0, TFMessage([stamped("odom", "base_footprint", S, 1.0)]))
    assert len(merger.take_pending()) == 1


def test_a_stamp_far_from_a_clock_that_is_not_trusted_is_no_conflict() -> None:
    """After a freeze or a cut link transforms come before the clock: they are refused, and nobody is accused."""
    merger = Merger()
    merger.take(1, TFMessage([stamped("odom", "base_footprint", 100 * S)]), now=50 * S, trusts=False)
    assert (merger.conflicts(), merger.take_pending()) == ([], [])


def test_a_clock_that_runs_apart_is_refused_and_named() -> None:
    """A stamp far from the team's clock is refused and reported once; the robot's right samples are stored."""
    merger = Merger()
    for wrong in (100 * S, 100 * S + 1, 20 * S):
        merger.take(1, TFMessage([stamped("odom", "base_footprint", wrong)]), now=50 * S)
    merger.take(1, TFMessage([stamped("odom", "base_footprint", 50 * S)]), now=50 * S)
    ahead, behind = merger.take_conflicts()
    assert "robot_1 is 50.0 s ahead of the team's clock" in ahead
    assert "30.0 s behind" in behind
    assert merger.conflicts() == [ahead, behind]
    assert merger.buffer.frames()["robot_1/base_footprint"].newest == 50 * S
    assert len(merger.take_pending()) == 1


def test_each_conflict_is_recorded_and_taken_once() -> None:
    """Another frame, authority or code is another conflict; the same three again keep the first text."""
    merger = Merger()
    merger.take(0, TFMessage([stamped("odom", "a", 50 * S)]))
    for child in ("/robot_5/a", "/robot_5/b", "/robot_5/a"):
        merger.take(0, TFMessage([stamped("odom", child, S)]))
    foreign = merger.take_conflicts()
    assert len(foreign) == 2
    merger.take(1, TFMessage([stamped("odom", "/robot_5/a", S)]))
    for stamp, x in ((S, 0.0), (2 * S, 0.0), (50 * S, 1.0)):
        merger.take(0, TFMessage([stamped("odom", "a", stamp, x)]))
    assert len(merger.take_conflicts()) == 3
    assert merger.take_conflicts() == []
    assert merger.conflicts()[:2] == foreign
    assert len(merger.conflicts()) == 5


def test_the_number_of_conflicts_is_bounded() -> None:
    """A robot that invents frames without end does not fill the memory."""
    merger = Merger()
    for number in range(MAX_CONFLICTS + 5):
        merger.take(0, TFMessage([stamped("odom", f"/frame_{number}", S)]))
    assert len(merger.conflicts()) == len(merger.take_conflicts()) == MAX_CONFLICTS
    assert f"frame_{MAX_CONFLICTS - 1} " in merger.conflicts()[-1]


def test_frames_that_wait_for_a_tick_are_bounded() -> None:
    """The world stands still while a process sends frames of a robot: a thousand wait, more are a conflict, and those
    of another robot are taken."""
    merger = Merger()
    for number in range(2 * MAX_HELD):
        merger.take(0, TFMessage([stamped("base_link", f"tag_{number % 7}", number + 1)]), tick=S)
    merger.take(1, TFMessage([stamped("base_link", "tag", 1)]), tick=S)
    assert merger.conflicts() == ["robot_0 sends more than 1000 frames within a tick: the others do not count"]
    assert len(merger.take_pending(2 * S)) == MAX_HELD + 1


def test_a_stamp_ahead_of_all_clocks_is_refused_before_the_time_is_known() -> None:
    """Else the base of a robot whose host's clock was ahead would be too old for good after that clock was set."""
    merger = Merger()
    merger.take(0, TFMessage([stamped("odom", "base_footprint", 5000 * S)]), wall=1000 * S)
    merger.take(0, TFMessage([stamped("odom", "base_footprint", S)]), wall=1000 * S)
    assert merger.take_pending() == [stamped("robot_0/odom", "robot_0/base_footprint", S)]
    assert "4000.0 s ahead of the team's clock" in merger.conflicts()[0]


@pytest.mark.parametrize("x", [2e9, -1.7e308, math.inf, math.nan])
def test_a_frame_that_is_nowhere_near_is_a_conflict(x: float) -> None:
    """Readers of the team's tree could not compute with it, moving or fixed."""
    merger = Merger()
    merger.take(0, TFMessage([stamped("odom", "base_footprint", S, x)]))
    merger.take_static(0, TFMessage([stamped("base_link", "camera", 0, x)]))
    assert merger.take_pending() == merger.statics.message().transforms == []
    assert len(merger.conflicts()) == 2
