"""The contents of a team file as structs, each with the rules for its own keys, and the messages that they become."""

import math
from typing import Annotated, Any, Literal

import msgspec

from zteam import names
from zteam.config.numbers import Coordinate, RobotId
from zteam.config.problems import KeyValueError
from zteam.config.simulation_options import Options
from zteam.config.toml_values import toml_text
from zteam.geometry import Pose2, quaternion_from_rpy, turn_problem
from zteam.messages import Header, Quaternion, Transform, TransformStamped, Vector3
from zteam.messages.base import BaseOverride

NO_WORLD = "none"
"""`world = "none"`: real robots, no simulator."""

NO_BEHAVIOR = "none"
"""`behavior = "none"`: the team starts no process for the robot; a program of the user's own drives its base."""
WITHOUT_PROCESS = ("behavior", "follow", "base", "model", "description")
"""Keys of [defaults] that hold for such a robot too."""

Text = Annotated[str, msgspec.Meta(min_length=1)]
Restart = Literal["no", "on-failure"]
"""Whether `zteam up` starts a process again that has failed."""


class TeamSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [team]."""

    world: Text | None = None
    """A path relative to the file, the name of a shipped world, or "none". Without it `zteam up` needs --world."""
    # argparse and the engine take any whole number, but TOML guarantees no more than 64 bits.
    seed: Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)] = 1
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

    def __post_init__(self) -> None:
        if (self.model is None) != (self.pose is None):
            text = "model and pose go together (they add a robot that the world lacks); give both or neither"
            raise KeyValueError("pose" if self.model is None else "model", text)
        if self.pose is not None:
            if not all(map(math.isfinite, self.pose)):
                raise KeyValueError("pose", "give finite x, y, yaw")
            if text := turn_problem(self.pose.yaw):
                raise KeyValueError("pose", f"yaw {text}")
        for key, value in self.params.items():
            if not key.isidentifier():
                raise KeyValueError(key, "cannot be a parameter; use letters, digits and '_'")
            try:
                toml_text(value)
            except TypeError:
                text = "a parameter is a number, text, true, false, or an array or table of such"
                raise KeyValueError(key, text) from None
        idle = {"navigation": False, "restart": None, "safety": True}
        needless = [*self.params, *(key for key, default in idle.items() if getattr(self, key) != default)]
        if needless and not self.has_process:
            raise KeyValueError(needless[0], 'needs a process, and behavior = "none" starts none; leave it out')
        if self.follow is None and self.behavior == "follow":
            raise KeyValueError("behavior", "to follow needs a leader; say follow = ID instead")
        if "leader" in self.params and (self.follow is not None or self.behavior is None):
            raise KeyValueError("leader", "a robot that follows names its leader by follow = ID; drop the other key")
        if self.follow is not None and self.behavior not in (None, "follow"):
            raise KeyValueError("follow", f"both follow and behavior = {toml_text(self.behavior)}; keep one of them")
        if self.follow == self.id:
            raise KeyValueError("follow", f"robot {self.id} cannot follow itself; name another robot")

    @property
    def has_process(self) -> bool:
        """Whether the team starts a process for it."""
        return self.behavior != NO_BEHAVIOR


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
    x: Coordinate = 0.0
    y: Coordinate = 0.0
    z: Coordinate = 0.0
    yaw: Coordinate = 0.0
    pitch: Coordinate = 0.0
    roll: Coordinate = 0.0
    qx: float | None = None
    qy: float | None = None
    qz: float | None = None
    qw: float | None = None

    def __post_init__(self) -> None:
        if len({"", names.strip_slash(self.parent), names.strip_slash(self.child)}) < 3:
            raise KeyValueError("child", "must be the name of another frame than parent")
        for name in ("yaw", "pitch", "roll"):
            if text := turn_problem(getattr(self, name)):
                raise KeyValueError(name, text)
        given = self.quaternion
        # A tiny or huge quaternion cannot be normalised without loss; a rounded unit quaternion is close to 1.
        if given and (len(given) < 4 or self.yaw or self.pitch or self.roll):
            raise KeyValueError("qw", "belongs to all of qx, qy, qz, qw, without yaw, pitch, roll")
        if given and not 0.9 < math.hypot(*given) < 1.1:
            raise KeyValueError("qw", f"the quaternion has the length {math.hypot(*given):.3g}; it must be 1")

    @property
    def quaternion(self) -> list[float]:
        """Its qx, qy, qz, qw; empty if it has none."""
        return [part for part in (self.qx, self.qy, self.qz, self.qw) if part is not None]


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

    @property
    def driven(self) -> list[RobotEntry]:
        """The robots that have a process of the team."""
        return [robot for robot in self.robots if robot.has_process]

    def restarts(self, entry: RobotEntry | NodeEntry) -> bool:
        """Whether this robot or node is started again when it has failed."""
        return (entry.restart or self.team.restart) == "on-failure"


def behavior_of(entry: RobotEntry) -> tuple[str, dict[str, Any]]:
    """The name of the behaviour that the robot runs, and its parameters."""
    if entry.follow is not None:
        return "follow", {"leader": entry.follow, **entry.params}
    # A robot that is navigated stands when it has arrived.
    return entry.behavior or ("forward" if entry.navigation is False else "idle"), entry.params


def navigation_of(entry: RobotEntry) -> dict[str, Any] | None:
    """The table of parameters of the robot's navigation; None if it has none."""
    if isinstance(entry.navigation, dict):
        return entry.navigation
    return {} if entry.navigation else None


def static_transform(entry: StaticTransform) -> TransformStamped:
    """The message that publishes it, with stamp 0 and a normalised quaternion."""
    norm = math.hypot(*entry.quaternion)
    given = [part / norm for part in entry.quaternion] or quaternion_from_rpy(entry.roll, entry.pitch, entry.yaw)
    return TransformStamped(
        Header(frame_id=names.strip_slash(entry.parent)),
        names.strip_slash(entry.child),
        Transform(Vector3(entry.x, entry.y, entry.z), Quaternion(*given)),
    )
