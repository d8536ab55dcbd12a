"""What the pages look at, as topics. Pure."""

from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

from zteam import names
from zteam.geometry import Pose2
from zteam.messages import Fiducials, LaserScan, Log, Odometry, PoseStamped, Range, TFMessage
from zteam.nodes.web.drawables import Drawables
from zteam.nodes.web.requests import Watch
from zteam.nodes.web.subscriptions import Topic
from zteam.nodes.web.viewer import Viewer

MAX_SCANNED = 100
"""Robots whose sensors one page is shown at a time, the selected ones first, then those nearest to its middle."""


class Sampled(NamedTuple):
    """What is asked for now and then, and not subscribed to."""

    scans_of: Collection[int] = ()
    """Ids of robots."""
    transforms: bool = False


NOTHING = Sampled()
TEAM = (
    Topic(names.TF_STATIC, None, latched=True),
    Topic(names.TEAM_STATUS, None, latched=True),
    Topic(names.MAP, None, latched=True),
    Topic(names.all_robots_key(names.BASE_INFO), None, latched=True),
    Topic(names.all_robots_key(names.STATUS)),
)
"""What every page shows."""


def topics_of(
    viewers: Collection[Viewer],
    poses: Mapping[int, Pose2],
    drawables: Drawables,
    *,
    aggregator: bool,
    sampled: Sampled = NOTHING,
) -> set[Topic]:
    """What these pages look at, without what is sampled; `aggregator`: whether there is one, else the robots' poses are
    the simulator's."""
    if not viewers:
        return set()
    wanted = {*TEAM} if sampled.transforms else {*TEAM, _poses(aggregator=aggregator)}
    for viewer in viewers:
        layers = set(viewer.look.layers)
        wanted |= drawables.topics(layers)
        wanted |= {_watched(watch) for watch in viewer.watches}
        if "log" in viewer.look.docs:
            wanted.add(Topic(names.log_key(), Log, every=True))
        if "goals" in layers:
            wanted.add(Topic(names.all_robots_key(names.GOAL_POSE), PoseStamped))
        robots = robots_in_sight(viewer, poses) if layers & {"scans", "sonars", "fiducials"} else []
        if "scans" in layers:
            wanted |= {
                Topic(names.robot_key(i, names.all_numbered(names.BASE_SCAN)), LaserScan)
                for i in robots
                if i not in sampled.scans_of
            }
        if "sonars" in layers:
            wanted |= {Topic(names.robot_key(i, names.all_numbered(names.SONAR)), Range) for i in robots}
        if "fiducials" in layers:
            wanted |= {Topic(names.robot_key(i, names.FIDUCIALS), Fiducials) for i in robots}
    return wanted


def _watched(watch: Watch) -> Topic:
    # Of a plot each message counts. The last message is enough for an echo, also if it came before the page.
    return Topic(watch.topic, latched=not watch.field, every=bool(watch.field))


def _poses(*, aggregator: bool) -> Topic:
    return Topic(names.TF, TFMessage) if aggregator else Topic(names.all_robots_key(names.GROUND_TRUTH), Odometry)


def robots_in_sight(viewer: Viewer, poses: Mapping[int, Pose2]) -> list[int]:
    """The robots whose sensors a page is shown."""
    selected = {*viewer.look.selected, viewer.look.follow} & poses.keys()
    there = selected | {i for i, pose in poses.items() if viewer.sees(pose.x, pose.y)}
    if len(there) <= MAX_SCANNED:
        return sorted(there)
    return sorted(sorted(there, key=lambda i: (i not in selected, _distance(viewer, poses[i])))[:MAX_SCANNED])


def _distance(viewer: Viewer, pose: Pose2) -> float:
    view = viewer.look.viewport
    if not view:
        return 0.0
    return abs(pose.x - (view[0] + view[2]) / 2) + abs(pose.y - (view[1] + view[3]) / 2)


def scanned_robots(viewers: Collection[Viewer], poses: Mapping[int, Pose2]) -> set[int]:
    """The robots whose scans some page is shown."""
    shown = [viewer for viewer in viewers if "scans" in viewer.look.layers]
    return {robot_id for viewer in shown for robot_id in robots_in_sight(viewer, poses)}


def present_robots(keys: Iterable[str]) -> set[int]:
    """The robots that these keys are of."""
    return {target[0] for target in map(names.split_robot_key, keys) if target is not None}
