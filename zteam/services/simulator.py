"""Requests and replies of the simulator's queries (`sim/status`, `sim/step`, …), for the simulator and its clients.

A request that is refused is answered with an error that says why.
"""

from collections.abc import Sequence
from typing import Annotated

import msgspec

from zteam.bus import Change
from zteam.geometry import yaw_from_quaternion
from zteam.messages import MapMetaData
from zteam.names import MAX_ROBOT_ID
from zteam.robot_ids import format_robot_ids

RobotId = Annotated[int, msgspec.Meta(ge=0, le=MAX_ROBOT_ID)]
BOUNDARY_LIMIT = 60.0
"""Host seconds that a change waits for the open tick to end, which a hung participant may hold."""
MAX_TICKS = 1_000_000_000_000
MIN_SPEED, MAX_SPEED = 1e-6, 1e6
"""Simulated seconds a second of the host."""
MAX_PLACE = 1e6
"""Metres from the origin of `map`, and radians of a yaw, at most."""
Place = Annotated[float, msgspec.Meta(ge=-MAX_PLACE, le=MAX_PLACE)]
MAX_WAIT = 60.0
"""Host seconds that `sim/finish` and `sim/stand` wait at most."""


class StepRequest(Change):
    """`sim/step`: run so many ticks, then stand still. The answer comes when the world stands."""

    ticks: Annotated[int, msgspec.Meta(ge=1, le=MAX_TICKS)] = 1
    wait: bool = True
    """False: answer at once; `sim/stand` tells when the world stands. For steps that outlast any query."""


class SpeedRequest(Change):
    """`sim/speed`: simulated seconds a second of the host; None = as fast as possible."""

    speed: Annotated[float, msgspec.Meta(ge=MIN_SPEED, le=MAX_SPEED)] | None = None


class SpawnRequest(Change):
    """`sim/spawn`: a further robot of a macro of the world's file, at x, y (m), yaw (rad) in `map`."""

    x: Place
    y: Place
    yaw: Place = 0.0
    model: str = "erratic"
    id: RobotId | None = None
    """None: the lowest that is free."""
    force: bool = False
    """Also where it has no room: in a wall or in another robot, or outside of the world."""


class SpawnReply(msgspec.Struct):
    """The new robot's id."""

    id: int


class RemoveRequest(Change):
    """`sim/remove`: take a robot out of the world."""

    id: RobotId


class MoveRequest(Change):
    """`sim/move`: lift a robot to x, y (m), yaw (rad) in `map`."""

    id: RobotId
    x: Place
    y: Place
    yaw: Place = 0.0
    force: bool = False
    """As in `sim/spawn`."""


class FinishRequest(msgspec.Struct):
    """`sim/finish`: wait until the time of `--for` is over, `timeout` host seconds at most."""

    timeout: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_WAIT)] = 0.0


class FinishReply(msgspec.Struct):
    """Whether it is."""

    finished: bool


class Timing(msgspec.Struct):
    """Milliseconds of the host a tick, on average since GO."""

    wait: float
    """For the participants' answers (lock-step)."""
    physics: float
    sensors: float
    publish: float
    idle: float
    """Until the next tick was due."""


class MapInfo(msgspec.Struct, frozen=True):
    """Where an occupancy grid lies in `map`: the pose of the lower left corner of its first cell, and its size."""

    x: float
    y: float
    yaw: float
    resolution: float
    """Metres a cell."""
    columns: int
    rows: int


def map_info(metadata: MapMetaData) -> MapInfo:
    """Where a grid lies, of the metadata in its message."""
    position, turn = metadata.origin.position, metadata.origin.orientation
    yaw = yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w)
    return MapInfo(position.x, position.y, yaw, metadata.resolution, metadata.width, metadata.height)


class SimStatus(msgspec.Struct):
    """Answer to `sim/status`."""

    world: str
    robots: list[int]
    interval: int
    """Nanoseconds of simulated time a tick."""
    seed: int
    now: int
    """Nanoseconds of simulated time; 0 before the first tick."""
    tick: int
    real_time_factor: float
    """Simulated seconds a second of the host over the last few seconds."""
    speed: float | None = 1.0
    """What was asked for; None = as fast as possible."""
    paused: bool = False
    lockstep: bool = False
    participants: list[str] = []
    """Lock-step: the participants of the tick at hand."""
    joining: list[str] = []
    """Lock-step: the processes that take part from the next tick on."""
    waiting_for: str = ""
    """Lock-step: what holds the world."""
    hung: list[str] = []
    """Lock-step: the participants that were left behind so far; `router` where its link was lost."""
    finished: bool = False
    """Whether the time asked for with `--for` is over and the world stands still."""
    instance: str = ""
    """This simulator's session id."""
    writers: dict[int, list[str]] = {}
    """Robots that more than one process commands, and the session ids of these."""
    map: MapInfo | None = None
    """The grid of the world, as the simulator publishes it on `map`."""


class RobotShape(msgspec.Struct):
    """What a robot looks like from above, in its `base_footprint`."""

    model: str
    outline: list[list[tuple[float, float]]]
    """Polygons, counter-clockwise, the lowest first; metres."""
    lasers: list[tuple[float, float, float]]
    """x, y, yaw of each laser, in the order of their topics."""


class ObstacleShape(msgspec.Struct):
    """A model without a drive."""

    name: str
    x: float
    """Of its origin in `map`, as y and yaw."""
    y: float
    yaw: float
    outline: list[list[tuple[float, float]]]
    """Polygons around its origin; metres."""
    movable: bool
    """Whether robots can push it."""


class ShapesReply(msgspec.Struct):
    """Answer to `sim/shapes`: what the robots look like, and which models `sim/spawn` makes."""

    robots: dict[int, RobotShape]
    models: list[str]


class ObstaclesReply(msgspec.Struct):
    """Answer to `sim/obstacles`: the obstacles where they are now."""

    obstacles: list[ObstacleShape]


def absence_text(robot_id: int, robots: Sequence[int]) -> str:
    """What is said of a robot that the world lacks: which robots it has, and the way out."""
    has = format_robot_ids(robots) or "no robot"
    spawn = f"'zteam sim spawn --id {robot_id} --pose X Y YAW' adds it"
    return f"not in the world; it has {has} ({spawn})"


class StandRequest(msgspec.Struct):
    """`sim/stand`: wait until the world stands still, `timeout` host seconds at most."""

    timeout: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_WAIT)] = 0.0


class StandReply(msgspec.Struct):
    """Whether it does: the tick at hand is over, and no further one is due."""

    stands: bool
    status: SimStatus


class Gap(msgspec.Struct):
    """Distance between the centres of two robots since GO, in metres."""

    mean: float
    max: float
    end: float


class RobotReport(msgspec.Struct):
    """What one robot did since GO, by the simulator's own truth."""

    id: int
    follow: int | None
    pose: tuple[float, float, float]
    """x, y, yaw in `map`."""
    distance_m: float
    """Length of the path driven."""
    stalls: int
    """How often the robot ran into something."""
    gap_m: Gap | None
    """To the robot it follows."""
    scans: int
    late_steps: int
    """Ticks without a command of the robot until the next tick."""


class Latency(msgspec.Struct):
    """Milliseconds from a robot's scan being sent to its command's arrival here."""

    p50: float | None
    p99: float | None
    count: int


class RunFigures(msgspec.Struct, kw_only=True):
    """The figures of a run, counted by the simulator from GO on. Each of them is in `sim/report` and in the file that
    `zteam up --report` writes."""

    sim_seconds: float
    """Since GO; 0 before."""
    seed: int
    external_commands: int
    """Commands that did not come from the process that holds the robot's name."""
    robots: list[RobotReport]
    latency_ms: Latency
    ticks: int = 0
    """Counted, that of GO included."""
    real_time_factor: float | None = None
    """Simulated seconds a second of the host, from the first of these ticks to the last."""
    trajectory_sha256: str = ""
    """Of x, y, yaw as little-endian 64-bit floats, by robot id, for every tick from GO on. In lock-step the same seed
    gives the same hash."""
    lockstep: bool = False
    resends: int = 0
    """Lock-step: how often a tick had to be sent again."""
    hung: list[str] = []
    """Lock-step: participants that were left behind; `router` where its link was lost."""
    timing_ms: Timing | None = None
    lateness_p99_ms: float | None = None
    """How late ticks began after they were due, with a speed."""


class SimReport(RunFigures, kw_only=True):
    """Answer to `sim/report`."""

    finished: bool
    """Whether the time asked for with `--for` is over and the world stands still."""
    wall_seconds: float = 0.0
    """Host time from the first counted tick to the last."""
