"""What a page says: one JSON object each, and what is wrong with it. Pure."""

from collections.abc import Mapping
from typing import Annotated, Literal

import msgspec

from zteam.bus.transport import decode_json
from zteam.config.numbers import Coordinate, RobotId
from zteam.errors import DecodeError
from zteam.names import is_wildcard
from zteam.record.client import Speed as ReplaySpeed
from zteam.record.client import Ticks, Time
from zteam.simulator.client import MAX_SPEED, MAX_TICKS

VERSION = 1
MAX_BYTES = 64 * 1024
Layer = Literal[
    "scans", "tf", "goals", "plans", "costmaps", "particles", "markers", "sonars", "fiducials", "trails", "obstacles",
    "costs",
]  # fmt: skip
Doc = Literal["tf", "topics", "log", "inspect", "doctor"]
MAX_WATCHES = 64
"""Topics and fields that one page watches."""

Text = Annotated[str, msgspec.Meta(max_length=256)]
Robots = Annotated[list[RobotId], msgspec.Meta(max_length=1024)]
Speed = Annotated[float, msgspec.Meta(ge=-100.0, le=100.0)]


class Request(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Base of all."""

    op: str = ""
    """Which one of KINDS it is."""


class Hello(Request, frozen=True):
    """The first one. Without the token the page may watch, not command."""

    version: int
    token: Text = ""


class Token(Request, frozen=True):
    """A token that the page learnt after its `hello`. It is answered by `rights`."""

    token: Text


class Ack(Request, frozen=True):
    """The page has taken frame `frame`: it may be sent the next one."""

    frame: Annotated[int, msgspec.Meta(ge=0, le=2**32 - 1)]


class Look(Request, frozen=True):
    """What the page shows now."""

    viewport: Annotated[list[Coordinate], msgspec.Meta(max_length=4)] = []
    """x and y of the lowest, then of the highest corner, in `map`; empty: everything."""
    layers: Annotated[list[Layer], msgspec.Meta(max_length=32)] = []
    beams: Annotated[int, msgspec.Meta(ge=1, le=4096)] = 360
    selected: Robots = []
    follow: Annotated[int, msgspec.Meta(ge=-1, le=2**31)] = -1
    docs: Annotated[list[Doc], msgspec.Meta(max_length=32)] = []

    def __post_init__(self) -> None:
        """Raise ValueError for a viewport that is none."""
        if len(self.viewport) not in (0, 4):
            raise ValueError("a viewport has four numbers: xmin, ymin, xmax, ymax")


class Watch(Request, frozen=True):
    """`watch`: send the newest message of a topic, or with `field` each value of that field, until `unwatch`."""

    topic: Text
    field: Text = ""

    def __post_init__(self) -> None:
        """Raise ValueError for a wildcard: it would keep everything that the team sends."""
        if is_wildcard(self.topic):
            raise ValueError(f"a page watches single topics, not {self.topic!r}")


class Drive(Request, frozen=True):
    """Velocities (m/s, rad/s) for the robot whose lease the page has."""

    robot: RobotId
    linear: Speed
    angular: Speed
    left: Speed = 0.0
    """m/s to the left, for bases that can."""


class Command(Request, frozen=True):
    """Needs the token, unless it is `stop_robots`, and is answered under its number."""

    seq: Annotated[int, msgspec.Meta(ge=0, le=2**53)]


class OfRobot(Command, frozen=True):
    """One robot is commanded. `take`: the page asks for its lease, to drive it; `release` gives that back."""

    robot: RobotId


class Placed(OfRobot, frozen=True):
    """Where a robot is, x, y (m), yaw (rad) in `map`: in the world (`move`), or for its localiser (`initialpose`)."""

    x: Coordinate
    y: Coordinate
    yaw: Coordinate


class Goal(Command, frozen=True):
    """Send these robots to x, y (m), yaw (rad) in `map`; several spread around it."""

    robots: Robots
    x: Coordinate
    y: Coordinate
    yaw: Coordinate


class CancelGoals(Command, frozen=True):
    """Give up the goals of these robots: they stop."""

    robots: Robots
    pauses: bool = False
    """Whether all lists of goals (`zteam goals`) are paused too: no robot gets its next goal."""


class Step(Command, frozen=True):
    """`sim/step`."""

    ticks: Annotated[int, msgspec.Meta(ge=1, le=MAX_TICKS)] = 1


class Seek(Command, frozen=True):
    """`replay/seek`."""

    time: Time


class StepReplay(Command, frozen=True):
    """`replay/step`."""

    ticks: Ticks


class SetReplaySpeed(Command, frozen=True):
    """`replay/speed`."""

    factor: ReplaySpeed


class SetSpeed(Command, frozen=True):
    """`sim/speed`; 0: as fast as possible."""

    factor: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_SPEED)]


class Spawn(Command, frozen=True):
    """`sim/spawn`, and `up/start` for the new robot if there is a `behavior`."""

    model: Text
    x: Coordinate
    y: Coordinate
    yaw: Coordinate = 0.0
    behavior: Text = ""


class SetParameter(OfRobot, frozen=True):
    """Give a parameter of the robot's behaviour another value."""

    name: Text
    value: Text
    """As in a team file: 0.4, true, text, [1, 2]."""


class Start(OfRobot, frozen=True):
    """`up/start`: have the launcher start the robot's process with a behaviour, or if that is empty as before."""

    behavior: Text


KINDS: Mapping[str, type[Request]] = {
    "hello": Hello, "token": Token, "ack": Ack, "look": Look, "watch": Watch, "unwatch": Watch, "drive": Drive,
    "stop_robots": Command, "release_robots": Command, "take": OfRobot, "release": OfRobot,
    "goal": Goal, "cancel": CancelGoals, "resume_lists": Command, "initialpose": Placed,
    "pause": Command, "resume": Command, "step": Step, "speed": SetSpeed, "reset": Command,
    "spawn": Spawn, "remove": OfRobot, "move": Placed, "start": Start, "parameter": SetParameter, "doctor": Command,
    "replay_pause": Command, "replay_resume": Command, "replay_seek": Seek, "replay_step": StepReplay,
    "replay_speed": SetReplaySpeed,
}  # fmt: skip
"""Those without a field of their own are named as the queries that they ask: `sim/pause`, `sim/reset`."""
WITH_RECORDING = frozenset(op for op in KINDS if op.startswith("replay_")) | {"doctor"}
"""The commands that a page may give while a recording is shown."""


class _Op(msgspec.Struct):
    op: str


def decode_request(text: str | bytes) -> Request:
    """The request in a message of the page. Raises DecodeError that says what is wrong."""
    if len(text) > MAX_BYTES:
        raise DecodeError(f"a message of {len(text)} bytes: at most {MAX_BYTES} are taken")
    payload = text if isinstance(text, bytes) else text.encode(errors="surrogatepass")
    op = decode_json(payload, _Op).op
    if op not in KINDS:
        raise DecodeError(f"{op!r:.40} is no message of a page")
    return decode_json(payload, KINDS[op])
