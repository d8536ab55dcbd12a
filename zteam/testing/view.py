"""What a test sees of a team: the newest of everything, from the bus alone."""

import math
import threading

from zteam import names
from zteam.bus import Bus
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import (
    Bool,
    Clock,
    LaserScan,
    Odometry,
    RobotStatus,
    TeamState,
    TeamStatus,
    Twist,
    ns_from_time,
)


class RobotView:
    """The newest that was heard of one robot; None (or NaN) until then."""

    def __init__(self, robot_id: int, team: "TeamView") -> None:
        self.id = robot_id
        self._team = team
        self.truth: Odometry | None = None
        self.odom: Odometry | None = None
        self.scan: LaserScan | None = None
        self.status: RobotStatus | None = None
        self.command: Twist | None = None
        self.commands = 0
        """How many commands were heard."""
        self.stall = False
        self.distance_travelled = 0.0
        """Metres driven since the test began to listen."""

    @property
    def pose(self) -> Pose2:
        """True pose in `map`; NaN until it is known."""
        if self.truth is None:
            return Pose2(math.nan, math.nan, math.nan)
        p, q = self.truth.pose.pose.position, self.truth.pose.pose.orientation
        return Pose2(p.x, p.y, yaw_from_quaternion(q.x, q.y, q.z, q.w))

    @property
    def speed(self) -> float:
        """Forward speed in m/s by the truth; NaN until it is known."""
        return math.nan if self.truth is None else self.truth.twist.twist.linear.x

    @property
    def truth_stamp(self) -> float:
        """Simulated seconds of `pose`."""
        return math.nan if self.truth is None else ns_from_time(self.truth.header.stamp) / 1e9

    def distance_to(self, robot_id: int) -> float:
        """Metres between the centres of two robots."""
        a, b = self.pose, self._team.robot(robot_id).pose
        return math.hypot(a.x - b.x, a.y - b.y)

    def take_truth(self, message: Odometry) -> None:
        """A new true pose."""
        before = self.pose
        self.truth = message
        step = math.hypot(self.pose.x - before.x, self.pose.y - before.y)
        if math.isfinite(step):
            self.distance_travelled += step


class TeamView:
    """Listens to the whole team; `changed` is notified with every message."""

    def __init__(self, bus: Bus) -> None:
        self.changed = threading.Condition(threading.RLock())
        self.now = 0
        """Simulated ns."""
        self.team_status: TeamStatus | None = None
        self._robots: dict[int, RobotView] = {}
        self._tokens: dict[str, set[str]] = {}
        bus.subscribe(names.CLOCK, Clock, self._on_clock)
        bus.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        for topic, kind in (
            (names.GROUND_TRUTH, Odometry),
            (names.ODOM, Odometry),
            (names.BASE_SCAN, LaserScan),
            (names.STALL, Bool),
            (names.STATUS, RobotStatus),
            (names.CMD_VEL, Twist),
        ):
            bus.subscribe(names.all_robots_key(topic), kind, self._on_robot)
        bus.watch_tokens([names.tokens_key()], self._on_token)

    @property
    def is_go(self) -> bool:
        """Whether GO stands."""
        return self.team_status is not None and self.team_status.state == TeamState.GO

    def robot(self, robot_id: int) -> RobotView:
        """The view of one robot."""
        return self._robots.setdefault(robot_id, RobotView(robot_id, self))

    def alive(self, name: str) -> bool:
        """Whether a token of this name is there."""
        return bool(self._tokens.get(name))

    def _on_clock(self, _key: str, message: Clock) -> None:
        with self.changed:
            self.now = ns_from_time(message.clock)
            self.changed.notify_all()

    def _on_team_status(self, _key: str, message: TeamStatus) -> None:
        with self.changed:
            self.team_status = message
            self.changed.notify_all()

    def _on_robot(self, key: str, message: object) -> None:
        target = names.split_robot_key(key)
        if target is None:
            return
        robot_id, topic = target
        with self.changed:
            robot = self.robot(robot_id)
            if topic == names.GROUND_TRUTH and isinstance(message, Odometry):
                robot.take_truth(message)
            elif topic == names.ODOM and isinstance(message, Odometry):
                robot.odom = message
            elif isinstance(message, LaserScan):
                robot.scan = message
            elif isinstance(message, Bool):
                robot.stall = message.data
            elif isinstance(message, RobotStatus):
                robot.status = message
            elif isinstance(message, Twist):
                robot.command, robot.commands = message, robot.commands + 1
            self.changed.notify_all()

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is None:
            return
        with self.changed:
            held = self._tokens.setdefault(token[0], set())
            (held.add if alive else held.discard)(token[1])
            self.changed.notify_all()
