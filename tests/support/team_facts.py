"""Facts of a team that works, for checks to be told one change of them."""

from collections.abc import Iterable
from typing import Any

import msgspec
import numpy as np

from zteam import names
from zteam.bus.presence import ProcessInfo
from zteam.messages import (
    Header,
    MapMetaData,
    OccupancyGrid,
    Point,
    Pose,
    RobotState,
    RobotStatus,
    TeamState,
    TeamStatus,
)
from zteam.monitor.doctor.facts import Facts, Finding
from zteam.simulator.client import MapInfo, SimStatus

WORLD_MAP = MapInfo(-5.0, -4.0, 0.0, 0.05, 200, 160)


def nodes(*alive: str, silent: tuple[str, ...] = ()) -> list[ProcessInfo]:
    """Processes of these names; those in `silent` do not answer."""
    return [ProcessInfo(name, "host", 0 if name in silent else 1000 + i, 1, name) for i, name in enumerate(alive)]


def sim_status(**changes: Any) -> SimStatus:
    """A world of two robots that runs."""
    status = SimStatus("arena", [0, 1], 100_000_000, 1, 5_000_000_000, 50, 1.0, map=WORLD_MAP)
    return msgspec.structs.replace(status, **changes)


def robot_status(robot_id: int, state: int = RobotState.RUNNING, **fields: Any) -> RobotStatus:
    """What a robot says of itself."""
    return RobotStatus(robot_id=robot_id, state=state, **fields)


def team_status(*, ready: list[int], missing: list[int], lost: list[int] | None = None, size: int = 2) -> TeamStatus:
    """What the monitor says: GO if nothing is missing."""
    state = TeamState.GO if len(ready) >= size else TeamState.WAITING
    ids = (np.array(part, np.int32) for part in (ready, missing, lost or []))
    return TeamStatus(state=state, team_size=size, **dict(zip(("ready", "missing", "lost"), ids, strict=True)))


def grid(x: float, y: float, resolution: float = 0.05, columns: int = 200, rows: int = 160) -> OccupancyGrid:
    """A map without cells."""
    info = MapMetaData(resolution=resolution, width=columns, height=rows, origin=Pose(Point(x, y, 0.0)))
    return OccupancyGrid(Header(frame_id=names.MAP_FRAME), info)


def team_facts(**changes: Any) -> Facts:
    """Two robots that drive in a world of two, with every process there."""
    keys = ["base_scan", "cmd_vel", "status"]
    writers = {f"robot_{i}/{key}": ["sim" if key == "base_scan" else f"robot_{i}"] for i in (0, 1) for key in keys}
    facts = Facts(
        nodes=nodes("monitor", "robot_0", "robot_1", "sim", "tf"),
        writers={**writers, "map": ["sim"]},
        statuses={0: robot_status(0), 1: robot_status(1)},
        team=team_status(ready=[0, 1], missing=[]),
        sim=sim_status(),
        map=grid(-5.0, -4.0),
        map_writer="sim",
    )
    return msgspec.structs.replace(facts, **changes)


def problems(findings: Iterable[Finding]) -> list[tuple[str, str, str]]:
    """Subject, text and next step of each problem."""
    return [(f.what, f.text, f.next_step) for f in findings if not f.good]
