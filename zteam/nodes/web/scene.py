"""The blocks of frames, made of what has come: each once, however many pages get it."""

import math
import zlib
from collections.abc import Iterator
from typing import Any, TypeVar

import msgspec

from zteam import names
from zteam.clock import monotonic
from zteam.geometry import Pose2
from zteam.messages import BaseInfo, LaserScan, Message, OccupancyGrid, RobotStatus, TeamStatus, ns_from_time
from zteam.nodes.web import frames
from zteam.nodes.web.grids import Tile, make_tiles
from zteam.nodes.web.hub import Hub
from zteam.nodes.web.newest import Arrival
from zteam.nodes.web.places import decoded
from zteam.nodes.web.team_document import SILENT_AFTER, Heard, Outlines, TeamDocument, gate_row, robot_row, sim_row

M = TypeVar("M", bound=Message)

TEAM_PERIOD = 0.2
"""Host seconds between two looks at whether `team` has changed."""


class Scene:
    """The thread that makes frames makes all calls."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
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
        arrival = self._hub.newest.get(key)
        if arrival is None:
            return None
        number, message = self._decoded.get(key, (0, None))
        if number != arrival.number:
            message = decoded(kind, arrival.content)
            self._decoded[key] = arrival.number, message
        return None if message is None else (arrival, message)

    def look(self) -> None:
        """Take the robots' newest poses, once for all pages."""
        hub = self._hub
        state = hub.newest.number, hub.facts.sim, hub.places
        if state != self._looked:
            self._looked = state
            hub.poses = hub.places.look(sorted(hub.robots()))

    def poses(self) -> tuple[int, bytes]:
        """The number and the block of the newest poses; 0 before there are any."""
        places, poses = self._hub.places, self._hub.poses
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
        frame = names.strip_slash(scan.header.frame_id)
        sensor = self._hub.places.pose_of(frame, ns_from_time(scan.header.stamp))
        if sensor is None:
            sensor = self._sensor_on_base(robot_id, index)
        if sensor is None:
            return b""
        sweep = frames.Sweep(sensor, scan.angle_min, scan.angle_increment, scan.range_min, scan.range_max, scan.ranges)
        return frames.encode_scan(robot_id, index, sweep, beams)

    def _sensor_on_base(self, robot_id: int, index: int) -> Pose2 | None:
        """Without transforms: where the simulator says that the laser sits."""
        shapes, base = self._hub.facts.shapes, self._hub.poses.get(robot_id)
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
        hub, facts = self._hub, self._hub.facts
        sim, shapes, outlines = facts.sim, facts.shapes, Outlines()
        rows, speaks = {}, self._newest_data() if sim is None else {}
        for robot_id in sorted(hub.robots()):
            heard = self._hear(robot_id, now)
            there = (
                robot_id in sim.robots
                if sim is not None
                else heard.alive or now - speaks.get(robot_id, -math.inf) < SILENT_AFTER
            )
            rows[robot_id] = robot_row(robot_id, heard, outlines, present=there)
        team = self.read(names.TEAM_STATUS, TeamStatus)
        return TeamDocument(
            robots=list(rows.values()),
            outlines=outlines.as_list(),
            gate=gate_row(team[1] if team and facts.alive(names.MONITOR) else None, rows),
            sim=sim_row(sim, shapes.models if shapes else ()),
            router=facts.link_up,
            viewers=len(hub.viewers),
        )

    def _newest_data(self) -> dict[int, float]:
        """Host time of the newest message of each base. What is latched tells nothing of whether it is there."""
        found: dict[int, float] = {}
        for key, arrival in self._hub.newest.items():
            target = names.split_robot_key(key)
            if target is not None and target[1] not in (names.BASE_INFO, names.STATUS, names.GOAL_POSE):
                found[target[0]] = max(arrival.time, found.get(target[0], arrival.time))
        return found

    def _hear(self, robot_id: int, now: float) -> Heard:
        facts = self._hub.facts
        status = self.read(names.robot_key(robot_id, names.STATUS), RobotStatus)
        base = self.read(names.robot_key(robot_id, names.BASE_INFO), BaseInfo)
        return Heard(
            alive=facts.alive(names.robot_name(robot_id)),
            status=status[1] if status else None,
            age=now - status[0].time if status else 0.0,
            base=base[1] if base else None,
            lease=self._hub.lease_of(robot_id),
            shape=facts.shapes.robots.get(robot_id) if facts.shapes else None,
        )

    def grid(self, key: str) -> list[Tile]:
        """The tiles of a grid; those whose cells are as before keep their version."""
        found = self.read(key, OccupancyGrid)
        if found is None:
            return []
        arrival, grid = found
        frame = self._hub.places.pose_of(grid.header.frame_id) or Pose2(0.0, 0.0, 0.0)
        known = self._grids.get(key)
        if known is None or known[0] != arrival.number:
            known = self._grids[key] = (
                arrival.number,
                make_tiles(key, grid, arrival.number, frame, known[1] if known else []),
            )
        return known[1]
