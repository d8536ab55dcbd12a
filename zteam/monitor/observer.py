"""What the bus shows of a team: its processes, the gate, the time, and its robots' newest messages and motion."""

import math
import threading
from collections import defaultdict
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Generic, TypeVar

import msgspec

from zteam import messages, names
from zteam.bus import Bus
from zteam.bus.transport import Closeable
from zteam.clock import monotonic, to_seconds, wait_until
from zteam.geometry import Pose2
from zteam.messages import Clock, LaserScan, Message, Odometry, TeamState, TeamStatus, ns_from_time
from zteam.messages.planar import pose2_of
from zteam.messages.topics import is_latched, type_of_key
from zteam.node.tokens import TokenSet

M = TypeVar("M", bound=Message)

LINK, PRESENCE = "link", "presence"
"""Events besides the messages of topics."""
SLOWEST = 0.05
"""m/s, or rad/s, below which a robot stands."""


class Motion(msgspec.Struct):
    """How a robot moves, by the simulator's ground truth and its commands, in the bus's order. Stamps are simulated
    ns."""

    stamp: int = 0
    """Of the newest truth."""
    world: int = 0
    """How often the world began anew."""
    tick: int = 0
    """The shortest time between two truths."""
    speed: float = 0.0
    moved: int = -1
    """Of the newest truth in which it moved."""
    started: int = -1
    """Since when it has moved, or moved last."""
    halted: int = 0
    """Since when it has stood, or stood last."""
    commanded: int | None = None
    """Of its last command; None before the first."""
    commanded_at: float = 0.0
    """Host time of that."""
    silent: int = 0
    """How long before the newest truth that was; 0 while the robot stands or brakes: it brakes as fast as it can."""
    distance: float = 0.0
    """Metres driven in this world. A robot that is put elsewhere has not driven there."""

    @property
    def moves(self) -> bool:
        """Whether it moved in the newest truth."""
        return self.speed >= SLOWEST

    def moved_since(self, world: int, stamp: int) -> bool:
        """Whether it has moved later than at this time of this world."""
        return (self.world, self.moved) > (world, stamp)

    def begin_anew(self) -> None:
        self.world, self.moved, self.commanded, self.distance = self.world + 1, -1, None, 0.0
        self.speed, self.stamp = 0.0, 0

    def on_command(self, now: int, host: float) -> None:
        """A command at the time `now` and the host time `host`. Before the first truth its time is not known."""
        if self.stamp:
            self.commanded, self.commanded_at = max(self.stamp, now), host

    def on_truth(self, truth: Odometry) -> None:
        """The simulator's truth."""
        stamp, twist = ns_from_time(truth.header.stamp), truth.twist.twist
        if stamp < self.stamp:
            self.begin_anew()
        elif stamp > self.stamp > 0:
            self.tick = min(stamp - self.stamp, self.tick or stamp)
            # By its velocity in this tick: the pose also changes where a robot is moved, or comes back to the world.
            self.distance += math.hypot(twist.linear.x, twist.linear.y) * to_seconds(self.tick)
        before, moved, self.stamp, self.silent = self.speed, self.moves, stamp, 0
        self.speed = max(abs(twist.linear.x), abs(twist.linear.y), abs(twist.angular.z))
        if not self.moves:
            self.halted = stamp if moved else self.halted
            return
        self.moved, self.started = stamp, self.started if moved else stamp
        if self.commanded is not None and self.speed >= before:
            self.silent = stamp - self.commanded


class _Newest(Generic[M]):
    """The newest message of a robot on a topic, which is observed from the first use on; None before the first."""

    def __init__(self, topic: str, kind: type[M]) -> None:
        self._topic, self._kind = topic, kind

    def __get__(self, robot: "RobotView", _owner: type) -> M | None:
        if self._topic not in robot.newest:
            robot.team.observe(self._topic, robot_id=robot.id)
        found = robot.newest.get(self._topic)
        return found if isinstance(found, self._kind) else None


class RobotView:
    """The newest messages of one robot."""

    truth = _Newest(names.GROUND_TRUTH, Odometry)
    status = _Newest(names.STATUS, messages.RobotStatus)
    odom = _Newest(names.ODOM, Odometry)
    scan = _Newest(names.BASE_SCAN, LaserScan)
    """Of the first laser."""
    command = _Newest(names.CMD_VEL, messages.Twist)
    _stall = _Newest(names.STALL, messages.Bool)

    def __init__(self, robot_id: int, team: "TeamObserver") -> None:
        self.id, self.name, self.team = robot_id, names.robot_name(robot_id), team
        self.newest: dict[str, Message] = {}
        """By topic, for the topics that are observed."""
        self.motion = Motion()
        self.commands_received = 0
        self.spoke = 0.0
        """Host time of `status`; 0 before the first."""

    @property
    def stall(self) -> bool:
        """Whether it is commanded to move and blocked."""
        return self._stall is not None and self._stall.data

    @property
    def commands(self) -> int:
        """How many commands arrived since the first use."""
        self.team.observe(names.CMD_VEL, robot_id=self.id)
        return self.commands_received

    @property
    def distance_travelled(self) -> float:
        """Metres that its base has driven since it was first observed, or since the last reset."""
        return self.motion.distance

    @property
    def pose(self) -> Pose2:
        """True pose in `map`; NaN until it is known."""
        return Pose2(math.nan, math.nan, math.nan) if self.truth is None else pose2_of(self.truth.pose.pose)

    @property
    def speed(self) -> float:
        """True forward speed in m/s; NaN until it is known."""
        return math.nan if self.truth is None else self.truth.twist.twist.linear.x

    def distance_to(self, robot_id: int) -> float:
        """Metres between the centres of two robots."""
        a, b = self.pose, self.team.robot(robot_id).pose
        return math.hypot(a.x - b.x, a.y - b.y)

    @property
    def reason(self) -> str:
        """Why it stands; empty while it drives, and without a status."""
        return getattr(self.newest.get(names.STATUS), "reason", "")

    def describe(self) -> str:
        """Its place, and why it stands."""
        why = f" ({self.reason})" if self.reason else ""
        return f"{self.name} at x {self.pose.x:.2f}, y {self.pose.y:.2f}{why}"

    def receive(self, topic: str, message: Message) -> None:
        """Keep a message. The caller holds the team's lock."""
        if isinstance(message, Odometry) and topic == names.GROUND_TRUTH:
            self.motion.on_truth(message)
        elif topic == names.CMD_VEL:
            self.commands_received += 1
            self.motion.on_command(self.team.now, monotonic())
        elif topic == names.STATUS:
            self.spoke = monotonic()
        self.newest[topic] = message


def _key_of_all(topic: str) -> str:
    return topic if type_of_key(topic) else names.all_robots_key(topic)


class TeamObserver:
    """Subscribes once to what it is asked to observe. `changed` is notified of each message, token and change of the
    link.

    Tokens and the link are always observed. Each other topic is observed on request: a subscriber to the clock, to
    ground truth or to commands slows fast runs down.
    """

    def __init__(
        self, bus: Bus, *topics: str, repeat: Callable[[Callable[[], bool]], None] = lambda _arrived: None
    ) -> None:
        """`topics` are observed of all robots. `repeat(arrived)` follows the subscription to a topic of one robot, for
        a world that stands still: it publishes its last tick again until `arrived()`."""
        self.bus, self._repeat = bus, repeat
        self.changed = threading.Condition(threading.RLock())
        self.version = 0
        """Grows with every notification."""
        self.link_up = True
        self._tokens = TokenSet()
        self.were_there: set[str] = set()
        """All names that processes have held."""
        self.team_status: TeamStatus | None = None
        self.go_at: float | None = None
        """Host time of the first GO."""
        self.now = 0
        """Simulated ns; it goes back when the world begins anew."""
        self.elapsed = 0
        """Simulated ns that were observed since GO, however often the world began anew."""
        self.robots: dict[int, RobotView] = {}
        """All that were observed or asked for, by id."""
        self._subscriptions: dict[str, Closeable] = {}
        self._handlers = defaultdict[str, list[Callable[[Any, Any], None]]](list)
        bus.watch_link(self._on_link)
        bus.watch_tokens([names.tokens_key("*")], self._on_token)
        self.observe(*topics)

    def on(self, event: str, handler: Callable[[Any, Any], None]) -> None:
        """Call `handler(robot, message)` for each message of a topic of robots, `handler(key, message)` for one of the
        team, `handler(name, alive)` for PRESENCE and `handler("", up)` for LINK, in the bus's thread."""
        self._handlers[event].append(handler)

    def observe(self, *topics: str, robot_id: int | None = None) -> None:
        """Subscribe to topics of the team, of all robots, or of one robot, unless that was done."""
        for topic in topics:
            of_all = _key_of_all(topic)
            key = of_all if robot_id is None else names.robot_key(robot_id, topic)
            kind = type_of_key(names.keys_in(key, [0])[0])
            if kind is None or not {key, of_all}.isdisjoint(self._subscriptions):
                continue
            of_one = [each for each in self._subscriptions if each.partition("/")[2] == topic]
            for covered in of_one if robot_id is None else ():
                self._subscriptions.pop(covered).close()
            self._subscriptions[key] = self.bus.subscribe(key, kind, self._on_message, latched=is_latched(key))
            if robot_id is not None and topic != names.CMD_VEL:
                self._repeat(partial(self.robot(robot_id).newest.__contains__, topic))

    def ignore(self, *topics: str) -> None:
        """End the subscriptions to topics of the team and of all robots, and forget what came."""
        for topic in topics:
            if (subscription := self._subscriptions.pop(_key_of_all(topic), None)) is not None:
                subscription.close()
            self.team_status = None if topic == names.TEAM_STATUS else self.team_status
            for robot in [*self.robots.values()]:
                robot.newest.pop(topic, None)

    def robot(self, robot_id: int) -> RobotView:
        return self.robots.get(robot_id) or self.robots.setdefault(robot_id, RobotView(robot_id, self))

    def alive(self, name: str) -> bool:
        """Whether a process holds this name."""
        return name in self._tokens

    def instances(self, name: str) -> frozenset[str]:
        """The sessions that hold this name."""
        with self.changed:
            return self._tokens.instances(name)

    def process_names(self) -> list[str]:
        with self.changed:
            return [*self._tokens]

    def wait_for_news(self, seen: int, timeout: float) -> None:
        """Wait until `version` differs from `seen`, for at most `timeout` host seconds."""
        with self.changed:
            wait_until(self.changed, lambda: self.version != seen, timeout)

    def reaches(self, now: int, robots: Iterable[int]) -> bool:
        """Whether all true poses and other observed data of simulated time `now` (ns) have arrived."""
        with self.changed:
            for robot in map(self.robot, robots):
                data = [m for m in robot.newest.values() if isinstance(m, (Odometry, LaserScan))]
                if names.GROUND_TRUTH not in robot.newest or {ns_from_time(m.header.stamp) for m in data} != {now}:
                    return False
            return True

    def describe(self) -> str:
        """Where the first four robots are and why they stand, as the end of a sentence."""
        known = [robot for _, robot in sorted(self.robots.items()) if names.GROUND_TRUTH in robot.newest]
        return "".join(f"; {robot.describe()}" for robot in known[:4])

    def _notify(self, event: str, source: object, news: object) -> None:
        with self.changed:
            self.version += 1
            self.changed.notify_all()
        for handler in self._handlers.get(event, ()):
            handler(source, news)

    def _on_link(self, up: bool) -> None:
        self.link_up = up
        self._notify(LINK, "", up)

    def _on_token(self, key: str, alive: bool) -> None:
        if (token := names.split_token_key(key)) is not None:
            with self.changed:
                self._tokens.take(*token, alive)
                self.were_there.add(token[0])
            self._notify(PRESENCE, token[0], alive)

    def _on_message(self, key: str, message: Message) -> None:
        target = names.split_robot_key(key)
        source = key if target is None else self.robot(target[0])
        with self.changed:
            if isinstance(source, RobotView) and target is not None:
                source.receive(target[1], message)
            elif isinstance(message, Clock):
                self._set_time(ns_from_time(message.clock))
            elif isinstance(message, TeamStatus):
                self.team_status = message
                if message.state == TeamState.GO and self.go_at is None:
                    self.go_at = monotonic()
        self._notify(key if target is None else target[1], source, message)

    def _set_time(self, now: int) -> None:
        before, self.now = self.now, now
        if self.go_at is not None and before:
            self.elapsed += max(0, now - before)
        if before > now:
            # The simulator sends the clock of a new time first of all.
            for robot in self.robots.values():
                robot.motion.begin_anew()
