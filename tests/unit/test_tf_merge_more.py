"""More of the merged tree: who may say what, what a team may lose, what outlives a jump of time; and texts."""

import math

import pytest
from test_tf_buffer import S, stamped

from zteam.messages import Quaternion, TFMessage, TransformStamped, ns_from_time
from zteam.tf import Buffer
from zteam.tf.merge import Merger
from zteam.tf.text import format_transform, format_tree


def _names(transforms: list[TransformStamped]) -> list[tuple[str, str]]:
    return [(t.header.frame_id, t.child_frame_id) for t in transforms]


def _without_rotation(transform: TransformStamped) -> TransformStamped:
    transform.transform.rotation = Quaternion(0.0, 0.0, 0.0, 0.0)
    return transform


def test_a_robot_is_seen_from_another() -> None:
    """The tree of a team: start poses, odometry and fixed legs of two robots make one path."""
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
    """The bundle holds every robot's transforms in the order in which they came, never restamped."""
    merger = Merger()
    for robot, stamp in ((2, 7 * S + 1), (0, 5 * S), (2, 7 * S + 2)):
        merger.take(robot, TFMessage([stamped("odom", "base_footprint", stamp, 0.25, 0.5, 1.0)]))
    pending = merger.take_pending()
    assert [ns_from_time(t.header.stamp) for t in pending] == [7 * S + 1, 5 * S, 7 * S + 2]
    assert [t.child_frame_id for t in pending] == [f"robot_{i}/base_footprint" for i in (2, 0, 2)]
    assert pending[1].transform == stamped("", "", 0, 0.25, 0.5, 1.0).transform


def test_what_is_refused_is_not_passed_on() -> None:
    """Old samples, other values for a known time, and numbers that are none stay out of the bundle."""
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
    """Its neighbours in the message are taken."""
    merger = Merger()
    good, bad = stamped("odom", "base_footprint", S), stamped("map", "/robot_1/odom", S)
    merger.take(0, TFMessage([bad, good]))
    assert _names(merger.take_pending()) == [("robot_0/odom", "robot_0/base_footprint")]
    merger.take_static(0, TFMessage([bad, stamped("base_footprint", "base_link", 0)]))
    assert _names(merger.statics().transforms) == [("robot_0/base_footprint", "robot_0/base_link")]


def test_a_robot_may_not_bend_the_map() -> None:
    """The global frames themselves are nobody's to move, nor is a robot whose name only begins alike."""
    merger = Merger()
    for parent, child in (("earth", "map"), ("robot_1/base", "/map"), ("map", "/robot_10/odom"), ("/robot_10/x", "y")):
        merger.take(1, TFMessage([stamped(parent, child, S)]))
        merger.take_static(1, TFMessage([stamped(parent, child, 0)]))
    assert merger.buffer.frames() == {}
    assert merger.take_pending() == []
    assert merger.statics().transforms == []
    assert len(merger.take_conflicts()) == 3


def test_a_robots_loop_is_refused_and_reported_once() -> None:
    """A loop never reaches the tree, and the text names the robot."""
    merger = Merger()
    for _ in range(3):
        merger.take(4, TFMessage([stamped("odom", "a", S), stamped("a", "b", S), stamped("b", "odom", S)]))
    (conflict,) = merger.take_conflicts()
    assert "loop" in conflict
    assert "robot_4" in conflict
    assert _names(merger.take_pending())[:2] == [("robot_4/odom", "robot_4/a"), ("robot_4/a", "robot_4/b")]


def test_moving_data_for_a_frame_of_the_team_file_is_a_conflict() -> None:
    """A fixed frame of the file stays, and both sides are named."""
    merger = Merger([stamped("robot_0/base_link", "robot_0/camera", 0, 0.1)])
    merger.take(0, TFMessage([stamped("base_link", "camera", S, 0.5)]))
    assert merger.take_pending() == []
    (conflict,) = merger.take_conflicts()
    assert "team file" in conflict
    assert "robot_0" in conflict
    assert merger.buffer.lookup_pose2("robot_0/base_link", "robot_0/camera", 0)[0].x == 0.1


def test_what_left_a_robots_fixed_set_leaves_the_tree() -> None:
    """Only that robot's own frames go, and the full set is sent again."""
    merger = Merger([stamped("robot_0/base_link", "robot_0/camera", 0)])
    merger.take_static(0, TFMessage([stamped("map", "odom", 0), stamped("odom", "mark", 0)]))
    merger.take_static(1, TFMessage([stamped("map", "odom", 0)]))
    assert merger.add_static(stamped("map", "table", 0), "tool") is None
    merger.statics()
    assert not merger.statics_changed
    merger.take_static(0, TFMessage([stamped("map", "odom", 0)]))
    assert merger.statics_changed
    children = [t.child_frame_id for t in merger.statics().transforms]
    assert children == ["robot_0/camera", "robot_0/odom", "robot_1/odom", "table"]
    assert sorted(merger.buffer.frames()) == children


def test_an_unchanged_fixed_set_is_not_sent_again() -> None:
    """A robot that repeats itself costs nobody anything."""
    merger = Merger()
    statics = TFMessage([stamped("map", "odom", 0, 1.0), stamped("base_footprint", "base_link", 0)])
    merger.take_static(0, statics)
    merger.statics()
    merger.take_static(0, statics)
    assert not merger.statics_changed


def test_a_localised_robot_keeps_its_place_when_its_fixed_set_goes() -> None:
    """A shadowed start pose may come and go without touching what the localiser says."""
    merger = Merger()
    merger.take(0, TFMessage([stamped("map", "odom", S, 3.0)]))
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 2.0)]))
    merger.take_static(0, TFMessage([]))
    assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == 3.0
    assert merger.statics().transforms == []
    assert merger.take_conflicts() == []


def test_a_jump_back_keeps_what_does_not_move() -> None:
    """Moving data and what waits to be sent are forgotten; the fixed set stays, and new data is taken at once."""
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
    """Slashes are stripped; a refusal comes back to who asked."""
    merger = Merger()
    assert merger.add_static(stamped("/map", "/table", 0, 4.0), "tool") is None
    assert merger.buffer.lookup_pose2("map", "table", 0)[0].x == 4.0
    assert "child_frame_id" in (merger.add_static(stamped("map", "", 0), "tool") or "")
    assert "loop" in (merger.add_static(stamped("table", "map", 0), "tool") or "")
    assert merger.add_static(stamped("map", "table", 0, 5.0), "tool") is None
    assert merger.buffer.lookup_pose2("map", "table", 0)[0].x == 5.0
    assert len(merger.statics().transforms) == 1


def test_a_tools_start_pose_gives_way_to_the_simulators() -> None:
    """The simulator knows better where a robot stands; the tool's end takes nothing away."""
    merger = Merger()
    assert merger.add_static(stamped("map", "robot_0/odom", 0, 9.0), "tool") is None
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 2.0)]))
    assert merger.take_conflicts() == []
    merger.drop_authority("tool")
    assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == 2.0


def test_tf_echos_angles_are_fixed_axis() -> None:
    """Radians, then degrees, of roll, pitch and yaw."""
    transform = stamped("map", "base", 0, -1.0, 2.5, math.radians(-90))
    lines = format_transform(transform).splitlines()
    assert lines[1] == "- Translation: [-1.000, 2.500, 0.000]"
    assert lines[2] == "- Rotation: in Quaternion [0.000, 0.000, -0.707, 0.707]"
    assert lines[3].strip() == "in RPY (radian) [0.000, 0.000, -1.571]"
    assert lines[4].strip() == "in RPY (degree) [0.000, 0.000, -90.000]"


def test_several_roots_and_branches_in_a_terminal() -> None:
    """Unconnected trees stand one after the other, branches have their lines, and nobody is left out."""
    buffer = Buffer()
    for parent, child in (("map", "a"), ("a", "a1"), ("a", "a2"), ("map", "b"), ("moon", "crater")):
        buffer.set_transform_static(stamped(parent, child, 0), "me")
    assert format_tree(buffer.frames(), 0).splitlines() == [
        "map",
        "├── a  (static, by me)",
        "│   ├── a1  (static, by me)",
        "│   └── a2  (static, by me)",
        "└── b  (static, by me)",
        "moon",
        "└── crater  (static, by me)",
    ]
    assert format_tree({}, 0) == ""


@pytest.mark.parametrize(("parent", "child"), [("", "base"), ("odom", "")])
def test_a_robots_nameless_frames_are_refused(parent: str, child: str) -> None:
    """An empty name is no frame, whatever the prefix."""
    merger = Merger()
    merger.take(0, TFMessage([stamped(parent, child, S)]))
    merger.take_static(0, TFMessage([stamped(parent, child, 0)]))
    assert merger.buffer.frames() == {}
    assert merger.take_conflicts()


def test_a_bad_localiser_does_not_take_a_robots_place_away() -> None:
    """A transform that is refused (here: an empty rotation) leaves the simulator's start pose where it is."""
    merger = Merger()
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 2.0)]))
    merger.take(0, TFMessage([_without_rotation(stamped("map", "odom", S, 3.0))]))
    assert merger.take_conflicts()
    assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == 2.0
    assert _names(merger.statics().transforms) == [("map", "robot_0/odom")]


def test_after_a_jump_back_the_start_pose_holds_until_a_localiser_speaks() -> None:
    """A run that begins anew without its localiser does not lose its robots."""
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
    """The robot that moves the frame is its authority; the tool is told so."""
    merger = Merger()
    merger.take(1, TFMessage([stamped("odom", "base_footprint", S, 1.0)]))
    why = merger.add_static(stamped("map", "robot_1/base_footprint", 0, 9.0), "tool")
    assert "robot_1" in (why or "")
    assert merger.buffer.frames()["robot_1/base_footprint"].parent == "robot_1/odom"


def test_a_tool_is_refused_as_often_as_it_asks() -> None:
    """The log has a conflict once, the caller each time."""
    merger = Merger()
    merger.add_static(stamped("map", "table", 0), "tool")
    for _ in range(2):
        assert "loop" in (merger.add_static(stamped("table", "map", 0), "tool") or "")


def test_a_robots_fixed_set_may_turn_round() -> None:
    """What counts is the new set: an edge of the old one is no loop in it."""
    merger = Merger()
    merger.take_static(0, TFMessage([stamped("base_link", "camera", 0)]))
    merger.take_static(0, TFMessage([stamped("camera", "base_link", 0)]))
    assert merger.take_conflicts() == []
    assert _names(merger.statics().transforms) == [("robot_0/camera", "robot_0/base_link")]


def test_two_publishers_of_one_edge_are_reported() -> None:
    """Two values for one frame at one time can only come from two sources."""
    merger = Merger()
    merger.take(0, TFMessage([stamped("odom", "base_footprint", S, 1.0)]))
    merger.take(0, TFMessage([stamped("odom", "base_footprint", S, 2.0)]))
    (conflict,) = merger.take_conflicts()
    assert "robot_0/base_footprint" in conflict


def test_an_exact_duplicate_is_not_sent_again() -> None:
    """What the tree has already need not travel again."""
    merger = Merger()
    for _ in range(2):
        merger.take(0, TFMessage([stamped("odom", "base_footprint", S, 1.0)]))
    assert len(merger.take_pending()) == 1


def test_a_tree_of_any_depth_is_drawn() -> None:
    """A chain deeper than Python's stack is still text."""
    buffer = Buffer()
    for i in range(1500):
        buffer.set_transform_static(stamped(f"f{i}", f"f{i + 1}", 0), "me")
    assert len(format_tree(buffer.frames(), 0).splitlines()) == 1501
