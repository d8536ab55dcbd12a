"""The blocks of frames and the document `team`, made of what has come: each once, however many pages get it."""

import math
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, TypeVar

import msgspec

from zteam import names
from zteam.clock import monotonic
from zteam.geometry import Pose2
from zteam.messages import (
    BaseInfo,
    LaserScan,
    Message,
    OccupancyGrid,
    RobotDriver,
    RobotState,
    RobotStatus,
    TeamState,
    TeamStatus,
    ns_from_time,
)
from zteam.node.log_client import printable
from zteam.simulator.client import RobotShape, SimStatus
from zteam.view import frames
from zteam.view.commands import Tile, make_tiles
from zteam.view.received import Arrival
from zteam.view.team_view import TeamView

SILENT_AFTER = 3.0
"""Host seconds without a status after which a robot whose process lives does not answer, as in the monitor."""

Outlines = dict[bytes, int]
"""The place in a list of each different outline, as JSON: robots of a kind have one, and a page reads it once."""


class RobotRow(msgspec.Struct):
    """One robot, as the monitor's table shows it, with its body."""

    id: int
    name: str
    model: str = ""
    outline: int = -1
    """Its place in the document's `outlines`; -1: not known."""
    state: str = "absent"
    behavior: str = ""
    driver: str = ""
    reason: str = ""
    leader: int = -1
    speed: float | None = None
    age: float | None = None
    lease: int | None = None
    """The viewer that drives it."""
    present: bool = False
    """Whether the world has it, or without a simulator its base or process is there."""


class Waiting(msgspec.Struct):
    """A robot that GO waits for."""

    id: int
    reason: str = ""


class GateRow(msgspec.Struct):
    """The start gate."""

    state: str = "waiting"
    text: str = ""
    waiting_for: list[Waiting] = []


class SimRow(msgspec.Struct):
    """The simulator."""

    present: bool = False
    state: str = ""
    speed: float | None = None
    rtf: float = 0.0
    lockstep: bool = False
    waits_for: str = ""
    models: list[str] = []
    tick: int = 0


class TeamDocument(msgspec.Struct):
    """What the page gets as `team`."""

    robots: list[RobotRow] = []
    outlines: list[msgspec.Raw] = []
    """Polygons in metres, in `base_footprint`."""
    gate: GateRow = msgspec.field(default_factory=GateRow)
    sim: SimRow = msgspec.field(default_factory=SimRow)
    router: bool = True
    viewers: int = 0
    namespace: str = ""


def robot_row(
    robot_id: int,
    outlines: Outlines,
    *,
    present: bool,
    alive: bool = False,
    status: RobotStatus | None = None,
    age: float = 0.0,
    base: BaseInfo | None = None,
    shape: RobotShape | None = None,
    lease: int | None = None,
) -> RobotRow:
    """A robot's row: whether a process holds its name, its newest status and how old that is (host seconds), its base,
    its shape as the simulator tells it, and the viewer that drives it."""
    row = RobotRow(robot_id, names.robot_name(robot_id), present=present, lease=lease)
    outline: Sequence[object] = ()
    if shape is not None:
        row.model, outline = shape.model, shape.outline
    elif base is not None:
        row.model, outline = base.model, [[(round(p.x, 4), round(p.y, 4)) for p in base.footprint.points]]
    if outline:
        row.outline = outlines.setdefault(msgspec.json.encode(outline), len(outlines))
    if status is None:
        row.reason = "no status yet" if alive else "no process"
        return row
    row.behavior, row.driver, row.leader = printable(status.behavior), printable(status.driver), status.followed
    row.age = round(age, 2)
    if not alive:
        row.state = "stopped" if status.state == RobotState.STOPPED else "lost"
        row.driver, row.reason = RobotDriver.NONE, "its process is gone"
        return row
    row.speed = round(status.speed, 3)
    if age > SILENT_AFTER:
        row.state, row.reason = "silent", "does not answer"
        return row
    row.state = RobotState.TEXT[min(status.state, RobotState.FAULT)]
    row.reason = printable(status.reason or ("" if status.state == RobotState.RUNNING else status.text))
    return row


def gate_row(status: TeamStatus | None, robots: Mapping[int, RobotRow]) -> GateRow:
    """The start gate, in the monitor's words."""
    if status is None:
        return GateRow(text="no monitor")
    if status.state == TeamState.GO:
        return GateRow("go", "GO is out")
    missing = status.missing.tolist()
    reasons = {i: robots[i].reason if i in robots else "no process yet" for i in missing}
    ready = f"{status.ready.size} of {status.team_size} ready"
    waits = printable(status.waiting_for) or ", ".join(map(names.robot_name, missing))
    return GateRow("waiting", f"{ready}; waiting for {waits}", [Waiting(i, reasons[i]) for i in missing])


def sim_row(status: SimStatus | None, models: Collection[str]) -> SimRow:
    """The simulator's state."""
    if status is None:
        return SimRow()
    state = "finished" if status.finished else "paused" if status.paused else "running"
    return SimRow(
        present=True,
        state=state,
        speed=status.speed,
        rtf=round(status.real_time_factor, 2),
        lockstep=status.lockstep,
        waits_for=printable(status.waiting_for),
        models=sorted(models),
        tick=status.tick,
    )


M = TypeVar("M", bound=Message)

TEAM_PERIOD = 0.2
"""Host seconds between two looks at whether `team` has changed."""


class Scene:
    """The thread that makes frames makes all calls."""

    def __init__(self, state: TeamView) -> None:
        self._state = state
        self._decoded: dict[str, tuple[int, Any]] = {}
        """By key: the number of the message, and the message."""
        self._blocks: dict[Any, tuple[int, bytes]] = {}
        self._grids: dict[str, tuple[int, list[Tile]]] = {}
        self._poses: tuple[int, bytes] = (0, b"")
        self._looked: tuple[object, ...] = ()
        """What the robots' poses depend on, when they were looked at."""
        self._team = (float("-inf"), b"", 0)
        """Host time at which `team` was made, the document, and its version."""

    def read(self, key: str, kind: type[M]) -> tuple[Arrival, M] | None:
        """The newest message of a key, decoded once; None without one of this type."""
        arrival = self._state.received.get(key)
        if arrival is None:
            return None
        number, message = self._decoded.get(key, (0, None))
        if number != arrival.number:
            message = arrival.read(kind)
            self._decoded[key] = arrival.number, message
        return None if message is None else (arrival, message)

    def look(self) -> None:
        """Take the robots' newest poses, once for all pages."""
        state = self._state
        seen = state.received.number, state.queries.sim, state.places
        if seen != self._looked:
            self._looked = seen
            state.poses = state.places.look(sorted(state.robots()))

    def poses(self) -> tuple[int, bytes]:
        """The number and the block of the newest poses; 0 before there are any."""
        places, poses = self._state.places, self._state.poses
        number = places.number if poses else 0
        if number != self._poses[0]:
            self._poses = number, frames.encode_poses(poses, truth=places.from_truth)
        return self._poses

    def scans(self, robot_id: int, beams: int) -> Iterator[tuple[str, int, bytes]]:
        """Key, number and block of each laser's newest scan."""
        index = 0
        while found := self.read(key := names.scan_key(robot_id, index), LaserScan):
            arrival, scan = found
            known = self._blocks.get((key, beams))
            if known is None or known[0] != arrival.number:
                block = self._scan(robot_id, index, scan, beams)
                known = self._blocks[key, beams] = arrival.number, block
            if known[1]:
                yield key, known[0], known[1]
            index += 1

    def _scan(self, robot_id: int, index: int, scan: LaserScan, beams: int) -> bytes:
        seen = self._state.places.pose_of(scan.header.frame_id, ns_from_time(scan.header.stamp))
        sensor = seen or self._sensor_on_base(robot_id, index)
        return frames.encode_scan(robot_id, index, scan, sensor, beams) if sensor else b""

    def _sensor_on_base(self, robot_id: int, index: int) -> Pose2 | None:
        """Without transforms: where the simulator says that the laser sits."""
        shapes, base = self._state.queries.shapes, self._state.poses.get(robot_id)
        shape = None if shapes is None else shapes.robots.get(robot_id)
        if base is None or shape is None or index >= len(shape.lasers):
            return None
        return base.compose(Pose2(*shape.lasers[index]))

    def team(self) -> tuple[bytes, int]:
        """The document `team` and its version, which does not change with ages and speeds alone."""
        now = monotonic()
        if now - self._team[0] >= TEAM_PERIOD:
            team = self._make_team(now)
            document = msgspec.json.encode(team)
            for row in team.robots:
                row.age = row.speed = None
            team.sim.rtf, team.sim.tick, team.sim.waits_for = 0.0, 0, ""
            self._team = now, document, zlib.crc32(msgspec.json.encode(team))
        return self._team[1:]

    def _make_team(self, now: float) -> TeamDocument:
        state, queries = self._state, self._state.queries
        sim, shapes, outlines = queries.sim, queries.shapes, Outlines()
        rows, speaks = {}, self._newest_data() if sim is None else {}
        for robot_id in sorted(state.robots()):
            alive = queries.alive(names.robot_name(robot_id))
            speaks_now = alive or now - speaks.get(robot_id, -math.inf) < SILENT_AFTER
            status = self.read(names.robot_key(robot_id, names.STATUS), RobotStatus)
            base = self.read(names.robot_key(robot_id, names.BASE_INFO), BaseInfo)
            rows[robot_id] = robot_row(
                robot_id,
                outlines,
                present=speaks_now if sim is None else robot_id in sim.robots,
                alive=alive,
                status=status[1] if status else None,
                age=now - status[0].time if status else 0.0,
                base=base[1] if base else None,
                shape=shapes.robots.get(robot_id) if shapes else None,
                lease=state.lease_of(robot_id),
            )
        team = self.read(names.TEAM_STATUS, TeamStatus)
        return TeamDocument(
            robots=list(rows.values()),
            outlines=[msgspec.Raw(outline) for outline in outlines],
            gate=gate_row(team[1] if team and queries.alive(names.MONITOR) else None, rows),
            sim=sim_row(sim, shapes.models if shapes else ()),
            router=queries.link_up,
            viewers=len(state.viewers),
        )

    def _newest_data(self) -> dict[int, float]:
        """Host time of the newest message of each base. What is latched tells nothing of whether it is there."""
        found: dict[int, float] = {}
        for arrival in self._state.received.newest():
            target = names.split_robot_key(arrival.key)
            if target is not None and target[1] not in (names.BASE_INFO, names.STATUS, names.GOAL_POSE):
                found[target[0]] = max(arrival.time, found.get(target[0], arrival.time))
        return found

    def grid(self, key: str) -> list[Tile]:
        """The tiles of a grid; those whose cells are as before keep their version."""
        found = self.read(key, OccupancyGrid)
        if found is None:
            return []
        arrival, grid = found
        frame = self._state.places.pose_of(grid.header.frame_id) or Pose2(0.0, 0.0, 0.0)
        known = self._grids.get(key)
        if known is None or known[0] != arrival.number:
            known = self._grids[key] = (
                arrival.number,
                make_tiles(key, grid, arrival.number, frame, known[1] if known else []),
            )
        return known[1]
