"""The one place that builds and reads key expressions and frame ids (docs/architecture.md lists them)."""

import re

from zteam.errors import UsageError

MAX_ROBOT_ID = 9999
"""Ids fit the int32 of RobotStatus many times over; the bound keeps a mistyped id from looking like a robot."""

MAP_FRAME = "map"
GLOBAL_FRAMES = frozenset({"map", "earth"})
"""Frames of the whole team (REP 105): never prefixed."""

CLOCK = "clock"
MAP = "map"
TF = "tf"
TF_STATIC = "tf_static"
TEAM_STATUS = "team_status"

SIMULATOR = "sim"
AGGREGATOR = "tf"
MONITOR = "monitor"
LAUNCHER = "up"

TICK = "sim/tick"
"""Lock-step: the simulator's numbered ticks."""
DONE = "done"

STATIC_CALLER = "static"
"""Name in the token of a process that asked the aggregator for a fixed transform."""

CMD_VEL = "cmd_vel"
TELEOP = "teleop"
BASE_SCAN = "base_scan"
SONAR = "sonar"
ODOM = "odom"
GROUND_TRUTH = "base_pose_ground_truth"
STALL = "stall"
FIDUCIALS = "fiducials"
BUMPER = "bumper"
BLOBS = "blobs"
JOINT_STATES = "joint_states"
STATUS = "status"

BASE_FOOTPRINT = "base_footprint"
BASE_LINK = "base_link"
BASE_LASER_LINK = "base_laser_link"

_ROBOT = re.compile(r"robot_(0|[1-9][0-9]*)", re.ASCII)
_ID = re.compile(r"[0-9]+", re.ASCII)


def parse_robot_id(text: str) -> int:
    """The robot id that a user typed. Raises UsageError for anything but a whole number in 0..MAX_ROBOT_ID."""
    # Digits beyond the bound's own length are refused before int(): a thousand digits are no robot's id.
    if not _ID.fullmatch(text) or len(text.lstrip("0")) > len(str(MAX_ROBOT_ID)) or int(text) > MAX_ROBOT_ID:
        shown = text if len(text) <= 20 else text[:20] + "…"
        raise UsageError(f"robot id {shown!r} is not a whole number from 0 to {MAX_ROBOT_ID}")
    return int(text)


def robot_name(robot_id: int) -> str:
    """`robot_N`: the robot's name on the bus and the prefix of its frames."""
    return f"robot_{robot_id}"


def robot_id_of(name: str) -> int | None:
    """The id in `robot_N`, or None where `name` is no robot's."""
    match = _ROBOT.fullmatch(name)
    if not match or len(match[1]) > len(str(MAX_ROBOT_ID)) or int(match[1]) > MAX_ROBOT_ID:
        return None
    return int(match[1])


def robot_key(robot_id: int, topic: str) -> str:
    """`robot_N/topic`."""
    return f"robot_{robot_id}/{topic}"


def all_robots_key(topic: str) -> str:
    """The wildcard for `topic` of every robot (`robot_*` would not be a key expression)."""
    return f"robot_$*/{topic}"


def split_robot_key(key: str) -> tuple[int, str] | None:
    """(robot id, topic) of `robot_N/topic`, or None for any other key, wildcards included."""
    name, slash, topic = key.partition("/")
    robot_id = robot_id_of(name)
    if robot_id is None or not slash or not topic or is_wildcard(topic):
        return None
    return robot_id, topic


def is_wildcard(key: str) -> bool:
    """Whether a sample's key is an expression; such a sample has no single address and is refused."""
    return "*" in key or "$" in key


def strip_slash(name: str) -> str:
    """A key or frame as users of ROS write it, without its leading slash."""
    return name[1:] if name.startswith("/") else name


def scan_key(robot_id: int, index: int) -> str:
    """Key of the robot's `index`-th laser: `base_scan`, `base_scan_1`, …"""
    return robot_key(robot_id, numbered(BASE_SCAN, index))


def numbered(stem: str, index: int, *, always: bool = False) -> str:
    """Topic or local frame of the `index`-th device of a kind: `stem`, `stem_1`, …; with `always`, `stem_0` first."""
    return stem if index == 0 and not always else f"{stem}_{index}"


def robot_frame(robot_id: int, local: str) -> str:
    """`robot_N/local`."""
    return f"robot_{robot_id}/{local}"


def is_robot_frame(frame: str, local: str) -> bool:
    """Whether `frame` is some robot's frame `local`."""
    owner, _, rest = frame.partition("/")
    return rest == local and robot_id_of(owner) is not None


def resolve_frame(prefix: str, name: str) -> str:
    """tf::resolve for zteam: the tree's name of frame `name` as robot `prefix` wrote it.

    A leading slash makes a name global; `map` and `earth` are global; a name that carries the prefix keeps it.
    """
    if name.startswith("/"):
        return name[1:]
    if not prefix or name in GLOBAL_FRAMES or name.startswith(prefix + "/"):
        return name
    return f"{prefix}/{name}"


def token_key(name: str, instance: str) -> str:
    """Presence token of one instance (session) of the process `name`."""
    return f"{name}/alive/{instance}"


def claim_key(name: str, instance: str) -> str:
    """Token of an instance that asks for the name `name`."""
    return f"{name}/claim/{instance}"


def tokens_key(name: str = "*") -> str:
    """Wildcard over the presence tokens of `name`, by default of all processes."""
    return f"{name}/alive/*"


def claims_key(name: str) -> str:
    """Wildcard over the claims on `name`."""
    return f"{name}/claim/*"


def split_token_key(key: str) -> tuple[str, str] | None:
    """(name, instance) of a presence token's key, or None."""
    parts = key.split("/")
    if len(parts) != 3 or parts[1] != "alive" or is_wildcard(key):
        return None
    return parts[0], parts[2]


def done_key(name: str = "*") -> str:
    """Lock-step: the answers of the participant `name`, by default of all."""
    return f"{name}/{DONE}"


def split_done_key(key: str) -> str | None:
    """The participant's name in `<name>/done`, or None."""
    name, _, rest = key.rpartition("/")
    return name if rest == DONE and name and "/" not in name and not is_wildcard(name) else None


def info_key(name: str) -> str:
    """Query: the process behind a name (host, pid, start)."""
    return f"{name}/info"


def stats_key(name: str) -> str:
    """Query: received and dropped messages of this process, per key."""
    return f"{name}/stats"


def service_key(name: str, service: str) -> str:
    """Query `service` of process `name`: `sim/report`, `tf/lookup`, …"""
    return f"{name}/{service}"
