"""Merging the robots' transforms: names, sources of the start pose, conflicts."""

import pytest
from test_tf_buffer import S, stamped

from zteam.messages import TFMessage
from zteam.tf.merge import Merger
from zteam.tf.text import format_transform, format_tree


@pytest.mark.parametrize(
    ("parent", "child"),
    [("odom", "base_footprint"), ("robot_1/odom", "/robot_1/base_footprint")],
    ids=["local", "full"],
)
def test_all_spellings_mean_the_same_frame(parent: str, child: str) -> None:
    """Local names, prefixed ones and leading slashes lead to one tree."""
    merger = Merger()
    merger.take(1, TFMessage([stamped(parent, child, S, 2.0)]))
    (sent,) = merger.take_pending()
    assert (sent.header.frame_id, sent.child_frame_id) == ("robot_1/odom", "robot_1/base_footprint")
    assert sent.header.stamp.sec == 1
    assert merger.take_pending() == []


def test_map_is_never_prefixed() -> None:
    """The start pose hangs under the team's own map."""
    merger = Merger()
    merger.take_static(2, TFMessage([stamped("map", "odom", 0, 6.5, 16.5)]))
    assert merger.buffer.lookup_pose2("map", "robot_2/odom", 0)[0][:2] == (6.5, 16.5)


def test_the_team_file_wins_over_everyone() -> None:
    """Its start pose shadows the simulator's and a localiser's, and neither is a conflict."""
    merger = Merger([stamped("map", "robot_0/odom", 0, 1.0)])
    merger.take_static(0, TFMessage([stamped("map", "robot_0/odom", 0, 2.0)]))
    merger.take(0, TFMessage([stamped("map", "robot_0/odom", S, 3.0)]))
    assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == 1.0
    assert [t.transform.translation.x for t in merger.statics().transforms] == [1.0]
    assert merger.take_conflicts() == []


def test_a_localiser_wins_over_the_simulator() -> None:
    """From its first transform on the start pose leaves the static set, whichever came first."""
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
        assert merger.statics_changed
        assert [t.child_frame_id for t in merger.statics().transforms] == ["robot_0/base_link"]
        assert merger.buffer.lookup_pose2("map", "robot_0/odom", 0)[0].x == 3.0
        assert merger.take_conflicts() == []


@pytest.mark.parametrize(
    ("parent", "child"), [("map", "/robot_1/odom"), ("/robot_1/odom", "base_link"), ("map", "/table")]
)
def test_a_robot_speaks_for_itself_only(parent: str, child: str) -> None:
    """Frames outside a robot's own prefix are refused and reported once."""
    merger = Merger()
    for _ in range(3):
        merger.take(0, TFMessage([stamped(parent, child, S)]))
    assert merger.take_pending() == []
    (conflict,) = merger.take_conflicts()
    assert "robot_0 may not" in conflict
    assert merger.take_conflicts() == []


def test_a_second_authority_is_refused_and_named() -> None:
    """Who spoke first stays; the text names both."""
    merger = Merger([stamped("robot_0/base_link", "robot_0/camera", 0, 0.1)])
    merger.take_static(0, TFMessage([stamped("base_link", "camera", 0, 0.2)]))
    (conflict,) = merger.take_conflicts()
    assert "team file" in conflict
    assert "robot_0" in conflict
    assert merger.statics().transforms[0].transform.translation.x == 0.1


def test_a_callers_frames_live_as_long_as_the_caller() -> None:
    """A fixed transform that a tool adds goes when the tool goes."""
    merger = Merger()
    assert merger.add_static(stamped("map", "table", 0, 4.0), "tool") is None
    assert "tool already" in (merger.add_static(stamped("map", "table", 0, 5.0), "other") or "")
    merger.drop_authority("tool")
    assert merger.statics().transforms == []
    assert merger.add_static(stamped("map", "table", 0, 5.0), "other") is None


def test_a_moved_start_pose_replaces_the_old_one() -> None:
    """The simulator may say a new start pose (after a move), and the set follows it."""
    merger = Merger()
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 1.0)]))
    merger.statics()
    merger.take_static(0, TFMessage([stamped("map", "odom", 0, 9.0)]))
    assert merger.statics_changed
    assert merger.statics().transforms[0].transform.translation.x == 9.0


def test_tf_echos_block() -> None:
    """The format of the lectures' tf_echo, with no -0.000."""
    text = format_transform(stamped("map", "robot_0/base_footprint", 3 * S // 2, 6.5, -0.0001))
    assert text.splitlines() == [
        "At time 1.500",
        "- Translation: [6.500, 0.000, 0.000]",
        "- Rotation: in Quaternion [0.000, 0.000, 0.000, 1.000]",
        "            in RPY (radian) [0.000, 0.000, 0.000]",
        "            in RPY (degree) [0.000, 0.000, 0.000]",
    ]


def test_the_tree_in_a_terminal() -> None:
    """Every frame on a line under its parent, with rate, age and authority."""
    merger = Merger()
    merger.take_static(0, TFMessage([stamped("map", "odom", 0)]))
    for tick in range(1, 12):
        merger.take(0, TFMessage([stamped("odom", "base_footprint", tick * S // 10)]))
    assert format_tree(merger.buffer.frames(), 12 * S // 10).splitlines() == [
        "map",
        "└── robot_0/odom  (static, by robot_0)",
        "    └── robot_0/base_footprint  (10.0 Hz, 0.10 s old, by robot_0)",
    ]


def test_a_clock_that_runs_apart_is_refused_and_named() -> None:
    """A stamp from another time is reported once and taken from nobody; the robot's true samples still count."""
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
