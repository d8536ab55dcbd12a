"""A test's view of a team: the newest message of every topic, from the bus alone."""

import math
import threading
from collections.abc import Callable, Iterable
from typing import TypeVar

from zteam import names
from zteam.bus import Bus
from zteam.clock import monotonic, wait_until
from zteam.geometry import Pose2
from zteam.messages import Bool, Clock, LaserScan, Message, Odometry, RobotStatus, TeamStatus, Twist, ns_from_time
from zteam.messages.planar import pose2_of
from zteam.node.tokens import TokenSet

M = TypeVar("M", bound=Message)

_DESCRIBED = 4
"""Robots that the error of a condition names."""


class RobotView:
    """The newest messages of one robot; None (or NaN) before the first."""

    def __init__(self, robot_id: int, team: "ObservedTeam") -> None:
        self.id = robot_id
        self._team = team
        self.truth: Odometry | None = None
        self.status: RobotStatus | None = None
        self.spoke = 0.0
        """Host time of `status`; 0 before the first."""
        self.newest: dict[str, Message] = {}
        """By topic, for the topics that the test has asked for."""
        self.heard: dict[str, int] = {}
        """How many messages arrived, by topic."""
        self.distance_travelled = 0.0
        """Metres that its base has driven since the fixture first saw it, or since the last reset. A robot that is put
        elsewhere has not driven there."""

    def _look(self, topic: str, kind: type[M]) -> M | None:
        self._team.want(self, topic, kind)
        found = self.newest.get(topic)
        return found if isinstance(found, kind) else None

    @property
    def odom(self) -> Odometry | None:
        """Newest odometry; subscribed at the first use."""
        return self._look(names.ODOM, Odometry)

    @property
    def scan(self) -> LaserScan | None:
        """Newest scan of the first laser; subscribed at the first use."""
        return self._look(names.BASE_SCAN, LaserScan)

    @property
    def stall(self) -> bool:
        """Whether it is commanded to move and blocked; subscribed at the first use."""
        found = self._look(names.STALL, Bool)
        return found is not None and found.data

    @property
    def command(self) -> Twist | None:
        """Newest command; subscribed at the first use."""
        return self._look(names.CMD_VEL, Twist)

    @property
    def commands(self) -> int:
        """How many commands arrived since the first use."""
        self._look(names.CMD_VEL, Twist)
        return self.heard.get(names.CMD_VEL, 0)

    @property
    def pose(self) -> Pose2:
        """True pose in `map`; NaN until it is known."""
        if self.truth is None:
            return Pose2(math.nan, math.nan, math.nan)
        return pose2_of(self.truth.pose.pose)

    @property
    def speed(self) -> float:
        """True forward speed in m/s; NaN until it is known."""
        return math.nan if self.truth is None else self.truth.twist.twist.linear.x

    @property
    def truth_stamp(self) -> float:
        """Simulated seconds of `pose`."""
        return math.nan if self.truth is None else ns_from_time(self.truth.header.stamp) / 1e9

    def distance_to(self, robot_id: int) -> float:
        """Metres between the centres of two robots."""
        a, b = self.pose, self._team.robot(robot_id).pose
        return math.hypot(a.x - b.x, a.y - b.y)

    def describe(self) -> str:
        """Its place, and why it stands."""
        reason = getattr(self.status, "reason", "")
        return f"robot_{self.id} at x {self.pose.x:.2f}, y {self.pose.y:.2f}{f' ({reason})' if reason else ''}"

    def take_truth(self, message: Odometry, last_tick: int) -> None:
        """Store a new true pose; the tick before began at `last_tick` (simulated ns).

        The way is that of its velocity: a pose also changes where a robot is moved, or comes back to the world.
        """
        before, self.truth = self.truth, message
        if before is not None:
            since = max(last_tick, ns_from_time(before.header.stamp))
            velocity, seconds = message.twist.twist.linear, (ns_from_time(message.header.stamp) - since) / 1e9
            self.distance_travelled += math.hypot(velocity.x, velocity.y) * max(0.0, seconds)


class ObservedTeam:
    """Subscribes to the whole team; `changed` is notified with every message."""

    def __init__(self, bus: Bus, repeat: Callable[[Callable[[], bool]], None]) -> None:
        """`repeat(arrived)` follows a subscription: it waits until `arrived()`; a world that stands still publishes its
        last tick again."""
        self._bus = bus
        self._repeat = repeat
        self._wanted: set[str] = set()
        self.version = 0
        """Grows with every message and token that arrives."""
        self.changed = threading.Condition(threading.RLock())
        self.now = 0
        """Simulated ns."""
        self._last_tick = 0
        """Simulated ns of the tick before."""
        self.team_status: TeamStatus | None = None
        self.robots: dict[int, RobotView] = {}
        """All of which anything has been heard or asked, by id."""
        self._tokens = TokenSet()
        self.were_there: set[str] = set()
        """All names that processes have held."""
        bus.subscribe(names.CLOCK, Clock, self._on_clock)
        bus.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        for topic, kind in ((names.GROUND_TRUTH, Odometry), (names.STATUS, RobotStatus)):
            bus.subscribe(names.all_robots_key(topic), kind, self._on_robot)
        bus.watch_tokens([names.tokens_key()], self._on_token)

    def _tell(self) -> None:
        self.version += 1
        self.changed.notify_all()

    def wait_for_news(self, seen: int, timeout: float) -> None:
        """Wait until `version` differs from `seen`, for at most `timeout` host seconds."""
        with self.changed:
            wait_until(self.changed, lambda: self.version != seen, timeout)

    def want(self, robot: RobotView, topic: str, kind: type[Message]) -> None:
        """Subscribe to a robot's topic at the first use: a topic that no test reads would only slow the test down."""
        key = names.robot_key(robot.id, topic)
        if key not in self._wanted:
            self._wanted.add(key)
            self._bus.subscribe(key, kind, self._on_robot)
            self._repeat(lambda: topic in robot.newest or topic == names.CMD_VEL)

    def reaches(self, now: int, robots: Iterable[int]) -> bool:
        """Whether all true poses and subscribed topics of simulated time `now` (ns) have arrived."""
        with self.changed:
            for robot in map(self.robot, robots):
                heard = [robot.truth, *robot.newest.values()]
                stamps = {ns_from_time(m.header.stamp) for m in heard if isinstance(m, (Odometry, LaserScan))}
                if robot.truth is None or stamps != {now}:
                    return False
            return True

    def robot(self, robot_id: int) -> RobotView:
        """The view of one robot."""
        return self.robots.setdefault(robot_id, RobotView(robot_id, self))

    def describe(self) -> str:
        """Where the first robots are and why they stand, as the end of a sentence."""
        known = [robot for _, robot in sorted(self.robots.items()) if robot.truth is not None]
        return "".join(f"; {robot.describe()}" for robot in known[:_DESCRIBED])

    def alive(self, name: str) -> bool:
        """Whether a process holds this name."""
        return name in self._tokens

    def process_names(self) -> list[str]:
        """The names that processes hold."""
        with self.changed:
            return [*self._tokens]

    def _on_clock(self, _key: str, message: Clock) -> None:
        with self.changed:
            before, self.now = self.now, ns_from_time(message.clock)
            if before != self.now:
                self._last_tick = before if before < self.now else 0
            if before > self.now:
                # The simulator sends the clock of a new time first of all.
                for robot in self.robots.values():
                    robot.distance_travelled = 0.0
            self._tell()

    def _on_team_status(self, _key: str, message: TeamStatus) -> None:
        with self.changed:
            self.team_status = message
            self._tell()

    def _on_robot(self, key: str, message: object) -> None:
        target = names.split_robot_key(key)
        if target is None:
            return
        robot_id, topic = target
        with self.changed:
            robot = self.robot(robot_id)
            if topic == names.GROUND_TRUTH and isinstance(message, Odometry):
                stamp = ns_from_time(message.header.stamp)
                # The clock of its tick may come before it or after it.
                last_tick = self.now if self.now < stamp else self._last_tick if self.now == stamp else 0
                robot.take_truth(message, last_tick)
            elif isinstance(message, RobotStatus):
                robot.status, robot.spoke = message, monotonic()
            elif isinstance(message, Message):
                robot.newest[topic] = message
                robot.heard[topic] = robot.heard.get(topic, 0) + 1
            self._tell()

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is None:
            return
        with self.changed:
            self._tokens.take(*token, alive)
            self.were_there.add(token[0])
            self._tell()
