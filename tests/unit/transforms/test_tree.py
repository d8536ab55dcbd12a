"""The tree of frames: loops, changes of parent, static and moving frames, full sets of static transforms."""

from support.transforms import S, stamped
from zteam.geometry import Pose2
from zteam.tf import Buffer


def test_a_loop_names_both_authorities() -> None:
    """A sample that would close a loop is refused, and the text names both authorities."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("a", "b", 0), "first")
    buffer.set_transform_static(stamped("b", "c", 0), "second")
    refused = buffer.set_transform_static(stamped("c", "a", 0), "third")
    assert refused is not None
    assert refused.code == "TF_LOOP"
    assert "third" in refused.text
    assert "second" in refused.text


def test_moving_data_on_a_static_frame_is_refused() -> None:
    """A moving sample for a static frame is refused, and the text names the static frame's authority."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "odom", 0, 1.0), "team file")
    refused = buffer.set_transform(stamped("map", "odom", S, 2.0), "robot_1")
    assert refused is not None
    assert "team file" in refused.text
    assert buffer.lookup_pose2("map", "odom", 0)[0].x == 1.0


def test_a_new_parent_takes_over_from_its_time_on() -> None:
    """A past look-up uses the parent at that time, the newest look-up uses the new parent."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "room", 0, 100.0), "test")
    buffer.set_transform(stamped("map", "base", S, 1.0), "test")
    buffer.set_transform(stamped("map", "base", 2 * S, 2.0), "test")
    buffer.set_transform(stamped("room", "base", 3 * S, 3.0), "test")
    assert buffer.lookup_pose2("map", "base", S)[0].x == 1.0
    assert buffer.lookup_pose2("map", "base", 5 * S // 2)[0].x == 2.0
    assert buffer.lookup_pose2("map", "base", 0)[0].x == 103.0


def test_a_late_sample_of_the_old_parent_goes_where_it_belongs() -> None:
    """Each time has the parent of its own sample, also after a late sample; outdated paths are not used."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "room", 0, 100.0), "test")
    buffer.set_transform(stamped("map", "base", S, 1.0), "test")
    buffer.set_transform(stamped("room", "base", 3 * S, 3.0), "test")
    assert buffer.lookup_pose2("map", "base", 2 * S)[0].x == 1.0
    buffer.set_transform(stamped("map", "base", 2 * S, 2.0), "test")
    assert buffer.lookup_pose2("map", "base", 2 * S)[0].x == 2.0
    assert buffer.lookup_pose2("map", "base", 3 * S // 2)[0].x == 1.5
    assert buffer.lookup_pose2("map", "base", 0)[0].x == 103.0


def test_the_latest_look_up_uses_the_parents_of_its_time() -> None:
    """A look-up at 0 equals one at the time that it returns, also if a parent changed after that time."""
    buffer = Buffer()
    for half in (2, 3):
        buffer.set_transform(stamped("map", "room", half * S // 2, 100.0), "test")
    buffer.set_transform(stamped("map", "base", S, 1.0), "test")
    buffer.set_transform(stamped("map", "base", 2 * S, 2.0), "test")
    buffer.set_transform(stamped("room", "base", 3 * S, 3.0), "test")
    assert buffer.lookup_pose2("map", "base", 3 * S // 2)[0].x == 1.5
    pose, stamp = buffer.lookup_pose2("map", "base", 0)
    assert (pose.x, stamp) == (1.5, 3 * S // 2)


def test_the_full_static_set_forgets_what_it_no_longer_has() -> None:
    """A full static set replaces the former one."""
    buffer = Buffer()
    buffer.set_all_static([stamped("map", "a", 0, 1.0), stamped("map", "b", 0, 2.0)], "tf")
    buffer.set_all_static([stamped("map", "b", 0, 3.0)], "tf")
    assert list(buffer.frames()) == ["b"]
    assert buffer.lookup_pose2("map", "b", 0)[0].x == 3.0
    assert buffer.set_transform(stamped("map", "a", S, 5.0), "robot") is None


def test_a_fixed_set_of_another_shape_replaces_the_old_one_whole() -> None:
    """A new set with parent and child exchanged is stored: edges of the old set make no loop."""
    buffer = Buffer()
    buffer.set_all_static([stamped("map", "a", 0, 1.0), stamped("a", "b", 0, 1.0)], "tf")
    assert buffer.set_all_static([stamped("b", "a", 0, 5.0), stamped("map", "b", 0, 5.0)], "tf") == []
    assert {child: info.parent for child, info in buffer.frames().items()} == {"a": "b", "b": "map"}


def test_a_fixed_edge_that_moves_is_not_remembered() -> None:
    """A new value or parent of a static transform is used at once, also on a prepared path."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "room", 0, 100.0), "test")
    buffer.set_transform_static(stamped("map", "table", 0, 1.0), "test")
    assert buffer.lookup_pose2("map", "table", 0)[0].x == 1.0
    buffer.set_transform_static(stamped("map", "table", 0, 2.0), "test")
    assert buffer.lookup_pose2("map", "table", 0)[0].x == 2.0
    buffer.set_transform_static(stamped("room", "table", 0, 3.0), "test")
    assert buffer.lookup_pose2("map", "table", 0)[0].x == 103.0
    buffer.set_transform_static(stamped("map", "room", 0, 200.0), "test")
    assert buffer.lookup_pose2("map", "table", 0)[0].x == 203.0


def test_a_moving_frame_may_become_fixed() -> None:
    """A static transform replaces a moving frame and its history, also after a clear."""
    for clear in (False, True):
        buffer = Buffer()
        buffer.set_transform(stamped("map", "base", 5 * S, 1.0), "test")
        if clear:
            buffer.clear()
        assert buffer.set_transform_static(stamped("map", "base", 0, 2.0), "test") is None
        assert buffer.lookup_pose2("map", "base", 77 * S)[0].x == 2.0
        assert buffer.frames()["base"].static


def test_a_forgotten_frame_may_come_back_elsewhere() -> None:
    """A forgotten edge gives no answers, and its frame can be stored under another parent."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "a", 0, 1.0), "test")
    buffer.set_transform_static(stamped("a", "b", 0, 1.0), "test")
    assert buffer.lookup_pose2("map", "b", 0)[0].x == 2.0
    buffer.forget("a")
    assert not buffer.can_transform("map", "b", 0)[0]
    assert list(buffer.frames()) == ["b"]
    assert buffer.set_transform(stamped("moon", "a", S, 7.0), "test") is None
    assert buffer.lookup_pose2("moon", "b", 0) == (Pose2(8.0, 0.0, 0.0), S)
