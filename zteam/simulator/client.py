"""The simulator's queries (`sim/status`, `sim/step`, …): requests and replies, both as calls for programs, and its time
for those that are no nodes.

A request that is refused is answered with an error that says why.
"""

from collections.abc import Callable, Sequence
from typing import Annotated, TypeVar

import msgspec

from zteam import names
from zteam.bus import Bus, Change
from zteam.bus.transport import Closeable
from zteam.clock import AutoClock
from zteam.config.fault import Fault
from zteam.config.numbers import Coordinate, RobotId
from zteam.config.problems import problems_of
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import BusError, QueryError, QueryTimeoutError, UsageError
from zteam.messages import Clock, MapMetaData, ns_from_time
from zteam.messages.planar import pose2_of

T = TypeVar("T")

BOUNDARY_LIMIT = 60.0
"""Host seconds that a change waits for the open tick to end, which a hung participant may hold."""
MAX_TICKS = 1_000_000_000_000
MIN_SPEED, MAX_SPEED = 1e-6, 1e6
"""Simulated seconds a second of the host."""
MAX_WAIT = 60.0
"""Host seconds that `sim/finish` and `sim/stand` wait at most."""
ANSWER_LIMIT = 10.0
"""Host seconds for an answer that waits for nothing but a crowded machine."""
CHANGE_LIMIT = BOUNDARY_LIMIT + ANSWER_LIMIT
"""Host seconds for a change to the world, which waits for the tick at hand to end."""
SETTLE = 2.0
"""Host seconds that `pause` and `reset` wait for the tick at hand, which a participant may hold in lock-step."""
LOOK = 1.0
"""Host seconds between two reports on a long step's progress."""


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

    x: Coordinate
    y: Coordinate
    yaw: Coordinate = 0.0
    model: str = "erratic"
    id: RobotId | None = None
    """None: the lowest that is free."""
    force: bool = False
    """Also where it has no room: in a wall or in another robot, or outside of the world."""


class SpawnReply(msgspec.Struct):
    id: int


class RemoveRequest(Change):
    """`sim/remove`: take a robot out of the world."""

    id: RobotId


class MoveRequest(Change):
    """`sim/move`: lift a robot to x, y (m), yaw (rad) in `map`."""

    id: RobotId
    x: Coordinate
    y: Coordinate
    yaw: Coordinate = 0.0
    force: bool = False
    """As in `sim/spawn`."""


class FaultRequest(Change):
    """`sim/fault`: a fault that begins with the next tick, whatever its `at` says (lock-step)."""

    fault: Fault


class WaitRequest(msgspec.Struct):
    """`sim/finish`, `sim/stand`: wait until the time of `--for` is over, or until the world stands still."""

    timeout: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_WAIT)] = 0.0
    """Host seconds at most."""


class FinishReply(msgspec.Struct):
    """Whether the time of `--for` is over."""

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
    return MapInfo(*pose2_of(metadata.origin), metadata.resolution, metadata.width, metadata.height)


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
    """Lock-step: what holds the world, in words."""
    silent: list[str] = []
    """Lock-step: the participants that hold the world."""
    hung: list[str] = []
    """Lock-step: the participants that were left behind so far."""
    finished: bool = False
    """Whether the time asked for with `--for` is over and the world stands still."""
    instance: str = ""
    """This simulator's session id."""
    writers: dict[int, list[str]] = {}
    """Robots that more than one process commands, and the session ids of these."""
    map: MapInfo | None = None
    """The grid of the world, as the simulator publishes it on `map`."""
    stopped: list[int] = []
    """The robots whose bodies it holds (`zteam stop`)."""


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


class ScansRequest(msgspec.Struct):
    """Asked of `sim/scans`."""

    robots: list[int]


class SensedScan(msgspec.Struct):
    """A laser's newest scan."""

    key: str
    """On which it was sent, if that had subscribers."""
    content: bytes
    """The encoded LaserScan."""


class ScansReply(msgspec.Struct):
    """Answer to `sim/scans`: what the lasers of these robots saw in the last tick."""

    scans: list[SensedScan]


class StandReply(msgspec.Struct):
    """Whether the world stands still: the tick at hand is over, and no further one is due."""

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
    """Length of the path driven; what `sim/move` and `sim/spawn` do is no path."""
    stalls: int
    """How often the robot ran into something."""
    gap_m: Gap | None
    """To the robot it follows."""
    scans: int
    late_steps: int
    """Ticks without a command of the robot until the next tick."""
    late_commands: int = 0
    """Commands that were refused because they came too late (real time)."""


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
    """Lock-step: participants that were left behind."""
    timing_ms: Timing | None = None
    lateness_p99_ms: float | None = None
    """How late ticks began after they were due, with a speed."""


class SimReport(RunFigures, kw_only=True):
    """Answer to `sim/report`."""

    finished: bool
    """Whether the time asked for with `--for` is over and the world stands still."""
    wall_seconds: float = 0.0
    """Host time from the first counted tick to the last."""


class SimulatorClient:
    """The simulator's queries as calls. All raise BusError if no simulator is there, or with what it refuses, and
    UsageError for numbers out of range."""

    def __init__(self, bus: Bus, answer_limit: float = ANSWER_LIMIT) -> None:
        """`answer_limit` is host seconds for an answer that waits for nothing in the world."""
        self._bus, self._answer_limit = bus, answer_limit

    def _ask(
        self, service: str, reply_type: type[T], request: msgspec.Struct | None = None, timeout: float | None = None
    ) -> T:
        timeout = self._answer_limit if timeout is None else timeout
        key = names.service_key(names.SIMULATOR, service)
        # JSON has no NaN: it would arrive as something else.
        if request is not None and (problems := problems_of(msgspec.to_builtins(request), type(request))):
            raise UsageError(f"{key}: {problems[0]}")
        try:
            answers = self._bus.query(key, reply_type, request, timeout=timeout)
        except QueryTimeoutError:
            raise BusError(f"the simulator does not answer within {timeout:g} s: see 'zteam doctor'") from None
        except QueryError as error:
            raise BusError(error.why) from None
        if not answers:
            text = "no simulator is there: start one with 'zteam-sim WORLD' or 'zteam up'"
            raise BusError(f"{text} (or name its router and namespace with --connect and --namespace)")
        return answers[0][1]

    def status(self) -> SimStatus:
        return self._ask("status", SimStatus)

    def report(self) -> SimReport:
        """Its own count of the run from GO on."""
        return self._ask("report", SimReport)

    def repeat(self) -> SimStatus:
        """Have the last tick's data sent once more, between two ticks."""
        return self._ask("repeat", SimStatus, Change(), timeout=CHANGE_LIMIT)

    def pause(self) -> SimStatus:
        """Pause the world after the tick at hand. Waits for that tick, for SETTLE at most."""
        self._ask("pause", SimStatus, Change())
        return self.stand(SETTLE).status

    def resume(self) -> SimStatus:
        """Resume the world at the speed that was asked for."""
        return self._ask("resume", SimStatus, Change())

    def set_speed(self, speed: float | None) -> SimStatus:
        """Ask for simulated seconds a second of the host; None = as fast as possible."""
        return self._ask("speed", SimStatus, SpeedRequest(speed))

    def stand(self, timeout: float) -> StandReply:
        """Whether the world stands still, at the latest after `timeout` host seconds (60 at most)."""
        return self._ask("stand", StandReply, WaitRequest(timeout), timeout=timeout + ANSWER_LIMIT)

    def step(self, ticks: int = 1, *, on_progress: Callable[[SimStatus], None] = lambda status: None) -> SimStatus:
        """Run so many ticks, however long they take; returns the status afterwards.

        It ends early, without an error, when the run is over, or when another client pauses or resumes the world.
        `on_progress(status)` is called about once a second.
        """
        status = self.begin_steps(ticks)
        while True:
            on_progress(status)
            reply = self.stand(LOOK)
            status = reply.status
            if reply.stands or not status.paused:
                return status

    def begin_steps(self, ticks: int) -> SimStatus:
        """As `step`, but do not wait for the ticks."""
        return self._ask("step", SimStatus, StepRequest(ticks, wait=False))

    def reset(self) -> SimStatus:
        """Everything as at the start, time too; a world that was paused stands at its first tick."""
        status = self._ask("reset", SimStatus, Change(), timeout=CHANGE_LIMIT)
        return self.stand(SETTLE).status if status.paused else status

    def spawn(
        self, x: float, y: float, yaw: float = 0.0, *, model: str = "erratic", robot_id: int | None = None,
        force: bool = False,
    ) -> int:  # fmt: skip
        """Put a further robot at x, y (m), yaw (rad) in `map`; its id, the lowest that is free unless given. Raises
        BusError if it has no room there, in a wall or a robot or outside of the world, unless `force` is set."""
        request = SpawnRequest(x, y, yaw, model, robot_id, force=force)
        return self._ask("spawn", SpawnReply, request, timeout=CHANGE_LIMIT).id

    def remove(self, robot_id: int) -> SimStatus:
        return self._ask("remove", SimStatus, RemoveRequest(robot_id), timeout=CHANGE_LIMIT)

    def move(self, robot_id: int, x: float, y: float, yaw: float = 0.0, *, force: bool = False) -> SimStatus:
        """Lift a robot to x, y (m), yaw (rad) in `map`. Raises BusError if it has no room there, as `spawn` does."""
        return self._ask("move", SimStatus, MoveRequest(robot_id, x, y, yaw, force=force), timeout=CHANGE_LIMIT)

    def fault(self, fault: Fault) -> SimStatus:
        """Have a fault carried out in the world from the next tick on. Raises BusError outside of lock-step, or if it
        cannot be carried out there."""
        return self._ask("fault", SimStatus, FaultRequest(fault=fault), timeout=CHANGE_LIMIT)


def read_status(bus: Bus, timeout: float = 2.0) -> SimStatus | None:
    """The status of the running simulator; None without one. Raises BusError if it is busy or frozen."""
    answers = bus.query(names.service_key(names.SIMULATOR, "status"), SimStatus, timeout=timeout)
    return answers[0][1] if answers else None


def find_status(bus: Bus, timeout: float = 2.0) -> SimStatus | None:
    """As `read_status`, but None also if it does not answer."""
    answers = bus.find(names.service_key(names.SIMULATOR, "status"), SimStatus, timeout=timeout)
    return answers[0][1] if answers else None


def absence_of(bus: Bus, robot_id: int) -> str:
    """What is said of a robot that the running simulator lacks; empty for others, and without a simulator."""
    status = find_status(bus)
    if status is None or robot_id in status.robots:
        return ""
    return f"{names.robot_name(robot_id)} is {absence_text(robot_id, status.robots)}"


def absence_text(robot_id: int, robots: Sequence[int]) -> str:
    """What is said of a robot that the world lacks: which robots it has, and the way out."""
    has = format_robot_ids(robots) or "no robot"
    spawn = f"'zteam sim spawn --id {robot_id} --pose X Y YAW' adds it"
    return f"not in the world; it has {has} ({spawn})"


def ask_time(bus: Bus) -> int | None:
    """The simulator's time in ns; None without a simulator, 0 if it does not answer."""
    try:
        status = read_status(bus)
    except BusError:
        return 0  # it runs, but is busy or frozen
    return status.now if status else None


def follow_clock(bus: Bus, clock: AutoClock, on_time: Callable[[], None] = lambda: None) -> Closeable:
    """Set `clock` to simulated time as it goes on, and call `on_time()` then."""

    def on_clock(_key: str, message: Clock) -> None:
        clock.set(ns_from_time(message.clock))
        on_time()

    return bus.subscribe(names.CLOCK, Clock, on_clock)


def team_clock(bus: Bus) -> AutoClock:
    """A decided clock: simulated time if a simulator runs, else the host's. The simulator itself is asked: a program
    that has just started has received no `clock` message yet, and receives none while the world is paused."""
    clock = AutoClock()
    subscription = follow_clock(bus, clock)
    now = ask_time(bus)
    if now is None:
        subscription.close()
        clock.use_wall()
        return clock
    clock.use_simulated()
    if now > clock.now():
        clock.set(now)
    return clock
