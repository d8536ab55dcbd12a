"""Feeds a team from the bus: statuses, the holders of the names, the link, and which processes command a robot."""

from collections.abc import Callable
from typing import Any

from zteam import names
from zteam.bus.graph import name_publishers
from zteam.bus.transport import RawSample
from zteam.clock import FREEZES, Every, monotonic
from zteam.messages import RobotStatus
from zteam.messages.topics import has_one_writer
from zteam.monitor.observer import LINK, PRESENCE, RobotView, TeamObserver
from zteam.monitor.process.start_gate import Gate
from zteam.node.process_node import ProcessNode
from zteam.node.tokens import TokenLossFilter, Writers
from zteam.simulator.client import SimStatus, find_status

LOOK = 2.0
"""Host seconds between two looks."""
ASK_ALL = 10.0
"""Host seconds between two questions to all sessions what they publish."""
_UNANSWERED = 2
"""Questions without an answer until the simulator is said not to answer."""
_ANSWER_LIMIT = 0.5
"""Host seconds that a look waits for the simulator; the gate waits meanwhile."""


class WriterWatch:
    """Tells of robots that more than one process commands, or is the base of, and the team which robots the simulator
    has.

    The simulator reports which ones command: a subscription to all commands would slow down every tick of lock-step.
    Where there is no simulator, the watch subscribes to the commands itself. Of all keys that have one publisher at a
    time, zteam's sessions report what they publish.
    """

    def __init__(self, node: ProcessNode, team: Gate, seen: TeamObserver) -> None:
        self._node, self._team, self._seen = node, team, seen
        self._due, self._ask_all = Every(LOOK), Every(ASK_ALL, after=ASK_ALL)
        self._told: dict[str, list[str]] = {}
        """By key: the sessions that publish on it, where there is more than one."""
        self._published: dict[str, list[str]] = {}
        """As of the last question to all sessions."""
        self._heard: Writers | None = None
        """Of commands, where there is no simulator."""
        self.sim: SimStatus | None = None
        """What the simulator answered last; None if it did not."""
        self.unanswered = 0
        """Questions to a simulator since its last answer."""

    def look(self) -> None:
        """Look once every LOOK seconds. Main loop only, without `node.changed`."""
        if not self._due.due():
            return
        commanding = self._ask() if self._seen.alive(names.SIMULATOR) else self._listen()
        if self._ask_all.due():
            self._published = self._find_publishers()
        if commanding is not None:
            found = {names.robot_key(i, names.CMD_VEL): sessions for i, sessions in commanding.items()}
            self._tell({**self._published, **found})

    def _find_publishers(self) -> dict[str, list[str]]:
        """The sessions that publish on each key that has one publisher, where there are more."""
        found: dict[str, set[str]] = {}
        for each in self._node.bus.declarations():
            # On cmd_vel the simulator publishes what a robot answers in lock-step.
            is_answer = each.key.endswith(f"/{names.CMD_VEL}") and self._seen.alive(names.SIMULATOR)
            if each.publishes and has_one_writer(each.key) and not is_answer:
                found.setdefault(each.key, set()).add(each.session)
        return {key: sorted(sessions) for key, sessions in found.items() if len(sessions) > 1}

    def _ask(self) -> dict[int, list[str]] | None:
        self.sim = status = find_status(self._node.bus, _ANSWER_LIMIT)
        if status is None:
            self.unanswered += 1
            return None
        self.unanswered = 0
        with self._node.changed:
            self._team.on_world(status.robots)
            self._team.on_tick(status.tick, monotonic())
        return status.writers

    def _listen(self) -> dict[int, list[str]]:
        clock = self._node.clock
        if not clock.decided or clock.simulated:
            return {}
        if self._heard is None:
            self._heard = Writers()
            self._node.bus.subscribe_raw(names.all_robots_key(names.CMD_VEL), self._on_command)
        with self._node.changed:
            heard = self._heard.recent(monotonic())
        return {robot_id: sorted(sessions) for robot_id, sessions in heard.items() if len(sessions) > 1}

    def _on_command(self, sample: RawSample) -> None:
        target = names.split_robot_key(sample.key)
        if target is not None and self._heard is not None:
            with self._node.changed:
                self._heard.take(target[0], sample.source, monotonic())

    def _tell(self, found: dict[str, list[str]]) -> None:
        texts = {}
        for key in sorted({*found, *self._told}):
            topic, sessions = key.partition("/")[2], found.get(key, [])
            if not sessions:
                texts[key] = f"has one publisher again on {topic}"
            elif self._told.get(key) != sessions:
                told = name_publishers(self._node.bus, key, sessions)
                texts[key] = f"has {len(told)} publishers on {topic}: {', '.join(told)} (see 'zteam topic info {key}')"
        self._told = found
        with self._node.changed:
            for key, text in texts.items():
                self._team.tell("writers", names.robot_id_of(key.partition("/")[0]), text)

    def notes(self) -> list[str]:
        """The keys on which several publish, in words."""
        return [f"{key} has {len(sessions)} publishers" for key, sessions in sorted(self._told.items())]


_SERVERS = {
    names.SIMULATOR: ("the simulator", "time stands still"),
    names.AGGREGATOR: ("the aggregator", "there are no new transforms"),
    names.MONITOR: ("the monitor", "GO is not given to robots that come now"),
}
"""Processes that a team needs besides its robots: what they are called, and what it means that one is gone."""


class TeamWatch:
    """Passes what the bus shows of a team on to `team`. Callbacks run under `node.changed`.

    A robot becomes a member with its process: a sender can invent any number of statuses. One may come before its
    presence token.
    """

    def __init__(self, node: ProcessNode, team: Gate) -> None:
        self._node, self._team = node, team
        self._seen = TeamObserver(node.bus)
        self._losses = TokenLossFilter()
        self.servers_gone: dict[str, str] = {}
        """Those processes that were there and are gone, by name: what that means, in words."""
        self._woke = FREEZES.look()
        self.simulator_came = False
        """Whether a simulator's token has come; set back by the caller that acts on it."""
        self.writers = WriterWatch(node, team, self._seen)
        self.on(LINK, self._on_link)
        self.on(PRESENCE, self._on_presence)
        self.on(names.STATUS, self._on_status)
        with node.changed:
            # Their tokens may have come before the handler was there.
            for name in self._seen.process_names():
                self._on_presence(name, True)

    def on(self, event: str, handler: Callable[[Any, Any], None]) -> None:
        """Observe an event or a topic: `handler(source, news)` is called under `node.changed`."""

        def handle(source: object, news: object) -> None:
            with self._node.changed:
                handler(source, news)
                self._node.changed.look()

        self._seen.on(event, handle)
        self._seen.observe(event)

    def _on_link(self, _source: str, up: bool) -> None:
        self._losses.on_link(up, monotonic())
        self._team.forgive_silence(monotonic())
        what = "its link" if self._node.was_dropped else "router"
        self._team.tell("link", None, f"{what} is back" if up else f"{what} lost")

    def _on_presence(self, name: str, _alive: bool) -> None:
        # One of several holders of the name may have gone.
        alive = self._seen.alive(name)
        if name == names.SIMULATOR and alive:
            self.simulator_came = True
            self._team.on_simulator(self._seen.instances(name))
        if name in _SERVERS or names.robot_id_of(name) is not None:
            self._losses.on_token(name, alive, monotonic())
            if alive:
                self._take(name, True)

    def _take(self, name: str, alive: bool) -> None:
        """A process has come, or is gone for good."""
        robot_id = names.robot_id_of(name)
        if robot_id is not None:
            is_new = robot_id not in self._team.members
            self._team.on_token(robot_id, alive)
            if is_new and (status := self._seen.robot(robot_id).status):
                self._on_status(self._seen.robot(robot_id), status)
        elif not alive:
            self.servers_gone[name] = "{} is gone: {}".format(*_SERVERS[name])
            self._team.tell("process", None, self.servers_gone[name])
            if name == names.SIMULATOR:
                self._team.on_world(None)
        elif self.servers_gone.pop(name, ""):
            self._team.tell("process", None, f"{_SERVERS[name][0]} is back")

    def _on_status(self, robot: RobotView, status: RobotStatus) -> None:
        if status.robot_id != robot.id:
            key = names.robot_key(robot.id, names.STATUS)
            self._node.bus.counters.drop(key, f"it speaks for robot {status.robot_id}")
        elif robot.id in self._team.members:
            self._team.on_status(robot.id, status, monotonic())

    def look(self) -> None:
        """Look at what commands the robots, and take what has been gone for long enough to be lost."""
        self.writers.look()
        before, self._woke = self._woke, FREEZES.look()
        with self._node.changed:
            is_silent = self._losses.trusted(monotonic()) and self._team.has_silent(monotonic())
        # It may be this process that hears nothing.
        is_deaf = self._woke > before or (is_silent and not self._node.reaches_others())
        with self._node.changed:
            now = monotonic()
            if is_deaf:
                self._team.forgive_silence(now)
            for name in self._losses.take_due(now):
                self._take(name, False)
            if self._losses.trusted(now):
                self._team.check_silence(now)
                self._team.check_leaders(now)

    def notes(self) -> list[str]:
        """What is wrong besides the robots, in words (under `node.changed`)."""
        found = [] if self._seen.link_up else ["the router is lost: nothing can be heard"]
        found += self.servers_gone.values()
        found += (each.text for each in self._team.follow_problems)
        found += self.writers.notes()
        if why := self._why_time_stands():
            found.append(why)
        if names.AGGREGATOR not in self._seen.were_there:
            found.append("no aggregator yet (zteam-tf): poses are not known")
        return found

    def _why_time_stands(self) -> str:
        """What a simulator that is there says of that, or that it does not answer."""
        is_there = names.SIMULATOR in self._seen.were_there and names.SIMULATOR not in self.servers_gone
        if not is_there or not self._seen.link_up:
            return ""
        sim = self.writers.sim
        if sim is None:
            return "the simulator does not answer" if self.writers.unanswered >= _UNANSWERED else ""
        if sim.finished or sim.paused:
            return f"time stands still: {'the run is over' if sim.finished else 'the simulator is paused'}"
        held = self._team.gone and sim.lockstep and not self._team.ticks(monotonic()) and sim.waiting_for
        return f"time stands still: lock-step waits for {sim.waiting_for}" if held else ""
