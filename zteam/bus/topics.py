"""Which message goes over which key, for tools that receive a payload without an encoding."""

from zteam import names
from zteam.messages import (
    BaseInfo,
    Clock,
    Done,
    Log,
    Message,
    NavigationStatus,
    OccupancyGrid,
    Path,
    PolygonStamped,
    PoseArray,
    PoseStamped,
    PoseWithCovarianceStamped,
    RobotStatus,
    TeamStatus,
    TFMessage,
    Tick,
    Twist,
    TwistStamped,
)
from zteam.world.devices import KINDS

_TEAM: dict[str, type[Message]] = {
    names.CLOCK: Clock,
    names.MAP: OccupancyGrid,
    names.TEAM_STATUS: TeamStatus,
    names.TF: TFMessage,
    names.TF_STATIC: TFMessage,
    names.TICK: Tick,
}

_ROBOT: dict[str, type[Message]] = {
    names.AMCL_POSE: PoseWithCovarianceStamped,
    names.BASE_INFO: BaseInfo,
    names.CMD_VEL: Twist,
    names.CMD_VEL_NAV: TwistStamped,
    names.CMD_VEL_TELEOP: Twist,
    names.GLOBAL_COSTMAP: OccupancyGrid,
    names.GOAL_POSE: PoseStamped,
    names.INITIAL_POSE: PoseWithCovarianceStamped,
    names.LOCAL_COSTMAP: OccupancyGrid,
    names.LOCAL_PLAN: Path,
    names.NAVIGATION_STATUS: NavigationStatus,
    names.PARTICLE_CLOUD: PoseArray,
    names.PLAN: Path,
    names.PUBLISHED_FOOTPRINT: PolygonStamped,
    names.STATUS: RobotStatus,
    names.TF: TFMessage,
    names.TF_STATIC: TFMessage,
}
"""What a robot publishes or receives besides what is measured of it (`zteam.world.devices`)."""

_LATCHED = frozenset({names.MAP, names.TEAM_STATUS, names.TF_STATIC, names.BASE_INFO})
_LATCHED |= {names.AMCL_POSE, names.PLAN, names.GLOBAL_COSTMAP, names.LOCAL_COSTMAP}


def is_latched(key: str) -> bool:
    """Whether a late subscriber of a key, or of that topic of every robot, gets the last message."""
    single = names.keys_in(key, [0])[:1]
    target = names.split_robot_key(single[0]) if single else None
    return (key if target is None else target[1]) in _LATCHED


def type_of_key(key: str) -> type[Message] | None:
    """The type of the messages of a key (docs/keys.md), or None for a key that zteam does not use."""
    if names.split_done_key(key) is not None:
        return Done
    if names.split_log_key(key) is not None:
        return Log
    target = names.split_robot_key(key)
    if target is None:
        return _TEAM.get(key)
    topic = target[1]
    if topic in _ROBOT:
        return _ROBOT[topic]
    stem, _, number = topic.rpartition("_")
    # base_scan_1, sonar_3: numbered devices.
    kind = KINDS.get(topic) or (KINDS.get(stem) if number.isdigit() else None)
    return kind.message if kind is not None else None
