"""What Foxglove is shown, and how its layout draws it."""

from zteam.bus.transport import Declaration
from zteam.messages import LaserScan, OccupancyGrid, Path, PoseStamped, TFMessage
from zteam.view.foxglove import PANEL, layout_of, shown_keys

KEYS = {
    "map": OccupancyGrid, "tf": TFMessage, "mine": None, "robot_2/base_scan": LaserScan, "robot_2/plan": Path,
    "robot_2/goal_pose": PoseStamped, "robot_2/local_costmap/costmap": OccupancyGrid, "robot_3/base_scan": LaserScan,
}  # fmt: skip


def test_keys_with_a_use_are_shown() -> None:
    """Those that are published, and inputs that are known; no wildcard, no robot's own transforms, nothing internal."""
    published = [
        "robot_0/base_scan",
        "mine",
        "robot_0/tf",
        "robot_0/tf_static",
        "tf",
        "@session/1/x",
        "robot_$*/status",
    ]
    heard = ["robot_0/goal_pose", "other", "robot_$*/base_scan"]
    declarations = [Declaration(key, "s", True) for key in published] + [Declaration(key, "s", False) for key in heard]
    assert shown_keys(declarations) == {
        "robot_0/base_scan": LaserScan,
        "mine": None,
        "tf": TFMessage,
        "robot_0/goal_pose": PoseStamped,
    }


def test_a_layout_draws_what_each_robot_shows() -> None:
    """Map, scans, paths and goals are on, each robot in a colour of its own; costmaps, which hide them, are off."""
    panel = layout_of(KEYS)["configById"][PANEL]
    topics = panel["topics"]
    on = {topic for topic, settings in topics.items() if settings["visible"]}
    assert on == {"/map", "/robot_2/base_scan", "/robot_2/plan", "/robot_2/goal_pose", "/robot_3/base_scan"}
    assert not topics["/robot_2/local_costmap/costmap"]["visible"]
    assert topics["/robot_2/base_scan"]["flatColor"] != topics["/robot_3/base_scan"]["flatColor"]
    assert panel["followTf"] == "robot_2/base_footprint"
