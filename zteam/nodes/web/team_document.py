"""The document `team`: the robots, the start gate, the simulator and what else every page shows. Pure."""

from collections.abc import Collection, Mapping, Sequence

import msgspec

from zteam import names
from zteam.messages import BaseInfo, RobotDriver, RobotState, RobotStatus, TeamState, TeamStatus
from zteam.services.simulator import RobotShape, SimStatus

SILENT_AFTER = 3.0
"""Host seconds without a status after which a robot whose process lives does not answer, as in the monitor."""

Outline = list[tuple[float, float]]


class Outlines:
    """The different outlines of a team: robots of a kind have one, and a page reads it once."""

    def __init__(self) -> None:
        self._places: dict[bytes, int] = {}

    def place(self, outline: Sequence[Outline]) -> int:
        """Where this one is in the list; -1 for an empty one."""
        return self._places.setdefault(msgspec.json.encode(outline), len(self._places)) if outline else -1

    def as_list(self) -> list[msgspec.Raw]:
        """All of them."""
        return [msgspec.Raw(outline) for outline in self._places]


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


class Heard(msgspec.Struct):
    """What is known of one robot."""

    alive: bool = False
    """Whether a process holds its name."""
    status: RobotStatus | None = None
    age: float = 0.0
    """Host seconds since that status came."""
    base: BaseInfo | None = None
    shape: RobotShape | None = None
    """As the simulator tells it."""
    lease: int | None = None


def robot_row(robot_id: int, heard: Heard, outlines: Outlines, *, present: bool) -> RobotRow:
    """A robot's row."""
    row = RobotRow(robot_id, names.robot_name(robot_id), present=present, lease=heard.lease)
    if heard.shape is not None:
        row.model = heard.shape.model
        row.outline = outlines.place(heard.shape.outline)
    elif heard.base is not None:
        row.model = heard.base.model
        row.outline = outlines.place([[(round(p.x, 4), round(p.y, 4)) for p in heard.base.footprint.points]])
    status = heard.status
    if status is None:
        row.reason = "no status yet" if heard.alive else "no process"
        return row
    row.behavior, row.driver, row.leader = printable(status.behavior), printable(status.driver), status.followed
    row.age = round(heard.age, 2)
    if not heard.alive:
        row.state = "stopped" if status.state == RobotState.STOPPED else "lost"
        row.driver, row.reason = RobotDriver.NONE, "its process is gone"
        return row
    row.speed = round(status.speed, 3)
    if heard.age > SILENT_AFTER:
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


def printable(text: str) -> str:
    """A process's own text without control characters."""
    return "".join(c if c.isprintable() else "\ufffd" for c in text)
