"""The blocks of frames and the document `team`, made of what has come: each once, however many pages get it."""

import math
import shlex
import zlib
from collections.abc import Collection, Iterator, Sequence
from functools import cache
from operator import itemgetter
from typing import Any

import msgspec

from zteam import messages, names
from zteam.clock import FREEZES, monotonic
from zteam.config.localisation import LOST_DEVIATION, LOST_DISTANCE, LOST_TURN
from zteam.errors import short
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import BaseInfo, LaserScan, OccupancyGrid, PoseWithCovarianceStamped, RobotState, RobotStatus
from zteam.robot.behaviors.registry import BEHAVIORS, behavior_names
from zteam.robot.parameters import parameters_of
from zteam.simulator.client import RobotShape, SimStatus
from zteam.view import frames
from zteam.view.commands import Tile, make_tiles
from zteam.view.received import Arrival
from zteam.view.team_view import TeamView, shown

SILENT_AFTER = 3.0
"""Host seconds without a status after which a robot whose process lives does not answer, as in the monitor."""

Outlines = dict[bytes, int]
"""The place in a list of each different outline, as JSON: robots of a kind have one, and a page reads it once."""


def robot_row(
    robot_id: int, outlines: Outlines, *, present: bool, alive: bool = False, status: RobotStatus | None = None,
    age: float = 0.0, base: BaseInfo | None = None, shape: RobotShape | None = None, lease: int | None = None,
    sim: SimStatus | None = None, processes: Sequence[str] = (), amcl: PoseWithCovarianceStamped | None = None,
    places: tuple[Pose2, Pose2] | None = None, takes_goals: bool = True,
) -> dict[str, Any]:  # fmt: skip
    """A robot's row: whether a process holds its name, its newest status and how old that is (host seconds), its base,
    its shape as the simulator tells it, the viewer that drives it, the names of its processes, the estimate of its
    localiser, where it is and takes itself to be, and whether something takes its goals. `present`: the world has
    it, or without a simulator its base or process is there."""
    model, polygons = "", list[Any]()
    if shape is not None:
        model, polygons = shape.model, shape.outline
    elif base is not None:
        model, polygons = base.model, [[(round(p.x, 4), round(p.y, 4)) for p in base.footprint.points]]
    state, reason = _state_of(status, present=present, alive=alive, age=age)
    speed = round(status.speed, 3) if status is not None and alive else None
    if sim is not None and not present:
        state, speed = "absent", None
        reason = f"not in the world; {', '.join(processes)} still {'runs' if len(processes) == 1 else 'run'}"
    truth, lost = _find_lost(amcl, places)
    stops = (sim is not None and robot_id in sim.stopped) or (status is not None and alive and status.is_stopped)
    return {
        "id": robot_id, "name": names.robot_name(robot_id), "model": model, "present": present, "state": state,
        # Its place in the list of outlines; -1: not known.
        "outline": outlines.setdefault(msgspec.json.encode(polygons), len(outlines)) if polygons else -1,
        "behavior": short(status.behavior) if status else "", "leader": status.followed if status else -1,
        "driver": "" if status is None else short(status.driver) if alive else messages.RobotDriver.NONE,
        "reason": " · ".join(filter(None, (lost, reason))), "speed": speed, "age": round(age, 2) if status else None,
        "lease": lease, "localised": not lost, "truth": truth, "stopped": stops,
        # Nothing would hold a real base without a robot process.
        "unheld": sim is None and present and not alive,
        "takes_goals": takes_goals,
    }  # fmt: skip


def _state_of(status: RobotStatus | None, *, present: bool, alive: bool, age: float) -> tuple[str, str]:
    """A robot's state as the monitor names it, and why it stands."""
    if status is None:
        is_undriven = present and not alive
        reason = "drive it, or start one" if is_undriven else "no status yet" if alive else "no process"
        return "undriven" if is_undriven else "absent", reason
    if not alive:
        return "stopped" if status.state == RobotState.STOPPED else "lost", "its process is gone"
    if age > SILENT_AFTER:
        return "silent", "does not answer"
    reason = short(status.reason or ("" if status.state == RobotState.RUNNING else status.text))
    if not reason and not round(status.speed, 3):
        reason = "turns on the spot or drives sideways"
    return RobotState.TEXT[min(status.state, RobotState.FAULT)], reason


def _find_lost(
    amcl: PoseWithCovarianceStamped | None, places: tuple[Pose2, Pose2] | None
) -> tuple[list[float] | None, str]:
    """Where a robot is that is far from where it takes itself to be; and that it is lost, in words."""
    if places is not None:
        (truth, believed), turn = places, abs(normalize_angle(places[0].yaw - places[1].yaw))
        away = math.dist(truth[:2], believed[:2])
        if away > LOST_DISTANCE or turn > LOST_TURN:
            # To half a metre and ten degrees: each change is sent to every page.
            text = f"localisation lost: about {round(2 * away) / 2:g} m and {round(math.degrees(turn), -1):g}° off"
            return [round(value, 2) for value in truth], text
    wide = math.sqrt(max(0.0, *amcl.pose.covariance[[0, 7]])) if amcl else 0.0
    return None, f"localisation lost: its place is known to ± {wide:.1f} m only" if wide > LOST_DEVIATION else ""


def gate_row(status: messages.TeamStatus | None) -> dict[str, str]:
    """The start gate, and what it waits for."""
    if status is None:
        return {"state": "waiting", "text": "no monitor"}
    if status.state == messages.TeamState.GO:
        return {"state": "go", "text": "GO given"}
    waits = short(status.waiting_for, 10_000) or ", ".join(map(names.robot_name, status.missing.tolist()))
    return {"state": "waiting", "text": f"{status.ready.size} of {status.team_size} ready; waiting for {waits}"}


def sim_row(status: SimStatus | None, models: Collection[str], last_world: str = "") -> dict[str, Any]:
    """The simulator, or that there is none, and the `last_world` of one that is gone."""
    if status is None:
        return {"present": False, "state": "gone" if last_world else "", "world": last_world, "models": []}
    return {
        "present": True,
        "world": status.world,
        "state": "finished" if status.finished else "paused" if status.paused else "running",
        "speed": status.speed,
        "rtf": round(status.real_time_factor, 2),
        "lockstep": status.lockstep,
        "waits_for": short(status.waiting_for, 10_000),
        "models": sorted(models),
    }


@cache
def startable() -> list[str]:
    """The behaviours that need no parameters, the shipped ones first. Those of other packages are not imported."""
    return [
        name
        for name in behavior_names()
        if name not in BEHAVIORS or not any(each.required for each in parameters_of(BEHAVIORS[name].Params))
    ]


_OF_NO_BASE = (
    names.BASE_INFO, names.GOAL_POSE, names.NAVIGATION_STATUS, names.GLOBAL_COSTMAP, names.AMCL_POSE,
)  # fmt: skip
"""Topics that tell nothing of whether a robot's base is there."""

TEAM_PERIOD = 0.2
"""Host seconds between two looks at whether `team` has changed."""


PATIENCE = 0.5
"""Host seconds that a scan waits for the pose of its stamp. Then its sensor's newest pose has to do."""


Found = tuple[Arrival, LaserScan]


class Scene:
    """The thread that makes frames makes all calls."""

    def __init__(self, state: TeamView) -> None:
        self._state, self._read = state, state.received.read
        self._blocks: dict[Any, tuple[int, bytes]] = {}
        self._placed: dict[str, tuple[int, LaserScan, Pose2]] = {}
        """By key: the newest scan of which the sensor's pose is known, with its number."""
        self._waits: dict[str, Found] = {}
        """By key: a scan whose sensor's pose is not known yet."""
        self._grids: dict[str, tuple[int, list[Tile]]] = {}
        self._poses: tuple[tuple[int, ...], bytes] = ((), b"")
        self._looked: tuple[object, ...] = ()
        """What the robots' poses depend on, when they were looked at."""
        self._team = (float("-inf"), b"", 0)
        """Host time at which `team` was made, the document, and its version."""

    def poses(self) -> tuple[tuple[int, ...], bytes]:
        """The number and the robots of the newest poses, empty before there are any; and their block. They are looked
        at once for all pages."""
        state = self._state
        seen = state.received.number, state.queries.sim, state.places
        if seen != self._looked:
            self._looked = seen
            stands = (sim := state.queries.sim) is not None and (sim.paused or sim.finished)
            state.poses = state.places.look(sorted(state.robots(with_bodies=True)), stands=stands)
        # Robots come and go also while nothing new comes of the others.
        number = (state.places.number, *state.poses) if state.poses or self._poses[0] else ()
        if number != self._poses[0]:
            self._poses = number, frames.encode_poses(state.poses, truth=state.places.from_truth)
        return self._poses

    def scans(self, robot_id: int, beams: int) -> Iterator[tuple[int, int, bytes]]:
        """Index, number and block of each laser's newest scan whose place at that time is known."""
        index = 0
        while found := self._read(key := names.scan_key(robot_id, index), LaserScan):
            if placed := self._place(key, robot_id, index, found):
                number, scan, sensor = placed
                known = self._blocks.get((key, beams))
                if known is None or known[0] != number:
                    known = number, frames.encode_scan(robot_id, index, scan, sensor, beams)
                    self._blocks[key, beams] = known
                yield index, *known
            index += 1

    def _place(self, key: str, robot_id: int, index: int, newest: Found) -> tuple[int, LaserScan, Pose2] | None:
        """The newest scan of a laser with its pose at its stamp: that of the laser, turned as the robot's base is.

        A scan comes before the poses of its tick. It waits for them, and later ones come meanwhile: without one that is
        kept until then a view that lags would never see both.
        """
        placed = self._placed.get(key)
        if placed is not None and placed[0] == newest[0].number:
            return placed
        waits = self._waits.setdefault(key, newest)
        late = monotonic() - waits[0].time > PATIENCE
        for taken in (newest, waits):
            found = self._find_sensor(robot_id, index, taken[1], late=late)
            if found is not None:
                if taken is newest:
                    del self._waits[key]
                else:
                    self._waits[key] = newest
                placed = self._placed[key] = taken[0].number, *found
                return placed
        if late and not self._state.places.from_truth and self._state.places.level(robot_id, newest[1]).problem:
            self._placed.pop(key, None)
            return None
        return placed

    def _find_sensor(self, robot_id: int, index: int, scan: LaserScan, *, late: bool) -> tuple[LaserScan, Pose2] | None:
        """A scan in the axes of its robot's base, and where it began, or where it begins now if that stays unknown."""
        state, stamp = self._state, messages.ns_from_time(scan.header.stamp)
        base, seen = state.places.base_at(robot_id, stamp), state.places.level(robot_id, scan)
        if base is None and late:
            base = state.places.pose_of(names.robot_frame(robot_id, names.BASE_FOOTPRINT))
        if base is None:
            return None
        if seen.scan is not None:
            sensor = shown(base.compose(Pose2(*seen.laser, 0.0)))
            return None if sensor is None else (seen.scan, sensor)
        # Without transforms: where the simulator says that the laser sits.
        shape = state.queries.shapes.robots.get(robot_id) if state.places.from_truth and state.queries.shapes else None
        return (scan, base.compose(Pose2(*shape.lasers[index]))) if shape and index < len(shape.lasers) else None

    def team(self) -> tuple[bytes, int]:
        """The document `team` and its version, which does not change with ages and speeds alone."""
        now = monotonic()
        if now - self._team[0] >= TEAM_PERIOD:
            team = self._make_team(now)
            document = msgspec.json.encode(team)
            for row in team["robots"]:
                row["age"] = row["speed"] = None
            team["sim"] |= {"rtf": 0.0, "waits_for": ""}
            self._team = now, document, zlib.crc32(msgspec.json.encode(team))
        return self._team[1:]

    def _make_team(self, now: float) -> dict[str, Any]:
        state, queries, bus = self._state, self._state.queries, self._state.node.bus.options
        sim, shapes, outlines, options = queries.sim, queries.shapes, Outlines(), bus.words if bus else {}
        processes = queries.processes()
        heard = state.received.of_robots() if sim is None else []
        # What is latched tells nothing of whether a base is there.
        times = [(robot_id, arrival.time) for robot_id, topic, arrival in heard if topic not in _OF_NO_BASE]
        goals = {each.key for each in queries.declarations if not each.publishes}  # Views have a wildcard.
        rows, speaks = {}, dict(sorted(times, key=itemgetter(1)))
        for robot_id in sorted(state.robots()):
            alive = queries.speaks(names.robot_name(robot_id))
            speaks_now = alive or now - speaks.get(robot_id, -math.inf) < SILENT_AFTER
            is_in_world = sim is not None and robot_id in sim.robots
            base = self._read(names.robot_key(robot_id, names.BASE_INFO), BaseInfo)
            amcl = self._read(names.robot_key(robot_id, names.AMCL_POSE), PoseWithCovarianceStamped)
            rows[robot_id] = robot_row(
                robot_id,
                outlines,
                present=speaks_now if sim is None else is_in_world,
                alive=alive,
                status=queries.status_of(robot_id),
                # A recording that stands says nothing new.
                age=0.0 if queries.replay else max(0.0, now - max(queries.team.robot(robot_id).spoke, FREEZES.look())),
                base=base and base[1],
                shape=shapes.robots.get(robot_id) if shapes else None,
                lease=state.lease_of(robot_id),
                sim=sim,
                processes=processes.get(robot_id, ()),
                amcl=amcl and amcl[1],
                places=state.places.truth_of(robot_id) if is_in_world else None,
                takes_goals=names.robot_key(robot_id, names.GOAL_POSE) in goals or not queries.declarations,
            )
        return {
            "robots": list(rows.values()),
            # Polygons in metres, in `base_footprint`.
            "outlines": [msgspec.Raw(outline) for outline in outlines],
            "gate": gate_row(queries.team.team_status if queries.speaks(names.MONITOR) else None),
            "sim": sim_row(sim, shapes.models if shapes else (), queries.last_world),
            # The grants that this process lacks where access is controlled.
            "refused": queries.refused,
            "router": queries.team.link_up,
            "viewers": len(state.viewers),
            # Those that a robot can be started with, where there is a launcher, which starts robots (`up/start`).
            "behaviors": startable(),
            "launcher": queries.alive(names.LAUNCHER),
            # By which a command that is typed finds the team, such as ` --connect tcp/10.0.0.2:7447`.
            "options": "".join(f" {option} {shlex.quote(value)}" for option, value in options.items() if value),
            "namespace": state.namespace,
            # Whether a simulator or robots that are here may not have been heard yet.
            "loading": queries.loading,
            # By robot that drives through a list of goals: whether the list is paused.
            "lists": queries.lists,
        }

    def grid(self, key: str) -> list[Tile]:
        """The tiles of a grid; those whose cells are as before keep their version."""
        found = self._read(key, OccupancyGrid)
        frame = self._state.places.pose_of(found[1].header.frame_id or names.MAP_FRAME) if found else None
        if found is None or frame is None:
            return []
        number, tiles = self._grids.get(key, (0, []))
        if number != found[0].number:
            tiles = make_tiles(key, found[1], found[0].number, frame, tiles)
            self._grids[key] = found[0].number, tiles
        return tiles
