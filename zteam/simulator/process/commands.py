"""What moves robots: their newest commands on `robot_N/cmd_vel`, and which of them are stopped."""

import threading
from collections.abc import Callable, Collection, Container
from functools import partial

from zteam import names
from zteam.bus import Bus
from zteam.bus.lateness import Lateness
from zteam.bus.transport import Closeable, Held, RawSample
from zteam.clock import monotonic, wait_until
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import log
from zteam.messages import Input, Twist
from zteam.messages.message import CDR
from zteam.node.process_node import ProcessNode
from zteam.node.stopping import ask_stopped, serve_stop
from zteam.node.tokens import TokenSet, Writers
from zteam.simulator.process.statistics import RunStatistics

_MOST_WRITERS = 16
"""Sessions of a robot that are named: any program may hold a token of its name."""


class RobotCommands:
    """The newest command of every robot since the last tick. The bus's threads fill it, the main loop empties it."""

    def __init__(self, node: ProcessNode, robots: Container[int], statistics: RunStatistics, *, lockstep: bool) -> None:
        """`robots` are those in the world, which come and go. In lock-step no command is late: the world waits."""
        self._node = node
        self._robots = robots
        self._statistics = statistics
        self._lateness = None if lockstep else Lateness()
        self._lock = threading.RLock()
        self._changed = threading.Condition(self._lock)
        self._fresh: dict[int, Twist] = {}
        self._scan_sent: dict[int, float] = {}
        """Host times at which scans left that have no command yet."""
        self._holders = TokenSet()
        """Of any name."""
        self._own: dict[int, set[str]] = {}
        """Sessions that hold a robot's name or have held it: a last command may come after the end of the token."""
        self.passes_over: Callable[[str], bool] = lambda session: False
        """Whether what a session sends comes in another way: in lock-step, with the inputs of the next tick."""
        self._others = Writers()
        """Sessions that command a robot without ever having held its name."""
        node.bus.watch_tokens([names.tokens_key("*")], self._on_token)
        node.bus.subscribe_raw(names.all_robots_key(names.CMD_VEL), self._on_sample)

    def _on_token(self, key: str, alive: bool) -> None:
        if token := names.split_token_key(key):
            robot_id = names.robot_id_of(token[0])
            with self._changed:
                self._holders.take(*token, alive)
                if alive and robot_id is not None:
                    self._own.setdefault(robot_id, set()).add(token[1])

    def _on_sample(self, sample: RawSample) -> None:
        target = names.split_robot_key(sample.key)
        if target is None or target[0] not in self._robots:
            self._node.bus.counters.drop(sample.key, "the world has no such robot")
            return
        robot_id = target[0]
        if self._lateness is not None and (problem := self._lateness.problem(sample)):
            self._node.bus.counters.drop(sample.key, problem)
            self._statistics.add_late_command(robot_id)
            return
        is_own = sample.source in self._own.get(robot_id, ())
        if not is_own:
            with self._lock:
                self._others.take(robot_id, sample.source, monotonic())
        if self.passes_over(sample.source):
            return
        command = self._node.bus.counters.decode(sample, Twist)
        if command is None:
            return
        with self._changed:
            if not is_own and self._lateness is not None:
                self._statistics.add_external_command()
            self._fresh[robot_id] = command
            self._changed.notify_all()
        self.answered(robot_id)

    def read(self, came: Input) -> Twist | None:
        """The command in an input of lock-step; None if it cannot be read."""
        sample = RawSample(came.key, came.data.tobytes(), CDR + came.type if came.type else "")
        return self._node.bus.counters.decode(sample, Twist)

    def writers(self) -> dict[int, list[str]]:
        """Robots that more than one process commands, and the session ids of these processes."""
        with self._changed:
            recent, holders = self._others.recent(monotonic()), self._holders.instances
            found = {i: others | holders(names.robot_name(i)) for i, others in recent.items()}
        return {i: sorted(sessions)[:_MOST_WRITERS] for i, sessions in found.items() if len(sessions) > 1}

    def start_anew(self) -> None:
        """The world is as at its start: earlier commands no longer count."""
        with self._changed:
            self._fresh.clear()
            self._scan_sent.clear()

    def scan_sent(self, robot_id: int) -> None:
        """Note that the robot's scan of this tick leaves now."""
        with self._lock:
            self._scan_sent[robot_id] = monotonic()

    def answered(self, robot_id: int) -> None:
        """Note that the robot's command for its scan has come, on `cmd_vel` or in an answer of lock-step."""
        with self._lock:
            sent = self._scan_sent.pop(robot_id, None)
        if sent is not None:
            self._statistics.add_latency(monotonic() - sent)

    def wait_for_answers(self, timeout: float) -> None:
        """Wait for the commands of robots that were sent a scan, for `timeout` host seconds at most."""
        with self._changed:
            # A robot that was taken out of the world does not answer its last scan.
            self._scan_sent = {i: sent for i, sent in self._scan_sent.items() if i in self._robots}
            wait_until(
                self._changed, lambda: not any(names.robot_name(i) in self._holders for i in self._scan_sent), timeout
            )

    def drain(self) -> dict[int, Twist]:
        """The commands since the last call, of robots in the world."""
        with self._changed:
            fresh, self._fresh = self._fresh, {}
        return {robot_id: command for robot_id, command in fresh.items() if robot_id in self._robots}

    def missing(self, commands: Container[int]) -> list[int]:
        """The robots with a living process that are not in `commands`."""
        with self._changed:
            holding = [names.robot_id_of(name) for name in sorted(self._holders)]
        return [i for i in holding if i is not None and i not in commands and i in self._robots]


class Holds:
    """Which robots' bodies the simulator holds: those that are stopped, whatever commands them.

    The bus's threads change it, the main loop reads it once a tick: a query counts at once for those that ask, and for
    the bodies from the next tick on.
    """

    def __init__(self, bus: Bus, on_change: Callable[[int, bool], None]) -> None:
        """`on_change(robot_id, stopped)` is called when a query stops or releases a robot, which `hold` does then."""
        self._bus, self._on_change = bus, on_change
        self._held: set[int] = set()
        self._served: dict[int, list[Held[Closeable]]] = {}
        """By robot in the world."""
        self._stopped: dict[int, bool] = {}
        """What is known, by robot; the newest query counts. A robot that comes back to the world is what it was."""
        self._has_learned = False
        """Whether the others have been asked."""
        bus.watch_tokens([names.tokens_key(names.ALL_ROBOTS)], self._on_robot)

    def _on_robot(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        robot_id = None if token is None else names.robot_id_of(token[0])
        for each in () if robot_id is None or alive else self._served.get(robot_id, ()):
            each.renew()

    def match_robots(self, robots: Collection[int]) -> None:
        """These are in the world now. One that comes while all others are stopped is stopped too."""
        for gone in self._served.keys() - robots:
            for each in self._served.pop(gone):
                each.close()
        known = sorted(self._served)
        is_team_stopped = bool(known) and self.stopped == known
        for robot_id in sorted(robots - self._served.keys()):
            if is_team_stopped:
                self._stopped[robot_id] = True
                self._held.add(robot_id)
            elif self._has_learned:
                self._stopped.setdefault(robot_id, False)
            own = partial(self._stopped.get, robot_id), partial(self._change, robot_id)
            self._served[robot_id] = serve_stop(self._bus, robot_id, names.SIMULATOR, *own)

    @property
    def stopped(self) -> list[int]:
        """The robots in the world that are stopped."""
        return [robot_id for robot_id in sorted(self._served) if self._stopped.get(robot_id)]

    def _change(self, robot_id: int, stopped: bool) -> None:
        changed = stopped != self._stopped.get(robot_id, False)
        self._stopped[robot_id] = stopped
        if changed:
            self._on_change(robot_id, stopped)

    def note(self, robot_id: int, stopped: bool) -> None:
        """A query has stopped or released a robot in the run that is run again."""
        self._stopped[robot_id] = stopped

    def hold(self, robot_id: int, stopped: bool) -> None:
        """Hold a robot's body, or let it go. Main loop, or in real time any thread."""
        (self._held.add if stopped else self._held.discard)(robot_id)

    @property
    def held(self) -> list[int]:
        """The robots in the world whose bodies are held."""
        return [robot_id for robot_id in sorted(self._served) if robot_id in self._held]

    def learn(self) -> None:
        """At the start, when this process answers already: find out from the robots' processes which are stopped. A
        robot without one is stopped if all that have one are. It waits."""
        found = ask_stopped(self._bus, names.ALL_ROBOTS)
        told = {robot_id: reply.is_stopped for robot_id, reply in found if reply.by != names.SIMULATOR}
        team = bool(told) and all(told.values())
        for robot_id in self._served:
            self._stopped.setdefault(robot_id, told.get(robot_id, team))
        self._has_learned = True
        for robot_id in self.stopped:
            self._on_change(robot_id, True)
        if self.stopped:
            log.info("%s begin stopped, as they were: 'zteam stop --release'", format_robot_ids(self.stopped))
