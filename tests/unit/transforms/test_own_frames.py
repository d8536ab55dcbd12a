"""The frames that a robot may publish, and the spellings of their names."""

import pytest

from support.transforms import S, stamped
from zteam.messages import TFMessage, TransformStamped
from zteam.transforms.merge import Merger
from zteam.transforms.static_transforms import is_start_pose


def merged(*transforms: TransformStamped) -> tuple[list[TransformStamped], list[str]]:
    """What is sent on of a message of robot 3, and the conflicts."""
    merger = Merger()
    merger.take(3, TFMessage([*transforms]))
    return merger.take_pending(), merger.conflicts()


@pytest.mark.parametrize(
    ("parent", "child"), [("odom", "laser"), ("robot_3/odom", "robot_3/laser"), ("/robot_3/odom", "/robot_3/laser")]
)
def test_names_are_resolved_and_the_rest_stays(parent: str, child: str) -> None:
    """Every spelling gives the full names; stamp and numbers stay as they are."""
    assert merged(stamped(parent, child, S, 1.0)) == ([stamped("robot_3/odom", "robot_3/laser", S, 1.0)], [])


def test_own_frames_are_kept_in_their_order() -> None:
    """A robot may publish its own frames, under its own frames or under `map`."""
    kept = merged(stamped("odom", "laser", S), stamped("map", "odom", S))
    assert kept == ([stamped("robot_3/odom", "robot_3/laser", S), stamped("map", "robot_3/odom", S)], [])


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


@pytest.mark.parametrize(
    ("parent", "child", "expected"),
    [
        ("map", "robot_3/odom", True),
        ("map", "robot_3/base_link", False),
        ("robot_3/base_link", "robot_3/odom", False),
        ("map", "odom", False),
    ],
)
def test_a_start_pose_leads_from_the_map_to_a_robots_odom(parent: str, child: str, expected: bool) -> None:
    """Both frames must match."""
    assert is_start_pose(stamped(parent, child, S)) is expected
