"""Start poses from several sources, and full sets of static transforms that change in time."""

import pytest

from support.transforms import S, stamped
from zteam.messages import Quaternion, TFMessage, TransformStamped
from zteam.transforms.merge import Merger
from zteam.transforms.static_transforms import Rank, Static


def _names(transforms: list[TransformStamped]) -> list[tuple[str, str]]:
    return [(t.header.frame_id, t.child_frame_id) for t in transforms]


def _without_rotation(transform: TransformStamped) -> TransformStamped:
    transform.transform.rotation = Quaternion(0.0, 0.0, 0.0, 0.0)
    return transform


def test_map_is_never_prefixed() -> None:
    """A robot's start pose has the team's `map` as its parent, without the robot's prefix."""
    merger = Merger()
    merger.take_static(2, TFMessage([stamped("map", "odom", 0, 6.5, 16.5)]))
    assert merger.buffer.lookup_pose2("map", "robot_2/odom", 0)[0][:2] == (6.5, 16.5)


def test_the_team_file_wins_over_everyone() -> None:
    """The team file's start pose replaces the simulator's and a localiser's, without a conflict."""
    merger = Merger([stamped("map", "robot_0/odom", 0, 1.0)])
    merger.take_static(0, TFMessage([stamped("map", "robot_0/odom", 0, 2.0)]))
    merger.take(0, TFMessage([stamped("map", "robot_0/odom", S, 3.0)]))
    assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == 1.0
    assert [t.transform.translation.x for t in merger.statics.message().transforms] == [1.0]
    assert merger.take_conflicts() == []


@pytest.mark.parametrize("rank", Rank)
def test_only_the_team_file_fixes_a_start_pose(rank: Rank) -> None:
    """Every other source gives way to a localiser."""
    merger = Merger()
    merger.statics.put(Static(rank, stamped("map", "robot_0/odom", 0, 1.0), "source"))
    merger.take(0, TFMessage([stamped("map", "odom", S, 2.0)]))
    x = merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x
    assert x == (1.0 if rank == Rank.TEAM_FILE else 2.0)


def test_a_localiser_wins_over_the_simulator() -> None:
    """From the localiser's first transform on, the start pose is not in the static set, in either order of arrival."""
    for localiser_first in (False, True):
        merger = Merger()
        start = TFMessage([stamped("map", "odom", 0, 2.0), stamped("base_footprint", "base_link", 0)])
        moving = TFMessage([stamped("map", "odom", S, 3.0)])
        if localiser_first:
            merger.take(0, moving)
            merger.take_static(0, start)
        else:
            merger.take_static(0, start)
            merger.take(0, moving)
        assert merger.statics.changed
        assert [t.child_frame_id for t in merger.statics.message().transforms] == ["robot_0/base_link"]
        assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == 3.0
        assert merger.take_conflicts() == []


def test_a_callers_frames_live_as_long_as_the_caller() -> None:
    """A tool's static transforms are forgotten when the tool ends."""
    merger = Merger()
    assert merger.add_static(stamped("map", "table", 0, 4.0), "tool") == ""
    assert "tool already" in merger.add_static(stamped("map", "table", 0, 5.0), "other")
    merger.statics.drop_authority("tool")
    assert merger.statics.message().transforms == []
    assert merger.add_static(stamped("map", "table", 0, 5.0), "other") == ""


def test_a_moved_start_pose_replaces_the_old_one() -> None:
    """A new start pose from the simulator, as after a move, replaces the old one."""
    merger = Merger()
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 1.0)]))
    merger.statics.message()
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 9.0)]))
    assert merger.statics.changed
    assert merger.statics.message().transforms[0].transform.translation.x == 9.0


def test_moving_data_for_a_frame_of_the_team_file_is_a_conflict() -> None:
    """The team file's static transform stays, and the conflict names both sources."""
    merger = Merger([stamped("robot_0/base_link", "robot_0/camera", 0, 0.1)])
    merger.take(0, TFMessage([stamped("base_link", "camera", S, 0.5)]))
    assert merger.take_pending() == []
    (conflict,) = merger.take_conflicts()
    assert "team_file" in conflict
    assert "robot_0" in conflict
    assert merger.buffer.lookup_pose2("robot_0/base_link", "robot_0/camera", 0)[0].x == 0.1


def test_fixed_sets_are_merged_by_child_frame() -> None:
    """A message with one frame more, of the same source or another one, takes no other frame away, as in tf2."""
    merger = Merger()
    merger.take_static(0, TFMessage([stamped("map", "odom", 0), stamped("odom", "mark", 0)]), "sim")
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 2.0)]), "sim")
    merger.take_static(0, TFMessage([stamped("base_link", "camera", 0)]), "driver")
    assert [(t.child_frame_id, t.transform.translation.x) for t in merger.statics.message().transforms] == [
        ("robot_0/camera", 0.0),
        ("robot_0/mark", 0.0),
        ("robot_0/odom", 2.0),
    ]
    authorities = {child: frame.authority for child, frame in merger.buffer.frames().items()}
    assert authorities == {"robot_0/camera": "driver", "robot_0/mark": "sim", "robot_0/odom": "sim"}


def test_an_unchanged_fixed_set_is_not_sent_again() -> None:
    """A repeated static message does not mark the set as changed."""
    merger = Merger()
    statics = TFMessage([stamped("map", "odom", 0, 1.0), stamped("base_footprint", "base_link", 0)])
    merger.take_static(0, statics)
    merger.statics.message()
    merger.take_static(0, statics)
    assert not merger.statics.changed


def test_a_localised_robot_keeps_its_place_when_its_fixed_set_goes() -> None:
    """A shadowed start pose that is added or removed does not change the localiser's transform."""
    merger = Merger()
    merger.take(0, TFMessage([stamped("map", "odom", S, 3.0)]))
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 2.0)]))
    merger.take_static(0, TFMessage([]))
    assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == 3.0
    assert merger.statics.message().transforms == []
    assert merger.take_conflicts() == []


def test_a_jump_back_keeps_what_does_not_move() -> None:
    """A jump back forgets moving and pending data; the static set stays, and new data is stored."""
    merger = Merger()
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 2.0)]))
    merger.take(0, TFMessage([stamped("odom", "base", 100 * S, 1.0)]))
    merger.jump_back()
    assert merger.take_pending() == []
    assert list(merger.buffer.frames()) == ["robot_0/odom"]
    merger.take(0, TFMessage([stamped("odom", "base", S, 5.0)]))
    assert merger.buffer.lookup_pose2("map", "robot_0/base", 0)[0].x == 7.0
    assert len(merger.take_pending()) == 1


def test_a_tools_frame_may_have_any_name_but_a_bad_one() -> None:
    """A refusal is returned to the caller."""
    merger = Merger()
    assert merger.add_static(stamped("map", "table", 0, 4.0), "tool") == ""
    assert merger.buffer.lookup_pose2("map", "table", 0)[0].x == 4.0
    assert "child_frame_id" in merger.add_static(stamped("map", "", 0), "tool")
    assert "loop" in merger.add_static(stamped("table", "map", 0), "tool")
    assert merger.add_static(stamped("map", "table", 0, 5.0), "tool") == ""
    assert merger.buffer.lookup_pose2("map", "table", 0)[0].x == 5.0
    assert len(merger.statics.message().transforms) == 1


def test_a_tools_start_pose_gives_way_to_the_simulators() -> None:
    """The simulator's start pose replaces a tool's, and stays when the tool ends."""
    merger = Merger()
    assert merger.add_static(stamped("map", "robot_0/odom", 0, 9.0), "tool") == ""
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 2.0)]))
    assert merger.take_conflicts() == []
    merger.statics.drop_authority("tool")
    assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == 2.0


def test_a_bad_localiser_does_not_take_a_robots_place_away() -> None:
    """A refused transform (here: a zero quaternion) does not replace the simulator's start pose."""
    merger = Merger()
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 2.0)]))
    merger.take(0, TFMessage([_without_rotation(stamped("map", "odom", S, 3.0))]))
    assert merger.take_conflicts()
    assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == 2.0
    assert _names(merger.statics.message().transforms) == [("map", "robot_0/odom")]


def test_after_a_jump_back_the_start_pose_holds_until_a_localiser_speaks() -> None:
    """After a jump back, the simulator's start pose holds until the localiser publishes again."""
    merger = Merger()
    start = TFMessage([stamped("map", "odom", 0, 2.0)])
    merger.take_static(0, start)
    merger.take(0, TFMessage([stamped("map", "odom", 9 * S, 3.0)]))
    merger.jump_back()
    merger.take_static(0, start)
    assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == 2.0
    merger.take(0, TFMessage([stamped("map", "odom", S, 4.0)]))
    assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == 4.0


def test_a_tool_may_not_take_over_a_moving_frame() -> None:
    """A tool's static transform for a robot's moving frame is refused, and the reason names the robot."""
    merger = Merger()
    merger.take(1, TFMessage([stamped("odom", "base_footprint", S, 1.0)]))
    why = merger.add_static(stamped("map", "robot_1/base_footprint", 0, 9.0), "tool")
    assert "robot_1" in why
    assert merger.buffer.frames()["robot_1/base_footprint"].parent == "robot_1/odom"


def test_a_tool_is_refused_as_often_as_it_asks() -> None:
    """The same request gets the same refusal each time."""
    merger = Merger()
    merger.add_static(stamped("map", "table", 0), "tool")
    for _ in range(2):
        assert "loop" in merger.add_static(stamped("table", "map", 0), "tool")


def test_a_robots_fixed_set_may_turn_round() -> None:
    """A new set with parent and child exchanged is stored: edges of the old set make no loop."""
    merger = Merger()
    merger.take_static(0, TFMessage([stamped("base_link", "camera", 0)]))
    merger.take_static(0, TFMessage([stamped("camera", "base_link", 0)]))
    assert merger.take_conflicts() == []
    assert _names(merger.statics.message().transforms) == [("robot_0/camera", "robot_0/base_link")]
