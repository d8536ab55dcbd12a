"""Key expressions and frame ids (docs/keys.md). No other module builds or parses them."""

import re
import secrets
from collections.abc import Iterable
from functools import lru_cache, partial

from zteam.errors import UsageError

MAX_ROBOT_ID = 9999
"""The largest robot id. It is far below the int32 of RobotStatus, so that most mistyped ids are refused."""

MAP_FRAME = "map"
GLOBAL_FRAMES = frozenset({"map", "earth"})
"""Frames of the whole team (REP 105): they never get a prefix."""

CLOCK = "clock"
MAP = "map"
TF = "tf"
TF_STATIC = "tf_static"
TEAM_STATUS = "team_status"

SIMULATOR = "sim"
AGGREGATOR = "tf"
MONITOR = "monitor"
MAP_SERVER = "map"
LAUNCHER = "up"
VIEW = "view"
GOALS = "goals"
ROUTER = "router"
RECORDER = "recorder"
REPLAY = "replay"
OPERATOR = "operator"
"""Name of the certificate of people's tools."""
AUTHORITY = "ca"
"""Name of the files of the authority that makes a team's certificates."""

TICK = "sim/tick"
"""Lock-step: key of the simulator's numbered ticks."""
DONE = "done"
LOG = "log"
RESTARTS = "restarts"
"""Query of the launcher for what it has started again."""
START = "start"
"""Query of the launcher that starts the process of a robot."""
LINKS = "links"
"""Query of the launcher that makes the link of a process bad, or good."""
SIGNAL = "signal"
"""Query of the launcher that kills or freezes a process which it has started."""
LACKING = "lacking"
"""Lock-step: query for the inputs of the open tick that a participant waits for."""

STATIC_CALLER = "static"
"""Name in the token of a process that asked the aggregator for a static transform."""

CMD_VEL = "cmd_vel"
CMD_VEL_TELEOP = "cmd_vel_teleop"
CMD_VEL_NAV = "cmd_vel_nav"
GOAL_POSE = "goal_pose"
INITIAL_POSE = "initialpose"
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
PLAN = "plan"
LOCAL_PLAN = "local_plan"
GLOBAL_COSTMAP = "global_costmap/costmap"
LOCAL_COSTMAP = "local_costmap/costmap"
AMCL_POSE = "amcl_pose"
PARTICLE_CLOUD = "particle_cloud"
PUBLISHED_FOOTPRINT = "published_footprint"
NAVIGATION = "navigation"
"""Below it are the status of a robot's navigation, and its queries (`zteam.navigation.client`)."""
NAVIGATION_STATUS = f"{NAVIGATION}/status"
BASE_INFO = "base_info"
STOP = "stop"
"""Query: whether the robot is stopped, by each process that stops it."""
ENGAGE = f"{STOP}/engage"
"""Query that stops the robot."""
RELEASE = f"{STOP}/release"
"""Query that releases the robot."""
PAUSE_GOALS = f"{GOALS}/pause"
"""Query that pauses the goals of a list; `robot_N/goals` says whether they are."""
RESUME_GOALS = f"{GOALS}/resume"
"""Query that resumes the goals of a list."""

BASE_FOOTPRINT = "base_footprint"
BASE_LINK = "base_link"
BASE_LASER_LINK = "base_laser_link"

PUBLISHES, ANSWERS = "publishes", "answers"
"""What a process does with a key, in `right_key`."""

# `robot_*` is not a valid key expression.
ALL_ROBOTS = "robot_$*"
KEYS_WITHOUT_MAPS = tuple(
    f"**/{key}" for key in (f"{ALL_ROBOTS}/*", f"{SIMULATOR}/*", CLOCK, DONE, TF, TF_STATIC, TEAM_STATUS)
)
"""In all namespaces: keys on which large messages are a mistake. A robot's costmaps have one chunk more."""
_ROBOT = re.compile(r"(robot_|nav_|base_)(0|[1-9][0-9]{0,3})", re.ASCII)
"""With as many digits as MAX_ROBOT_ID has."""
_LATCHED = "/@adv/pub/"
_TOKEN = re.compile(r"(?:([^*$]+)/)?([^*$/]*)/alive/([^*$/]*)")
_ID = re.compile(r"0*[0-9]{1,4}", re.ASCII)


def parse_robot_id(text: str) -> int:
    """The robot id that a user typed. Raises UsageError unless it is a whole number from 0 to MAX_ROBOT_ID."""
    if not _ID.fullmatch(text):
        shown = text if len(text) <= 20 else text[:20] + "…"
        named = robot_id_of(text)
        hint = "" if named is None else f"; give {named}"
        raise UsageError(f"robot id {shown!r} is not a whole number from 0 to {MAX_ROBOT_ID}{hint}")
    return int(text)


@lru_cache(maxsize=1024)
def robot_name(robot_id: int) -> str:
    """`robot_N`: the robot's name on the bus and the prefix of its frames."""
    return f"robot_{robot_id}"


navigation_name = "nav_{}".format
"""`nav_N`: the name of the process that navigates robot N. A process of several robots holds several names."""
base_name = "base_{}".format
"""`base_N`: the name of the base driver of robot N, and of its certificate."""


@lru_cache(maxsize=1024)
def _id_in(stem: str, name: str) -> int | None:
    match = _ROBOT.fullmatch(name)
    return int(match[2]) if match and match[1] == stem else None


robot_id_of = partial(_id_in, "robot_")
"""The id in `robot_N`, or None if the name is not a robot's."""
navigated_robot_of = partial(_id_in, "nav_")
"""The robot's id in `nav_N`, or None if the name is not that of a navigation process."""
base_robot_of = partial(_id_in, "base_")
"""The robot's id in `base_N`, or None if the name is not that of a base driver."""


_NAME = re.compile(r"[A-Za-z0-9_.-]{1,100}")
_TOPICS = frozenset({CLOCK, MAP, TF, TF_STATIC, TEAM_STATUS})
_PROCESSES = frozenset({SIMULATOR, AGGREGATOR, MONITOR, MAP_SERVER, LAUNCHER, VIEW, ROUTER, OPERATOR, RECORDER})


def name_problem(name: str) -> str:
    """Why no process and no certificate may have this name, in one line; empty if one may.

    A name is one part of a key. What is below a name is its process's own, and in Zenoh `clock/**` includes `clock`.
    """
    if not _NAME.fullmatch(name):
        return f"{name!r:.60} cannot be a name; use letters, digits, '_', '-' and '.', at most 100 of them"
    if name in _TOPICS - _PROCESSES:
        return f"{name} is a topic of the team; choose another name"
    # Files of the authority have this name, on some systems in any case.
    if name == STATIC_CALLER or name.lower() == AUTHORITY:
        return f"{name} is a name that zteam uses itself; choose another name"
    return ""


def is_taken(name: str) -> bool:
    """Whether a process of zteam, or people's tools, have this name in every team: no node of a user may."""
    return name in _PROCESSES or is_view(name)


def view_name() -> str:
    """A new name for one of several views."""
    return f"{VIEW}_{secrets.token_hex(3)}"


def is_view(name: str) -> bool:
    """Whether `name` is that of a view: `view`, which a team was started with, or `view_…`."""
    return name == VIEW or name.startswith(f"{VIEW}_")


def is_of_team(name: str) -> bool:
    """Whether a process of this name drives or simulates robots, or starts those that do.

    Monitors, views, tools and a user's own nodes are no team.
    """
    return name in {SIMULATOR, AGGREGATOR, LAUNCHER} or _ROBOT.fullmatch(name) is not None


@lru_cache(maxsize=4096)
def robot_key(robot_id: int, topic: str) -> str:
    """`robot_N/topic`."""
    return f"robot_{robot_id}/{topic}"


robot_frame = robot_key
"""`robot_N/local`: a robot's frames have the form of its keys."""
all_robots_key = f"{ALL_ROBOTS}/{{}}".format
"""The wildcard for a topic of every robot."""


def input_key(robot_id: int, topic: str) -> str:
    """The key that robot `robot_id` means by a topic: its own, unless `topic` is that of robots or begins with a slash.

    `goal_pose` is its own; `robot_2/odom`, `robot_$*/status` and `/map` are keys.
    """
    if topic.startswith("/"):
        return topic[1:]
    if topic.startswith(all_robots_key("")) or split_robot_key(topic) is not None:
        return topic
    return robot_key(robot_id, topic)


def keys_in(key_expr: str, robot_ids: Iterable[int]) -> list[str]:
    """The keys that a key expression means to a team of these robots; none for a wildcard over anything but robots."""
    prefix, slash, topic = key_expr.partition("/")
    if not is_wildcard(key_expr):
        return [key_expr]
    if is_wildcard(topic) or f"{prefix}{slash}" != all_robots_key(""):
        return []
    return [robot_key(robot_id, topic) for robot_id in robot_ids]


@lru_cache(maxsize=4096)
def split_robot_key(key: str) -> tuple[int, str] | None:
    """(robot id, topic) of `robot_N/topic`, or None for any other key, wildcards included."""
    name, slash, topic = key.partition("/")
    robot_id = robot_id_of(name)
    if robot_id is None or not slash or not topic or is_wildcard(topic):
        return None
    return robot_id, topic


def is_wildcard(key: str) -> bool:
    """Whether a sample's key is a wildcard; such a sample has no single destination and is dropped."""
    return "*" in key or "$" in key


def fixed_part(key_expr: str) -> str:
    """The parts of a key expression before its first wildcard, such as `robot_1` of `robot_1/base_scan$*`."""
    head, wildcard, _ = key_expr.partition("*")
    return head.rpartition("/")[0] if wildcard else key_expr


def is_own_query(name: str, key: str) -> bool:
    """Whether a query's key is one that the process of this name answers for itself alone."""
    robot_id, target = navigated_robot_of(name), split_robot_key(key)
    if robot_id is not None:
        return target is not None and target[0] == robot_id and target[1].startswith(f"{NAVIGATION}/")
    if name == GOALS:
        return target is not None and target[1] in (PAUSE_GOALS, RESUME_GOALS)
    return key.startswith(f"{name}/")


def strip_slash(name: str) -> str:
    """A key or frame without the leading slash that ROS users write."""
    return name[1:] if name.startswith("/") else name


def scan_key(robot_id: int, index: int) -> str:
    """Key of the robot's `index`-th laser: `base_scan`, `base_scan_1`, …"""
    return robot_key(robot_id, numbered(BASE_SCAN, index))


def numbered(stem: str, index: int, *, always: bool = False) -> str:
    """Topic or local frame of the `index`-th device of a kind: `stem`, `stem_1`, …; with `always`, `stem_0` first."""
    return stem if index == 0 and not always else f"{stem}_{index}"


all_numbered = "{}$*".format
"""Wildcard over the topics of all devices of a kind, of which this is the stem."""


def is_robot_frame(frame: str, local: str) -> bool:
    """Whether `frame` is some robot's frame `local`."""
    target = split_robot_key(frame)
    return target is not None and target[1] == local


def resolve_frame(prefix: str, name: str) -> str:
    """The name in the tree of the frame that robot `prefix` calls `name`, by the rules of ROS 1's tf::resolve.

    A name with a leading slash is global, and so are `map` and `earth`. A name that has the prefix already keeps it.
    """
    if name.startswith("/"):
        return name[1:]
    if not prefix or name in GLOBAL_FRAMES or name.startswith(prefix + "/"):
        return name
    return f"{prefix}/{name}"


service_key = "{}/{}".format
"""Query of the process with this name, and its service: `sim/report`, `tf/lookup`, …"""
info_key = "{}/info".format
"""Query: host, pid and start of the process with this name."""
stats_key = "{}/stats".format
"""Query: received and dropped messages of the process with this name, per key."""
log_key = f"{{}}/{LOG}".format
"""Key of the log of the process with this name, and of the query for its newest lines."""
done_key = f"{{}}/{DONE}".format
"""Lock-step: key of the answers of the participant with this name."""

token_key = "{}/alive/{}".format
"""Presence token of the process with this name, and of one of its instances (sessions)."""
tokens_key = "{}/alive/*".format
"""Wildcard over the presence tokens of a name; `*` stands for all processes.

For a session without a namespace, `**` stands for those of all namespaces.
"""
claim_key = "{}/claim/{}".format
"""Token of an instance that claims this name; `*` is the wildcard over all that do."""
lockstep_key = f"{SIMULATOR}/lockstep/{{}}".format
"""The token of a simulator in lock-step by its instance."""
right_key = "{}/@adv/{}/{}".format
"""Token that shows whether its instance, the last part, may do this with a key, the first one: PUBLISHES or ANSWERS."""
checked_key = "@session/{}/checked/{}".format
"""Token with a number that an instance declares after others, which are at the router when this one is."""
latched_tokens_key = f"{{}}{_LATCHED}**".format
"""Wildcard over the tokens of the latched publishers on a key expression, which Zenoh makes: their key, session and
number. Each answers queries on its token with its last message."""

# No wildcard means a part that begins with @, and no process has such a name.
declarations_key = "@session/{}/declarations".format
"""Query: the publishers and subscribers of an instance, or with `*` of each."""
session_info_key = "@session/{}/info".format
"""Query: which process an instance is, and whether it publishes on a key."""


@lru_cache(maxsize=1024)
def process_of(key: str, topic: str) -> str | None:
    """The process's name in `<name>/topic`, such as DONE or LOG, or None for any other key."""
    name, _, rest = key.rpartition("/")
    return name if rest == topic and name and "/" not in name and not is_wildcard(name) else None


def split_latched_token(token: str) -> tuple[str, str, str]:
    """Key, session and number of the latched publisher that has a token."""
    key, _, publisher = token.partition(_LATCHED)
    session, _, rest = publisher.partition("/")
    return key, session, rest.partition("/")[0]


def split_namespaced_token_key(key: str) -> tuple[str, str, str] | None:
    """(namespace, name, instance) of a token's key as a session without a namespace sees it, or None."""
    match = _TOKEN.fullmatch(key)
    return None if match is None else (match[1] or "", match[2], match[3])


def split_token_key(key: str) -> tuple[str, str] | None:
    """(name, instance) of a presence token's key, or None."""
    match = _TOKEN.fullmatch(key)
    return None if match is None or match[1] else (match[2], match[3])
