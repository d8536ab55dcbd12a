"""zteam's own types (docs/time.md, docs/api.md)."""

from enum import IntEnum
from typing import ClassVar

import msgspec

from zteam.messages.geometry_msgs import Polygon, PoseStamped, Twist
from zteam.messages.message import (
    BoolSeq,
    Int32Seq,
    Message,
    Uint8Seq,
    bool_,
    float32,
    float64,
    int32,
    uint8,
    uint32,
    uint64,
    zeros,
)
from zteam.messages.std_msgs import ColorRGBA, Duration, Stamped, Time


class Fiducial(Message):
    """A marked model in sight: metres and radians in the frame of the finder; id 0 is too far to be read."""

    id: int32 = 0
    range: float32 = 0.0
    bearing: float32 = 0.0
    orientation: float32 = 0.0


class Fiducials(Stamped):
    """All that a fiducial finder sees."""

    fiducials: list[Fiducial] = msgspec.field(default_factory=list)


class Bumper(Stamped):
    """Which pieces of a robot's bumpers are pressed, in file order."""

    pressed: BoolSeq = zeros("bool")


class Blob(Message):
    """Neighbouring pixels of one colour: middle and width in radians, range of the nearest in metres."""

    color: ColorRGBA = msgspec.field(default_factory=ColorRGBA)
    name: str = ""
    bearing: float32 = 0.0
    width: float32 = 0.0
    range: float32 = 0.0


class Blobs(Stamped):
    """All that a blob finder sees, from right to left."""

    blobs: list[Blob] = msgspec.field(default_factory=list)


class RobotStatus(Stamped):
    """What one robot says of itself; `state` is one of RobotState.

    `behavior` and `leader` (-1 = none) are what it was started with. `follows` is the robot that it follows now (-1 =
    none), and `turns` how often its line was led from the other end (-1 = it cannot be); `gap` is what it keeps to
    the robot that it follows, metres. `driver` is one of RobotDriver. `reason` says why the robot stands; it is empty
    while it does not. `speed` is that of its newest command in m/s, negative backwards. While it `is_stopped`
    (`zteam stop`), it commands zero velocity, whatever drives it. `waits_for` is the robot for which it stands: one
    before it in its line, or one that is silent or lost; `blocked_by` the robot before which its safety layer stops it
    (-1 = none). `goal_state` is one of NavigationState.
    """

    robot_id: int32 = 0
    is_ready: bool_ = False
    state: uint8 = 0
    epoch: uint32 = 0
    text: str = ""
    behavior: str = ""
    driver: str = ""
    reason: str = ""
    leader: int32 = -1
    speed: float64 = 0.0
    follows: int32 = -1
    turns: int32 = -1
    gap: float64 = 0.0
    is_stopped: bool_ = False
    waits_for: int32 = -1
    blocked_by: int32 = -1
    goal_state: uint8 = 0

    @property
    def followed(self) -> int:
        """The robot that it follows now, -1 = none; as it was started where its line cannot be led from both ends."""
        return self.follows if self.turns >= 0 else self.leader


class TeamStatus(Stamped):
    """What the monitor says of the team; `state` is one of TeamState, GO holds from `go_stamp` on.

    `waiting_for` says in words what the gate waits for; it is empty after GO.
    """

    state: uint8 = 0
    epoch: uint32 = 0
    go_stamp: Time = msgspec.field(default_factory=Time)
    team_size: int32 = 0
    ready: Int32Seq = zeros("int32")
    missing: Int32Seq = zeros("int32")
    lost: Int32Seq = zeros("int32")
    waiting_for: str = ""


class BaseInfo(Message):
    """What a robot's base is: its outline in `base_footprint` (metres) and its limits, under Nav2's names.

    `drive` is `diff`, `omni` or `car`. Speeds in m/s and rad/s, accelerations in m/s^2 and rad/s^2; `min_vel_x` is
    negative for a base that drives backwards, `decel_lim_x` is negative as in Nav2. An infinite acceleration means that
    there is no limit. `max_vel_y` and `acc_lim_y` hold to the left and to the right, for `omni`. `decel_lim_reverse`,
    positive, is how hard the base brakes when it drives backwards; 0 or inf: as hard as forwards. `wheelbase` (metres)
    is a car's; 0: not known.
    """

    model: str = ""
    drive: str = ""
    footprint: Polygon = msgspec.field(default_factory=Polygon)
    max_vel_x: float64 = 0.0
    min_vel_x: float64 = 0.0
    max_vel_theta: float64 = 0.0
    acc_lim_x: float64 = 0.0
    decel_lim_x: float64 = 0.0
    acc_lim_theta: float64 = 0.0
    max_vel_y: float64 = 0.0
    acc_lim_y: float64 = 0.0
    decel_lim_reverse: float64 = 0.0
    wheelbase: float64 = 0.0


class NavigationState(IntEnum):
    """Values of NavigationStatus.state."""

    IDLE = 0
    PLANNING = 1
    DRIVING = 2
    RECOVERING = 3
    SUCCEEDED = 4
    ABORTED = 5
    CANCELED = 6


class NavigationStatus(Stamped):
    """How far a robot is on its way to a goal; `state` is one of NavigationState.

    `goal` is the newest goal, as it was sent; it stays when the robot has arrived or given up. `distance_remaining` are
    metres of the path that lie before it, `estimated_time_remaining` what they take at the speed driven so far.
    `recoveries` counts those for this goal. `text` says why the robot does not get on, or why it has given up.
    """

    state: uint8 = 0
    goal: PoseStamped = msgspec.field(default_factory=PoseStamped)
    distance_remaining: float64 = 0.0
    estimated_time_remaining: Duration = msgspec.field(default_factory=Duration)
    recoveries: int32 = 0
    text: str = ""


class Input(Message):
    """Lock-step: what came from outside on `key`, such as a message of `type`, for all participants in one tick.

    The simulator numbers them from 1 on. `data` is what was sent, byte for byte; `type` is the ROS name of a message's
    type, empty where its sender named none, and `REQUEST` for a query's request, in JSON.
    """

    REQUEST: ClassVar[str] = "request"

    number: uint64 = 0
    key: str = ""
    type: str = ""
    data: Uint8Seq = zeros("uint8")


class _EarlierTick(Message):
    ros_type: ClassVar[str] = ""
    stamp: Time = msgspec.field(default_factory=Time)
    epoch: uint32 = 0
    tick: uint64 = 0
    robots: Int32Seq = zeros("int32")
    participants: list[str] = msgspec.field(default_factory=list)


class Tick(_EarlierTick):
    """Lock-step: the world stands at tick `tick`, with these robots and participants.

    `sessions` are those of the processes that took part when the tick was opened. What any other session sends counts
    through the `inputs` of the next tick alone. `sent` is how many messages the simulator has published.
    """

    ros_type: ClassVar[str] = "zteam_msgs/msg/Tick"
    earlier: ClassVar[type[Message] | None] = _EarlierTick
    sessions: list[str] = msgspec.field(default_factory=list)
    sent: uint32 = 0
    inputs: list[Input] = msgspec.field(default_factory=list)


class _EarlierDone(Message):
    ros_type: ClassVar[str] = ""
    epoch: uint32 = 0
    tick: uint64 = 0
    has_command: bool_ = False
    command: Twist = msgspec.field(default_factory=Twist)


class Done(_EarlierDone):
    """Lock-step: a participant has finished `tick`.

    `sent` is how many messages it has published. `reads` are the key expressions that it subscribes to, when it joins;
    those that end in `?latched` ask for the last message of before, too. `inputs` are queries that are to change this
    process, in the next tick.
    """

    ros_type: ClassVar[str] = "zteam_msgs/msg/Done"
    earlier: ClassVar[type[Message] | None] = _EarlierDone
    sent: uint32 = 0
    reads: list[str] = msgspec.field(default_factory=list)
    inputs: list[Input] = msgspec.field(default_factory=list)


class RobotState:
    """Values of RobotStatus.state."""

    BOOT = 0
    READY = 1
    RUNNING = 2
    STOPPED = 3
    FAULT = 4

    TEXT: ClassVar[tuple[str, ...]] = ("boot", "ready", "running", "stopped", "fault")


class RobotDriver:
    """Values of RobotStatus.driver: what commands the wheels."""

    NONE = "none"
    BEHAVIOR = "behavior"
    NAVIGATION = "navigation"
    TELEOP = "teleop"


class TeamState:
    """Values of TeamStatus.state."""

    WAITING = 0
    GO = 1
