"""Which message goes over which key, for tools that receive a payload without an encoding."""

from functools import lru_cache

from zteam import messages, names

_TEAM: dict[str, type[messages.Message]] = {
    names.CLOCK: messages.Clock,
    names.MAP: messages.OccupancyGrid,
    names.TEAM_STATUS: messages.TeamStatus,
    names.TF: messages.TFMessage,
    names.TF_STATIC: messages.TFMessage,
    names.TICK: messages.Tick,
}

_ROBOT: dict[str, type[messages.Message]] = {
    names.AMCL_POSE: messages.PoseWithCovarianceStamped,
    names.BASE_INFO: messages.BaseInfo,
    names.CMD_VEL: messages.Twist,
    names.CMD_VEL_NAV: messages.TwistStamped,
    names.CMD_VEL_TELEOP: messages.Twist,
    names.GLOBAL_COSTMAP: messages.OccupancyGrid,
    names.GOAL_POSE: messages.PoseStamped,
    names.INITIAL_POSE: messages.PoseWithCovarianceStamped,
    names.LOCAL_COSTMAP: messages.OccupancyGrid,
    names.LOCAL_PLAN: messages.Path,
    names.NAVIGATION_STATUS: messages.NavigationStatus,
    names.PARTICLE_CLOUD: messages.PoseArray,
    names.PLAN: messages.Path,
    names.PUBLISHED_FOOTPRINT: messages.PolygonStamped,
    names.STATUS: messages.RobotStatus,
    names.TF: messages.TFMessage,
    names.TF_STATIC: messages.TFMessage,
}
"""What a robot publishes or receives besides what its sensors measure."""

SENSORS: dict[str, type[messages.Message]] = {
    names.BASE_SCAN: messages.LaserScan,
    names.BLOBS: messages.Blobs,
    names.BUMPER: messages.Bumper,
    names.FIDUCIALS: messages.Fiducials,
    names.GROUND_TRUTH: messages.Odometry,
    names.JOINT_STATES: messages.JointState,
    names.ODOM: messages.Odometry,
    names.SONAR: messages.Range,
    names.STALL: messages.Bool,
}
"""What is measured of a robot; a second laser scans on `base_scan_1`. `simulator.world.devices` has a row for each."""

_LATCHED = frozenset({names.MAP, names.TEAM_STATUS, names.TF_STATIC, names.BASE_INFO})
_LATCHED |= {names.AMCL_POSE, names.PLAN, names.GLOBAL_COSTMAP, names.LOCAL_COSTMAP}
_BESIDE = names.DONE, names.LOG
_ONE_WRITER = frozenset({names.BASE_INFO, names.CMD_VEL, names.CMD_VEL_NAV, names.CMD_VEL_TELEOP})


@lru_cache(maxsize=1024)
def is_measured(key: str) -> bool:
    """Whether the simulator, or a base, publishes a key."""
    target = names.split_robot_key(key)
    if target is None:
        return key == names.CLOCK
    return target[1] in (names.CMD_VEL, names.TF) or is_sensed(key)


def is_sensed(key: str) -> bool:
    """Whether a key carries what a sensor of a robot measures."""
    target = names.split_robot_key(key)
    return target is not None and _sensor(target[1]) is not None


def is_own(key_expr: str) -> bool:
    """Whether in lock-step the simulator or the aggregator alone writes a key, or that topic of every robot, in each
    tick: what a sensor measures, and the tree of transforms."""
    single = names.keys_in(key_expr, [0])[:1]
    return key_expr == names.TF or any(map(is_sensed, single))


def is_in_ticks(key: str) -> bool:
    """Whether in lock-step what participants publish on a key belongs to their tick: all but ticks and answers, logs,
    and statuses, which come by the host's time too."""
    target = names.split_robot_key(key)
    if target is not None:
        return target[1] not in (names.STATUS, names.LOG, names.DONE)
    return key not in (names.TICK, names.TEAM_STATUS) and not any(names.process_of(key, each) for each in _BESIDE)


@lru_cache(maxsize=1024)
def has_one_writer(key: str) -> bool:
    """Whether one process at a time publishes a key of a robot: its sensors, its base, and each source of its velocity.

    Transforms are merged, and any process may send a goal.
    """
    target = names.split_robot_key(key)
    return target is not None and (target[1] in _ONE_WRITER or is_sensed(key))


def _sensor(topic: str) -> type[messages.Message] | None:
    stem, _, number = topic.rpartition("_")
    return SENSORS.get(topic) or (SENSORS.get(stem) if number.isdigit() else None)


def is_latched(key: str) -> bool:
    """Whether a late subscriber of a key, or of that topic of every robot, gets the last message."""
    single = names.keys_in(key, [0])[:1]
    target = names.split_robot_key(single[0]) if single else None
    return (key if target is None else target[1]) in _LATCHED


def type_of_key(key: str) -> type[messages.Message] | None:
    """The type of the messages of a key (docs/keys.md), or None for a key that zteam does not use."""
    if names.process_of(key, names.DONE) is not None:
        return messages.Done
    if names.process_of(key, names.LOG) is not None:
        return messages.Log
    target = names.split_robot_key(key)
    if target is None:
        return _TEAM.get(key)
    return _ROBOT.get(target[1]) or _sensor(target[1])
