"""The merger: names, permitted frames, conflicts and bundles of the robots' transforms."""

import math
from random import Random
from typing import Any

import pytest
from hypothesis import given

from support.arrivals import TICK, Data, Event, Sent, arrive, orders, sent_messages
from support.transforms import S, stamped
from zteam import clock
from zteam.messages import TFMessage, TransformStamped, ns_from_time
from zteam.transforms.merge import MAX_CONFLICTS, MAX_HELD, Merger
from zteam.transforms.static_transforms import Rank, Static


def children(transforms: list[TransformStamped]) -> list[str]:
    """The children, without `robot_0/`."""
    return [transform.child_frame_id.removeprefix("robot_0/") for transform in transforms]


def merged(*transforms: TransformStamped) -> tuple[list[TransformStamped], list[str]]:
    """What is sent on of a message of robot 3, and the conflicts; fixed transforms are judged alike."""
    merger, fixed = Merger(), Merger()
    merger.receive(3, TFMessage([*transforms]))
    fixed.receive_static(3, TFMessage([*transforms]))
    assert fixed.conflicts() == merger.conflicts()
    return merger.take_pending(), merger.conflicts()


@pytest.mark.parametrize(
    ("parent", "child"), [("odom", "laser"), ("robot_3/odom", "robot_3/laser"), ("/robot_3/odom", "/robot_3/laser")]
)
def test_names_are_resolved_and_the_rest_stays(parent: str, child: str) -> None:
    """Every spelling gives the full names; stamp and numbers stay as they are, and `map` has no prefix."""
    first, second = merged(stamped(parent, child, S, 1.0), stamped("map", "odom", S))[0]
    assert first == stamped("robot_3/odom", "robot_3/laser", S, 1.0)
    assert second == stamped("map", "robot_3/odom", S)


def test_a_transform_with_full_names_is_not_copied() -> None:
    """As the simulator publishes them: a message in memory and the bundle share it."""
    full, local = stamped("robot_3/odom", "robot_3/base_footprint", S), stamped("odom", "laser", S)
    kept, _ = merged(full, local)
    assert kept[1] is full
    assert local == stamped("odom", "laser", S)


@pytest.mark.parametrize(
    ("parent", "child", "text"),
    [
        ("odom", "/robot_4/base_link", "robot_3 may not say where robot_4/base_link is"),
        ("odom", "/robot_33/base_link", "robot_3 may not say where robot_33/base_link is"),
        ("earth", "map", "robot_3 may not say where map is"),
        ("odom", "", "robot_3 may not say where robot_3/ is"),
        ("odom", "/", "robot_3 may not say where nothing is"),
        ("/robot_4/odom", "base_link", "robot_3 may not hang robot_3/base_link under robot_4/odom"),
        ("", "base_link", "robot_3 may not hang robot_3/base_link under robot_3/"),
        ("/", "base_link", "robot_3 may not hang robot_3/base_link under nothing"),
    ],
)
def test_other_frames_are_left_out_and_reported(parent: str, child: str, text: str) -> None:
    """The text names the robot and the frame that is not its own; the next transform is kept."""
    kept = merged(stamped(parent, child, S), stamped("odom", "base_footprint", S))
    assert kept == ([stamped("robot_3/odom", "robot_3/base_footprint", S)], [text])


def test_a_bundle_has_each_sample_once_in_the_order_of_arrival() -> None:
    """With its own stamp and numbers; a sample that is sent again is not bundled again."""
    merger = Merger()
    for robot, stamp in ((2, 7 * S + 1), (0, 5 * S), (2, 7 * S + 2), (0, 5 * S)):
        merger.receive(robot, TFMessage([stamped("odom", "base_footprint", stamp, 0.25, 0.5, 1.0)]))
    pending = merger.take_pending()
    assert [(t.child_frame_id, ns_from_time(t.header.stamp)) for t in pending] == [
        ("robot_2/base_footprint", 7 * S + 1),
        ("robot_0/base_footprint", 5 * S),
        ("robot_2/base_footprint", 7 * S + 2),
    ]
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
        merger.receive(0, TFMessage([stamped("odom", frame, stamp * S)]), tick=tick * S)
    assert children(merger.take_pending(2 * S)) == ["carrot", "base_footprint"]
    assert children(merger.take_pending(3 * S)) == ["cap", "flag", "hat"]


FRAMES = (("map", "odom"), ("odom", "carrot"), ("base_footprint", "carrot"), ("odom", "hat"))


def merge(events: list[Event]) -> list[Any]:
    """The bundles and the fixed transforms of each tick, and the conflicts."""
    merger, found = Merger(), list[Any]()
    merger.receive_static(0, TFMessage([stamped("map", "odom", 0, 1.0)]))
    opened = 0
    for event in events:
        if isinstance(event, Data):
            # As the aggregator: all that the bundle waits for has come.
            opened = event.tick * TICK
            merger.receive(0, TFMessage([stamped("odom", "base_footprint", opened)]), opened, opened)
            found += [merger.take_pending(opened), merger.statics.message().transforms]
        elif isinstance(event, Sent):
            parent, child = FRAMES[event.topic]
            frame = stamped(parent, child, event.stamp_ns, float(event.value))
            merger.receive(0, TFMessage([frame]), opened, opened)
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
    merger.receive_static(0, TFMessage([stamped("map", "odom", 0, 1.0)]))
    merger.statics.message()
    merger.receive(0, TFMessage([stamped("odom", "base_footprint", S)]))
    merger.receive(0, TFMessage([stamped("map", "odom", S, 2.0)]), tick=S)
    assert children(merger.take_pending(S)) == ["base_footprint"]
    assert not merger.statics.changed
    assert merger.buffer.lookup_pose2("map", "robot_0/base_footprint", 0)[0].x == 1.0
    assert children(merger.take_pending(2 * S)) == ["odom"]
    assert merger.statics.changed
    assert merger.statics.message().transforms == []
    assert merger.buffer.lookup_pose2("map", "robot_0/base_footprint", 0)[0].x == 2.0


@pytest.mark.parametrize("rank", Rank)
def test_only_the_team_file_fixes_a_start_pose(rank: Rank) -> None:
    """Every other source gives way to a localiser, in either order of arrival, and nothing of it is a conflict."""
    for localiser_first in (False, True):
        merger = Merger()
        steps = [
            lambda merger: merger.statics.put(Static(rank, stamped("map", "robot_0/odom", 0, 1.0), "source")),
            lambda merger: merger.receive(0, TFMessage([stamped("map", "odom", S, 2.0)])),
        ]
        for step in reversed(steps) if localiser_first and rank != Rank.TEAM_FILE else steps:
            step(merger)
        is_fixed = rank == Rank.TEAM_FILE
        assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == (1.0 if is_fixed else 2.0)
        assert children(merger.take_pending()) == ([] if is_fixed else ["odom"])
        assert merger.conflicts() == []


def test_a_jump_back_keeps_what_does_not_move() -> None:
    """It forgets moving data and what waits for a bundle; a start pose holds again until its localiser publishes."""
    merger = Merger()
    merger.receive_static(0, TFMessage([stamped("map", "odom", 0, 2.0)]))
    for tick in (0, S):
        frames = [
            stamped("map", "odom", 100 * S, 3.0),
            stamped("odom", "base_footprint", 100 * S),
            stamped("odom", "hat", S),
        ]
        merger.receive(0, TFMessage(frames), tick=tick)
    merger.jump_back()
    assert merger.take_pending() == []
    assert list(merger.buffer.frames()) == ["robot_0/odom"]
    merger.receive(0, TFMessage([stamped("odom", "base_footprint", S, 5.0)]))
    assert merger.buffer.lookup_pose2("map", "robot_0/base_footprint", 0)[0].x == 7.0
    merger.receive(0, TFMessage([stamped("map", "odom", S, 4.0)]))
    assert merger.buffer.lookup_pose2("map", "robot_0/base_footprint", 0)[0].x == 9.0
    assert len(merger.take_pending()) == 2


def test_fixed_sets_are_merged_by_child_frame() -> None:
    """A message with one frame more, of the same source or another one, takes no other frame away, as in tf2; one that
    was sent before changes no parent. A set that is turned round is no loop with the one before."""
    merger = Merger()
    for transforms, source, sent in (
        ([stamped("map", "odom", 0), stamped("odom", "mark", 0)], "sim", 1),
        ([stamped("map", "odom", 0, 2.0)], "sim", 2),
        ([stamped("base_link", "camera", 0)], "driver", 2),
        ([stamped("base_footprint", "camera", 0)], "driver", 1),
        ([stamped("camera", "base_link", 0)], "driver", 3),
    ):
        merger.receive_static(0, TFMessage(transforms), source, clock.Sent(sent))
    assert [(t.header.frame_id, t.transform.translation.x) for t in merger.statics.message().transforms] == [
        ("robot_0/camera", 0.0),
        ("robot_0/odom", 0.0),
        ("map", 2.0),
    ]
    authorities = {child: frame.authority for child, frame in merger.buffer.frames().items()}
    assert authorities == {"robot_0/base_link": "driver", "robot_0/mark": "sim", "robot_0/odom": "sim"}


def test_a_tool_adds_frames_that_nobody_has() -> None:
    """It may change its own, and a start pose until the simulator gives one; the reason of a refusal is returned each
    time it asks. A frame of a tool that has ended is free."""
    merger = Merger()
    merger.receive(1, TFMessage([stamped("odom", "base_footprint", S, 1.0)]))
    for parent, child, tool, refused in (
        ("map", "table", "tool", ""),
        ("map", "table", "other", "tool publishes table already"),
        ("map", "table", "tool", ""),
        ("map", "", "tool", "child_frame_id"),
        ("table", "map", "tool", "loop"),
        ("table", "map", "tool", "loop"),
        ("map", "robot_1/base_footprint", "tool", "robot_1 publishes robot_1/base_footprint already"),
        ("map", "robot_0/odom", "tool", ""),
    ):
        why = merger.add_static(stamped(parent, child, 0, 9.0), tool)
        assert refused in why
        assert bool(why) == bool(refused)
    merger.receive_static(0, TFMessage([stamped("map", "odom", 0, 2.0)]))
    assert merger.conflicts() == []
    merger.statics.drop_authority("tool")
    assert [t.transform.translation.x for t in merger.statics.message().transforms] == [2.0]
    assert merger.add_static(stamped("map", "table", 0, 5.0), "other") == ""


def test_what_is_refused_is_a_conflict_and_not_passed_on() -> None:
    """Too old, contradictory, not finite, without a rotation, far away, static in the team file, a loop: each is
    recorded once, and the rest of its message is stored."""
    merger = Merger([stamped("robot_0/base_link", "robot_0/camera", 0, 0.1)])
    merger.receive(0, TFMessage([stamped("odom", "base", 50 * S, 1.0)]))
    merger.take_pending()
    flat = stamped("odom", "base", 51 * S)
    flat.transform.rotation.w = 0.0
    for number, (bad, text) in enumerate(
        [
            (stamped("odom", "base", S), "base from robot_0 is older"),
            (stamped("odom", "base", 50 * S, 2.0), "robot_0/base has a sample"),
            (flat, "no unit quaternion"),
            (stamped("odom", "base", 51 * S, math.nan), "from robot_0 is more than 1e+09 m away"),
            (stamped("base_link", "camera", S, 0.5), "static by team_file: robot_0's"),
            (stamped("base", "odom", 51 * S), "by robot_0 closes a loop"),
        ],
        start=1,
    ):
        for stamp in (2 * number, 2 * number + 1):
            merger.receive(0, TFMessage([bad, stamped("base_link", "fine", stamp)]))
        assert text in merger.conflicts()[-1]
        assert len(merger.conflicts()) == number
        assert children(merger.take_pending()) == ["fine", "fine"]
    assert merger.buffer.lookup_pose2("robot_0/base_link", "robot_0/camera", 0)[0].x == 0.1


@pytest.mark.parametrize("x", [2e9, -1.7e308, math.inf, math.nan])
def test_a_frame_that_is_nowhere_near_is_a_conflict(x: float) -> None:
    """Readers of the team's tree could not compute with it, moving or fixed, whichever of its numbers is meant."""
    for axis in "xyz":
        transform = stamped("odom", "base_footprint", S)
        setattr(transform.transform.translation, axis, x)
        assert merged(transform)[0] == []


def test_a_clock_that_runs_apart_is_refused_and_named() -> None:
    """A stamp far from the team's clock is refused and reported once; the robot's right samples are stored. After a
    freeze transforms come before the clock: they are refused, and nobody is accused."""
    merger = Merger()
    merger.receive(1, TFMessage([stamped("odom", "base_footprint", 100 * S)]), now=50 * S, trusts=lambda: False)
    assert merger.conflicts() == []
    for wrong in (100 * S, 100 * S + 1, 20 * S):
        merger.receive(1, TFMessage([stamped("odom", "base_footprint", wrong)]), now=50 * S)
    for right in (40 * S, 60 * S):
        merger.receive(1, TFMessage([stamped("odom", f"base_{right}", right)]), now=50 * S)
    ahead, behind = merger.conflicts()
    assert "robot_1 is 50.0 s ahead of the team's clock" in ahead
    assert "30.0 s behind" in behind
    assert len(merger.take_pending()) == 2


def test_a_stamp_ahead_of_all_clocks_is_refused_before_the_time_is_known() -> None:
    """Else the base of a robot whose host's clock was ahead would be too old for good after that clock was set."""
    merger = Merger()
    for stamp in (5000 * S, S):
        merger.receive(0, TFMessage([stamped("odom", "base_footprint", stamp)]), wall=1000 * S)
    assert merger.take_pending() == [stamped("robot_0/odom", "robot_0/base_footprint", S)]
    assert "4000.0 s ahead of the team's clock" in merger.conflicts()[0]


def test_each_conflict_is_taken_once_and_their_number_is_bounded() -> None:
    """Another frame, authority or code is another conflict; a robot that invents frames does not fill the memory."""
    merger = Merger()
    merger.receive(0, TFMessage([stamped("odom", "a", 50 * S)]))
    for robot, child, stamp, x in (
        (0, "/robot_5/a", S, 0.0),
        (0, "/robot_5/b", S, 0.0),
        (0, "/robot_5/a", S, 0.0),
        (1, "/robot_5/a", S, 0.0),
        (0, "a", S, 0.0),
        (0, "a", 2 * S, 0.0),
        (0, "a", 50 * S, 1.0),
    ):
        merger.receive(robot, TFMessage([stamped("odom", child, stamp, x)]))
    first = merger.conflicts()
    assert len(first) == 5
    for number in range(MAX_CONFLICTS):
        merger.receive(0, TFMessage([stamped("odom", f"/frame_{number}", S)]))
    assert merger.conflicts()[:5] == first
    assert len(merger.conflicts()) == MAX_CONFLICTS


def test_frames_that_wait_for_a_tick_are_bounded() -> None:
    """The world stands still while a process sends frames of a robot: a thousand wait, more are a conflict, and those
    of another robot are taken."""
    merger = Merger()
    for number in range(2 * MAX_HELD):
        merger.receive(0, TFMessage([stamped("base_link", f"tag_{number % 7}", number + 1)]), tick=S)
    merger.receive(1, TFMessage([stamped("base_link", "tag", 1)]), tick=S)
    assert merger.conflicts() == ["robot_0 sends more than 1000 frames within a tick: the others do not count"]
    assert len(merger.take_pending(2 * S)) == MAX_HELD + 1
