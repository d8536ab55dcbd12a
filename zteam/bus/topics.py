"""Which message goes over which key, for tools that meet a payload without an encoding."""

from zteam import names
from zteam.messages import (
    Blobs,
    Bool,
    Bumper,
    Clock,
    Done,
    Fiducials,
    JointState,
    LaserScan,
    Message,
    OccupancyGrid,
    Odometry,
    Range,
    RobotStatus,
    TeamStatus,
    TFMessage,
    Tick,
    Twist,
)

_TEAM: dict[str, type[Message]] = {
    names.CLOCK: Clock,
    names.MAP: OccupancyGrid,
    names.TEAM_STATUS: TeamStatus,
    names.TF: TFMessage,
    names.TF_STATIC: TFMessage,
    names.TICK: Tick,
}

_ROBOT: dict[str, type[Message]] = {
    names.BASE_SCAN: LaserScan,
    names.BLOBS: Blobs,
    names.BUMPER: Bumper,
    names.CMD_VEL: Twist,
    names.FIDUCIALS: Fiducials,
    names.GROUND_TRUTH: Odometry,
    names.JOINT_STATES: JointState,
    names.ODOM: Odometry,
    names.SONAR: Range,
    names.STALL: Bool,
    names.STATUS: RobotStatus,
    names.TELEOP: Twist,
    names.TF: TFMessage,
    names.TF_STATIC: TFMessage,
}

LATCHED = frozenset({names.MAP, names.TEAM_STATUS, names.TF_STATIC})
"""Keys (or, below a robot, topics) whose last message late subscribers get."""


def type_of_key(key: str) -> type[Message] | None:
    """The type that DESIGN's table gives a key, or None."""
    if names.split_done_key(key) is not None:
        return Done
    target = names.split_robot_key(key)
    if target is None:
        return _TEAM.get(key)
    topic = target[1]
    stem, _, number = topic.rpartition("_")
    # base_scan_1, sonar_3: numbered kinds.
    return _ROBOT.get(topic) or (_ROBOT.get(stem) if number.isdigit() else None)
