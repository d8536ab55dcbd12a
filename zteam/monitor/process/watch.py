"""Feeds a team from the bus: statuses, the holders of the names, the link, and which processes command a robot."""

import logging
from collections.abc import Sequence

from zteam import names
from zteam.bus.graph import tell_rivals
from zteam.bus.transport import RawSample
from zteam.clock import FREEZES, Every, monotonic
from zteam.messages import RobotStatus
from zteam.messages.topics import has_one_writer
from zteam.monitor.process.members import WatchedTeam
from zteam.node.process_node import ProcessNode
from zteam.node.rivals import Writers
from zteam.node.tokens import TokenLossFilter, TokenSet
from zteam.simulator.client import SimStatus, find_status

log = logging.getLogger("zteam")

LOOK = 2.0
"""Host seconds between two looks."""
ASK_ALL = 10.0
"""Host seconds between two questions to all sessions what they publish."""
_UNANSWERED = 2
"""Questions without an answer until the simulator is said not to answer."""
_ANSWER_LIMIT = 0.5
"""Host seconds that a look waits for the simulator; the gate waits meanwhile."""


def _text(key: str, writers: Sequence[str]) -> str:
    """What is told of the robot of a key with these publishers; without any it has one again."""
    topic = key.partition("/")[2]
    if topic == names.CMD_VEL:
        by = f"{len(writers)} processes: {', '.join(writers)}" if writers else "one process again"
        text = f"is commanded by {by}"
    else:
        text = f"has {f'{len(writers)} publishers' if writers else 'one publisher again'} on {topic}"
        text += f": {', '.join(writers)}" if writers else ""
    return f"{text} (see 'zteam topic info {key}')" if writers else text


class WriterWatch:
    """Tells of robots that more than one process commands, or is the base of, and the team which robots the simulator
    has. The processes themselves are told too.

    The simulator tells which ones command: a subscription to all commands would slow down every tick of lock-step.
    Where there is no simulator, the watch subscribes to the commands itself. Of all other keys that have one publisher
    at a time, zteam's sessions say what they publish.
    """

    def __init__(self, node: ProcessNode, team: WatchedTeam) -> None:
        self._node = node
        self._team = team
        self.tokens = TokenSet()
        """Of all processes; the caller tells of them."""
        self._due = Every(LOOK)
        self._heard: Writers[int] | None = None
        self._told: dict[str, list[str]] = {}
        """By key: the sessions that publish on it, where there is more than one."""
        self._published: dict[str, list[str]] = {}
        """As of the last question to all sessions."""
        self._ask_all = Every(ASK_ALL)
        self._ask_all.due()
        self.sim: SimStatus | None = None
        """What the simulator answered last; None if it did not."""
        self.unanswered = 0
        """Questions to a simulator since its last answer."""

    def look(self) -> None:
        """Look once every LOOK seconds. Main loop only, without `node.changed`."""
        if not self._due.due():
            return
        commanding = self._ask() if names.SIMULATOR in self.tokens else self._listen()
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
            if each.publishes and has_one_writer(each.key) and not each.key.endswith(f"/{names.CMD_VEL}"):
                found.setdefault(each.key, set()).add(each.session)
        return {key: sorted(sessions) for key, sessions in found.items() if len(sessions) > 1}

    def _ask(self) -> dict[int, list[str]] | None:
        self.sim = status = find_status(self._node.bus, _ANSWER_LIMIT)
        if status is None:
            self.unanswered += 1
            return None
        self.unanswered = 0
        with self._node.changed:
            self._team.take_world(status.robots)
            self._team.take_tick(status.tick, monotonic())
        return status.writers

    def _listen(self) -> dict[int, list[str]] | None:
        clock = self._node.clock
        if not clock.decided or clock.simulated:
            return None
        if self._heard is None:
            self._heard = Writers[int]()
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
        texts = []
        for key, sessions in found.items():
            if self._told.get(key) != sessions:
                texts.append((key, _text(key, tell_rivals(self._node.bus, key, sessions))))
        texts += ((key, _text(key, ())) for key in self._told.keys() - found.keys())
        self._told = found
        with self._node.changed:
            for key, text in texts:
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

_HEARD = 4
"""Robots without a process that are heard as any other: one may be a process whose token does not come."""
_STRANGERS = 64
"""Further robots without a process whose newest status is kept: a status may come before the token of its robot."""
_STRANGE = 1.0
"""Host seconds after which a robot whose token has not come is told."""


class _Strangers:
    """Statuses of robots that no process holds and that the team does not expect: a sender can invent any number."""

    def __init__(self) -> None:
        self._heard: set[int] = set()
        self._newest: dict[int, RobotStatus] = {}
        self._ids: set[int] = set()
        self._told = 0
        self._since = 0.0

    def take(self, robot_id: int, status: RobotStatus, now: float) -> bool:
        """A status of a robot that is not known, at host time `now`; whether it is heard."""
        if len(self._heard) < _HEARD:
            self._heard.add(robot_id)
            return True
        self._since = self._since if self._ids else now
        self._ids.add(robot_id)
        if robot_id in self._newest or len(self._newest) < _STRANGERS:
            self._newest[robot_id] = status
        return False

    def admit(self, robot_id: int) -> RobotStatus | None:
        """The robot has a process now: what it has said."""
        self._ids.discard(robot_id)
        return self._newest.pop(robot_id, None)

    def news(self, now: float) -> str:
        """How many there are, in one line; empty if that was told or too little time has gone by."""
        if not self._ids or self._told or now - self._since < _STRANGE:
            return ""
        self._told, first = len(self._ids), min(self._ids)
        rest = f" and {self._told - 1} other robots have" if self._told > 1 else " has"
        return f"{names.robot_name(first)}{rest} a status but no process: the monitor leaves such robots out"


class TeamWatch:
    """Callbacks run under `node.changed`."""

    def __init__(self, node: ProcessNode, team: WatchedTeam) -> None:
        self._node = node
        self._team = team
        self._losses = TokenLossFilter()
        self._strangers = _Strangers()
        self._servers = TokenSet()
        self.servers_gone: dict[str, str] = {}
        """Those processes that were there and are gone, by name: what that means, in words."""
        self.link_up = True
        self._woke = FREEZES.look()
        self.simulator_came = False
        """Whether a simulator's token has come; set back by the caller that acts on it."""
        self.writers = WriterWatch(node, team)
        node.bus.watch_link(self._on_link)
        node.subscribe(names.all_robots_key(names.STATUS), RobotStatus, self._on_status)
        node.watch_tokens(names.tokens_key(), self._on_token)

    def _on_link(self, up: bool) -> None:
        with self._node.changed:
            self.link_up = up
            self._losses.take_link(up, monotonic())
            self._team.forgive_silence(monotonic())
            self._team.lose_data()
            what = "its link" if self._node.was_dropped else "router"
            self._team.tell("link", None, f"{what} is back" if up else f"{what} lost")
            self._node.changed.notify_all()

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is None:
            return
        name, instance = token
        self.writers.tokens.take(name, instance, alive)
        if name == names.SIMULATOR and alive:
            self.simulator_came = True
            self._team.take_simulator(instance)
        robot_id = names.robot_id_of(name)
        if robot_id is None and name not in _SERVERS:
            return
        self._losses.take_token(key, alive, monotonic())
        if alive:
            self._take(name, instance, True)

    def _take(self, name: str, instance: str, alive: bool) -> None:
        robot_id = names.robot_id_of(name)
        if robot_id is not None:
            self._team.take_token(robot_id, instance, alive)
            if alive and (status := self._strangers.admit(robot_id)) is not None:
                self._team.take_status(robot_id, status, monotonic())
        elif self._servers.take(name, instance, alive):
            what, meaning = _SERVERS[name]
            if name == names.SIMULATOR and not alive:
                self._team.take_world(None)
                self._team.lose_data()
            if not alive:
                self.servers_gone[name] = f"{what} is gone: {meaning}"
                self._team.tell("process", None, self.servers_gone[name])
            elif self.servers_gone.pop(name, ""):
                self._team.tell("process", None, f"{what} is back")

    def _on_status(self, key: str, status: RobotStatus) -> None:
        target = names.split_robot_key(key)
        is_strange = target is not None and status.robot_id == target[0] and target[0] not in self._team.members
        if is_strange and not self._strangers.take(status.robot_id, status, monotonic()):
            return
        if target is None or not self._team.take_status(target[0], status, monotonic()):
            self._node.bus.counters.drop(key, f"it speaks for robot {status.robot_id}")

    def look(self) -> None:
        """Look at what commands the robots, and take what has been gone for long enough to be lost."""
        self.writers.look()
        self._find_mute()
        before, self._woke = self._woke, FREEZES.look()
        with self._node.changed:
            is_silent = self._losses.trusted(monotonic()) and self._team.has_silent(monotonic())
        # It may be this process that hears nothing.
        is_deaf = self._woke > before or (is_silent and not self._node.reaches_others())
        with self._node.changed:
            if is_deaf:
                self._team.forgive_silence(monotonic())
            self._take_losses(monotonic())

    def _find_mute(self) -> None:
        """A process that has not published a status hangs, unless it answers that it has no publisher of one."""
        with self._node.changed:
            quiet = self._team.never_heard(monotonic()) if self._losses.trusted(monotonic()) else []
        if not quiet:
            return
        declarations = self._node.bus.declarations()
        with self._node.changed:
            for robot_id in quiet:
                sessions = self.writers.tokens.instances(names.robot_name(robot_id))
                own = [each for each in declarations if each.session in sessions]
                key = names.robot_key(robot_id, names.STATUS)
                self._team.members[robot_id].mute = bool(own) and not any(each.key == key for each in own)

    def _take_losses(self, now: float) -> None:
        for key in self._losses.take_due(now):
            token = names.split_token_key(key)
            if token:
                self._take(*token, False)
        if news := self._strangers.news(now):
            self._team.tell("strangers", None, news)
        if self._losses.trusted(now):
            self._team.check_silence(now)
            self._team.check_leaders(now)

    def notes(self) -> list[str]:
        """What is wrong besides the robots, in words (under `node.changed`)."""
        found = [] if self.link_up else ["the router is lost: nothing can be heard"]
        found += self.servers_gone.values()
        found += (each.text for each in self._team.follow_problems)
        found += self.writers.notes()
        if why := self._why_time_stands():
            found.append(why)
        if names.AGGREGATOR not in self._servers and names.AGGREGATOR not in self.servers_gone:
            found.append("no aggregator yet (zteam-tf): poses are not known")
        return found

    def _why_time_stands(self) -> str:
        """What a simulator that is there says of that, or that it does not answer."""
        if names.SIMULATOR not in self._servers or not self.link_up:
            return ""
        sim = self.writers.sim
        if sim is None:
            return "the simulator does not answer" if self.writers.unanswered >= _UNANSWERED else ""
        if sim.finished or sim.paused:
            return f"time stands still: {'the run is over' if sim.finished else 'the simulator is paused'}"
        held = self._team.gone and sim.lockstep and not self._team.ticks(monotonic()) and sim.waiting_for
        return f"time stands still: lock-step waits for {sim.waiting_for}" if held else ""
