"""The contents of a team file as structs, and the messages that they become."""

import math
from typing import Annotated, Any, Literal

import msgspec

from zteam import names
from zteam.config.simulation_options import Options
from zteam.geometry import Pose2, quaternion_from_rpy
from zteam.messages import Header, Quaternion, Transform, TransformStamped, Vector3
from zteam.messages.base import BaseOverride

NO_WORLD = "none"
"""`world = "none"`: real robots, no simulator."""

RobotId = Annotated[int, msgspec.Meta(ge=0, le=names.MAX_ROBOT_ID)]
# argparse and the engine take any whole number, but TOML guarantees no more than 64 bits.
Seed = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
Text = Annotated[str, msgspec.Meta(min_length=1)]
Restart = Literal["no", "on-failure"]
"""Whether `zteam up` starts a process again that has failed."""


class TeamSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [team]."""

    world: Text | None = None
    """A path relative to the file, the name of a shipped world, or "none". Without it `zteam up` needs --world."""
    seed: Seed = 1
    world_robots: bool = True
    """False: leave the world's own robots out, and simulate only those that the team adds with a `pose`."""
    restart: Restart = "no"
    """For the robots and nodes that do not say it themselves."""
    map: Text | None = None
    """A map file (map_server's YAML) that `zteam-map` serves in the place of the simulator's own map."""


class RobotEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One robot: a [[robots]] table, or one of its `ids`."""

    id: RobotId
    behavior: Text | None = None
    follow: RobotId | None = None
    model: Text | None = None
    """With `pose`: add a robot of this model to the world."""
    pose: Pose2 | None = None
    base: BaseOverride = BaseOverride()
    """The table [robots.base]: what holds for this robot instead of its `base_info`."""
    description: Text | None = None
    """A URDF file, relative to the team file; the aggregator publishes its joints."""
    safety: bool = True
    """False: drive without the safety layer."""
    restart: Restart | None = None
    navigation: bool | dict[str, Any] = False
    """Whether `zteam-nav` navigates it: true, or the table [robots.navigation] with parameters under Nav2's names."""
    params: dict[str, Any] = {}
    """Every other key of the table: the parameters of the behaviour, which the behaviour checks."""


class NodeEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One [[nodes]] table: a user's own process as a member of the team."""

    name: Text
    """As the process calls itself on the bus."""
    command: Annotated[tuple[Text, ...], msgspec.Meta(min_length=1)]
    """The program and its arguments; `python` is this interpreter."""
    folder: Text = "."
    """Where it runs, relative to the team file."""
    expect: bool = False
    """Whether the first tick of lock-step waits for it."""
    restart: Restart | None = None


class StaticTransform(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One [[static_transforms]] table: the pose of `child` in `parent`, metres and radians."""

    parent: Text
    child: Text
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    qx: float | None = None
    qy: float | None = None
    qz: float | None = None
    qw: float | None = None


GRANTS = ("teleop", "goals", "simulation", "parameters", "processes", "transforms", "release")
"""What a certificate may do beyond its process's part in the team (`team.security.access`)."""


class Security(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [security]."""

    # A dictionary of unknown keys: `check_grants` checks the words.
    grants: dict[str, Any] = {}
    """Lists of words of GRANTS, by the name of the certificate."""


class Team(msgspec.Struct, frozen=True):
    """A whole team, with what its file includes."""

    robots: list[RobotEntry]
    team: TeamSection = TeamSection()
    static_transforms: list[StaticTransform] = []
    simulation: Options = Options()
    security: Security = Security()
    nodes: list[NodeEntry] = []
    folders: tuple[str, ...] = ()
    """Of its file and of those that it includes, absolute: modules of behaviours may lie there."""

    def restarts(self, entry: RobotEntry | NodeEntry) -> bool:
        """Whether this robot or node is started again when it has failed."""
        return (entry.restart or self.team.restart) == "on-failure"


DEFAULT_BEHAVIOR = "forward"
DEFAULT_WITH_NAVIGATION = "idle"
"""A robot that has arrived stands."""


def behavior_of(entry: RobotEntry) -> tuple[str, dict[str, Any]]:
    """The name of the behaviour that the robot runs, and its parameters."""
    if entry.follow is not None:
        return "follow", {"leader": entry.follow, **entry.params}
    default = DEFAULT_BEHAVIOR if entry.navigation is False else DEFAULT_WITH_NAVIGATION
    return entry.behavior or default, entry.params


def navigation_of(entry: RobotEntry) -> dict[str, Any] | None:
    """The table of parameters of the robot's navigation; None if it has none."""
    if isinstance(entry.navigation, dict):
        return entry.navigation
    return {} if entry.navigation else None


def static_transform(entry: StaticTransform) -> TransformStamped:
    """The message that publishes it, with stamp 0 and a normalised quaternion."""
    given = quaternion(entry)
    if given:
        norm = math.hypot(*given)
        rotation = Quaternion(*(q / norm for q in given))
    else:
        rotation = Quaternion(*quaternion_from_rpy(entry.roll, entry.pitch, entry.yaw))
    return TransformStamped(
        Header(frame_id=names.strip_slash(entry.parent)),
        names.strip_slash(entry.child),
        Transform(Vector3(entry.x, entry.y, entry.z), rotation),
    )


def quaternion(entry: StaticTransform) -> tuple[float, float, float, float] | None:
    """Its qx, qy, qz, qw; None unless all four are given."""
    if entry.qx is None or entry.qy is None or entry.qz is None or entry.qw is None:
        return None
    return entry.qx, entry.qy, entry.qz, entry.qw
