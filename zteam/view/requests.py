"""What a page says: one JSON object each, and what is wrong with it. Pure."""

from typing import Annotated, Literal

import msgspec

from zteam.errors import DecodeError
from zteam.names import is_wildcard
from zteam.simulator.client import MAX_SPEED, MAX_TICKS, Place, RobotId

VERSION = 1
MAX_BYTES = 64 * 1024
Layer = Literal[
    "scans", "tf", "goals", "plans", "costmaps", "particles", "markers", "sonars", "fiducials", "trails", "obstacles",
    "costs",
]  # fmt: skip
Doc = Literal["tf", "topics", "log", "inspect", "doctor"]
MAX_BEAMS = 4096
MAX_WATCHES = 64
"""Topics and fields that one page watches."""

Seq = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
Text = Annotated[str, msgspec.Meta(max_length=256)]
Robots = Annotated[list[RobotId], msgspec.Meta(max_length=1024)]
Speed = Annotated[float, msgspec.Meta(ge=-100.0, le=100.0)]


class Request(msgspec.Struct, tag_field="op", forbid_unknown_fields=True, frozen=True):
    """Base of all: `op` says which it is."""


class Hello(Request, tag="hello", frozen=True):
    """The first one. Without the token the page may watch, not command."""

    version: int
    token: Text = ""


class Token(Request, tag="token", frozen=True):
    """A token that the page learnt after its `hello`. It is answered by `rights`."""

    token: Text


class Ack(Request, tag="ack", frozen=True):
    """The page has taken frame `frame`: it may be sent the next one."""

    frame: Annotated[int, msgspec.Meta(ge=0, le=2**32 - 1)]


class Look(Request, tag="look", frozen=True):
    """What the page shows now."""

    viewport: Annotated[list[Place], msgspec.Meta(max_length=4)] = []
    """x and y of the lowest, then of the highest corner, in `map`; empty: everything."""
    layers: Annotated[list[Layer], msgspec.Meta(max_length=32)] = []
    beams: Annotated[int, msgspec.Meta(ge=1, le=MAX_BEAMS)] = 360
    selected: Robots = []
    follow: Annotated[int, msgspec.Meta(ge=-1, le=2**31)] = -1
    docs: Annotated[list[Doc], msgspec.Meta(max_length=32)] = []

    def __post_init__(self) -> None:
        """Raise ValueError for a viewport that is none."""
        if len(self.viewport) not in (0, 4):
            raise ValueError("a viewport has four numbers: xmin, ymin, xmax, ymax")


class Watch(Request, tag="watch", frozen=True):
    """Send the newest message of a topic, or with `field` each value of that field."""

    topic: Text
    field: Text = ""

    def __post_init__(self) -> None:
        """Raise ValueError for a wildcard: it would keep everything that the team sends."""
        if is_wildcard(self.topic):
            raise ValueError(f"a page watches single topics, not {self.topic!r}")


class Unwatch(Request, tag="unwatch", frozen=True):
    """The end of a `watch`."""

    topic: Text
    field: Text = ""


class Command(Request, frozen=True):
    """Needs the token, and is answered under its number."""

    seq: Seq


class OfRobot(Command, frozen=True):
    """Base of the commands for one robot."""

    robot: RobotId


class Placed(OfRobot, frozen=True):
    """Base of the commands that say where a robot is: x, y (m), yaw (rad) in `map`."""

    x: Place
    y: Place
    yaw: Place


class Goal(Command, tag="goal", frozen=True):
    """Send these robots to x, y (m), yaw (rad) in `map`; several spread around it."""

    robots: Robots
    x: Place
    y: Place
    yaw: Place


class StopRobots(Command, tag="stop_robots", frozen=True):
    """Stop all robots until they are released. It needs no token: each page that watches may stop."""


class ReleaseRobots(Command, tag="release_robots", frozen=True):
    """Release all robots."""


class CancelGoals(Command, tag="cancel", frozen=True):
    """Give up the goals of these robots: they stop."""

    robots: Robots
    pauses: bool = False
    """Whether all lists of goals (`zteam goals`) are paused too: no robot gets its next goal."""


class ResumeLists(Command, tag="resume_lists", frozen=True):
    """Go on with all lists of goals."""


class InitialPose(Placed, tag="initialpose", frozen=True):
    """Tell a robot's localisation where it is."""


class Take(OfRobot, tag="take", frozen=True):
    """Ask for the lease of a robot, to drive it."""


class Release(OfRobot, tag="release", frozen=True):
    """Give the lease back: the robot stops."""


class Drive(Request, tag="drive", frozen=True):
    """Velocities (m/s, rad/s) for the robot whose lease the page has."""

    robot: RobotId
    linear: Speed
    angular: Speed
    left: Speed = 0.0
    """m/s to the left, for bases that can."""


class Pause(Command, tag="pause", frozen=True):
    """`sim/pause`."""


class Resume(Command, tag="resume", frozen=True):
    """`sim/resume`."""


class Step(Command, tag="step", frozen=True):
    """`sim/step`."""

    ticks: Annotated[int, msgspec.Meta(ge=1, le=MAX_TICKS)] = 1


class SetSpeed(Command, tag="speed", frozen=True):
    """`sim/speed`; 0: as fast as possible."""

    factor: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_SPEED)]


class Reset(Command, tag="reset", frozen=True):
    """`sim/reset`."""


class Spawn(Command, tag="spawn", frozen=True):
    """`sim/spawn`, and `up/start` for the new robot if there is a `behavior`."""

    model: Text
    x: Place
    y: Place
    yaw: Place = 0.0
    behavior: Text = ""


class Remove(OfRobot, tag="remove", frozen=True):
    """`sim/remove`."""


class Move(Placed, tag="move", frozen=True):
    """`sim/move`."""


class SetParameter(OfRobot, tag="parameter", frozen=True):
    """Give a parameter of the robot's behaviour another value."""

    name: Text
    value: Text
    """As in a team file: 0.4, true, text, [1, 2]."""


class Start(OfRobot, tag="start", frozen=True):
    """`up/start`: have the launcher start the robot's process with a behaviour."""

    behavior: Text


class Examine(Command, tag="doctor", frozen=True):
    """Make the document `doctor` anew."""


AnyRequest = (
    Hello | Token | Ack | Look | Watch | Unwatch | Goal | CancelGoals | ResumeLists | InitialPose | Take | Release
    | Drive | StopRobots | ReleaseRobots
    | Pause | Resume | Step | SetSpeed | Reset | Spawn | Remove | Move | SetParameter | Examine | Start
)  # fmt: skip

_DECODER = msgspec.json.Decoder(AnyRequest)


def decode_request(text: str | bytes) -> AnyRequest:
    """The request in a message of the page. Raises DecodeError that says what is wrong."""
    if len(text) > MAX_BYTES:
        raise DecodeError(f"a message of {len(text)} bytes: at most {MAX_BYTES} are taken")
    try:
        request: AnyRequest = _DECODER.decode(text)
    except (msgspec.DecodeError, UnicodeError) as error:
        raise DecodeError(str(error)) from None
    except RecursionError:
        raise DecodeError("it is nested too deeply") from None
    return request
