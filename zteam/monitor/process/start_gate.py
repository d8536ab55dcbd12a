"""The start gate's logic, without a bus: the robots that it knows, which are ready, and whether the team may go.

The monitor feeds it with tokens and statuses and publishes what `status` returns. GO is given once and never taken
back; a monitor that starts in the middle of a run adopts the GO that the robots obey.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from zteam import names
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import short
from zteam.messages import Header, RobotState, RobotStatus, TeamState, TeamStatus, time_from_ns
from zteam.monitor.followers import FollowProblem, follow_problems
from zteam.simulator.client import absence_text

SILENT_AFTER = 3.0
"""Host seconds without a status (they come at 1 Hz) after which a robot with a living token does not answer. One whose
time stood still for as long gets no data."""
_WHILE = 10.0
"""Host seconds within which events of one kind are counted."""
_MOST_EVENTS = 8
"""Of one kind and robot that are shown within a while."""
_MOST_OF_STRANGERS = 16
"""As many of all robots that do not count."""


class Event(NamedTuple):
    """Something to tell: `robot` is None for the team as a whole."""

    kind: str
    robot: int | None
    text: str

    @property
    def sentence(self) -> str:
        return self.text if self.robot is None else f"{names.robot_name(self.robot)} {self.text}"


class EventLimit:
    """Which events are shown. Any process can make events, with forged statuses and names of robots that it invents.

    Of one kind and robot a few are shown within a while. Robots that do not count share theirs.
    """

    def __init__(self) -> None:
        self._made = Counter[tuple[str, int | None]]()
        """By kind and robot, within the while that ends at host time `_until`."""
        self._until = 0.0

    def admit(self, event: Event, counts: bool, now: float) -> Event | None:
        """The event as it is shown at host time `now`; None if it is left out. One without a robot `counts`."""
        key, most = (event.kind, event.robot if counts else -1), _MOST_EVENTS if counts else _MOST_OF_STRANGERS
        if now >= self._until:
            self._made.clear()
            self._until = now + _WHILE
        self._made[key] += 1
        if self._made[key] == most:
            return event._replace(text=f"{event.text} (further lines of this kind are left out for {_WHILE:g} s)")
        return event if self._made[key] < most else None


class KnownRobot(msgspec.Struct):
    alive: bool = False
    """Whether a process holds the robot's name."""
    status: RobotStatus | None = None
    heard: float = 0.0
    """Host time of the last status."""
    moved: float = 0.0
    """Host time of the last status with another stamp than the one before."""
    was_ready: bool = False
    was_lost: bool = False
    told_go: bool = False
    came_late: bool = False
    """Whether its process came after GO."""
    silent: bool = False
    stopped: bool = False
    """Whether it said that it stops before it went."""
    absence: str = ""
    """That the world lacks it, in words; empty while nothing is known of that."""

    @property
    def ready(self) -> bool:
        """Whether it lives, answers and says it is ready."""
        return self.alive and not self.silent and self.status is not None and self.status.is_ready

    @property
    def why_not_ready(self) -> str:
        if self.absence:
            return self.absence
        if not self.alive:
            return "its process is gone" if self.was_lost else "no process yet"
        if self.silent:
            return "does not answer"
        if self.status is None:
            return "no status yet"
        text = short(self.status.text) or "not ready yet"
        return f"fault: {text}" if self.status.state == RobotState.FAULT else text

    def falls_silent(self, now: float) -> bool:
        """Whether it lives and sends no further status."""
        return self.status is not None and self.alive and not self.silent and now - self.heard > SILENT_AFTER


_SETTLED = 1.0
"""Host seconds until all processes and statuses that are there are known."""
_NAMED = 8
"""Robots that the text of what GO waits for names at most."""
_LAST_EPOCH = 2**32 - 1
"""On the wire; a robot may tell any epoch, and the newest one that a robot obeys is taken over."""
_MOST_LOST = 64
"""Robots that do not count and are gone are remembered up to this number."""


class Gate:
    """The team as the monitor knows it, and the events to tell. The caller holds a lock."""

    def __init__(self, expected: Iterable[int] | None, team_size: int) -> None:
        self.members: dict[int, KnownRobot] = {}
        """All robots that had a process or are waited for, by id."""
        self.events: list[Event] = []
        self._tick = -1
        """Of the simulator, when it was asked last."""
        self._ticked = 0.0
        """Host time at which the simulator was last seen at another tick."""
        self.gone = False
        """Whether GO is out."""
        self.epoch = 0
        """Of the standing GO."""
        self.expected: list[int] | None = None
        """The ids to wait for; None = any `team_size` robots."""
        self.team_size = team_size
        self.go_stamp = 0
        """Simulated time (ns) from which GO holds."""
        self.follow_problems: list[FollowProblem] = []
        """Robots that cannot follow, as of the last look."""
        self._cannot_follow: dict[FollowProblem, float] = {}
        """The host time at which each was found."""
        self._simulators = frozenset[str]()
        """The sessions of the newest simulator; empty before the first."""
        self._adopted = False
        """Whether another monitor gave the GO that stands."""
        if expected is not None:
            self.expect(expected)

    @property
    def ready(self) -> list[int]:
        """Ids of the robots that are ready and live."""
        return sorted(i for i, m in self.members.items() if m.ready and self.counts(i))

    @property
    def missing(self) -> list[int]:
        """Expected ids that are not ready."""
        return [] if self.expected is None else [i for i in self.expected if not self.get(i).ready]

    def get(self, robot_id: int) -> KnownRobot:
        """The robot's member, which is made at its first mention."""
        return self.members.setdefault(robot_id, KnownRobot())

    def tell(self, kind: str, robot: int | None, text: str) -> None:
        self.events.append(Event(kind, robot, short(text)))

    def take_events(self) -> list[Event]:
        events, self.events = self.events, []
        return events

    @property
    def lost(self) -> list[int]:
        """Ids of robots that were there and are gone."""
        return sorted(i for i, member in self.members.items() if member.was_lost)

    def counts(self, robot_id: int) -> bool:
        """Whether GO waits for this robot, or has."""
        return self.expected is None or robot_id in self.expected

    def expect(self, ids: Iterable[int]) -> None:
        self.expected = sorted(set(ids))
        self.team_size = len(self.expected)
        for robot_id in self.expected:
            self.get(robot_id)
        for robot_id in sorted(i for i, member in self.members.items() if member.alive):
            self._tell_unexpected(robot_id)

    def _tell_unexpected(self, robot_id: int) -> None:
        if self.expected is not None and robot_id not in self.expected and not self.gone:
            text = f"is not expected: GO waits for {format_robot_ids(self.expected)} only; it obeys that GO too"
            self.tell("unexpected", robot_id, text)

    def on_world(self, robots: Sequence[int] | None) -> None:
        """The simulator has these robots; None if there is no simulator."""
        for robot_id, member in self.members.items():
            member.absence = "" if robots is None or robot_id in robots else absence_text(robot_id, robots)

    def on_simulator(self, sessions: frozenset[str]) -> None:
        """The simulator is there, in these sessions. Another one than before begins another world, under the GO that
        stands, which gets the next epoch."""
        if self.gone and self._simulators and not sessions <= self._simulators:
            self._next_epoch()
            self.tell("anew", None, f"the world begins anew in another simulator (epoch {self.epoch})")
        self._simulators = sessions

    def on_tick(self, tick: int, now: float) -> None:
        """The simulator is at this tick at host time `now`. Where time goes on, its robots get data."""
        if tick != self._tick:
            self._tick, self._ticked = tick, now

    def ticks(self, now: float) -> bool:
        """Whether the simulator was seen at another tick of late."""
        return now - self._ticked <= SILENT_AFTER

    def on_token(self, robot_id: int, alive: bool) -> None:
        """A process took the name `robot_N`, or its last holder lost it."""
        member = self.get(robot_id)
        if member.alive == alive:
            return
        member.alive = alive
        if not alive:
            self._lose(robot_id, member)
            return
        member.came_late = self.gone
        if member.was_lost:
            member.was_lost = member.told_go = False
            self.tell("back", robot_id, "is back")
        self._adopt(robot_id, member)
        self._tell_unexpected(robot_id)

    def _lose(self, robot_id: int, member: KnownRobot) -> None:
        if member.status is None and not self.counts(robot_id):
            # A tool held the name for a moment, such as a teleop of a robot that the world lacks.
            del self.members[robot_id]
            return
        member.stopped = member.status is not None and member.status.state == RobotState.STOPPED
        # A process that comes later under this name speaks for itself.
        member.status = None
        member.was_ready = member.silent = False
        member.was_lost = True
        kind = "stopped" if member.stopped else "lost"
        self.tell(kind, robot_id, kind)
        if not self.counts(robot_id) and sum(not self.counts(i) for i in self.lost) > _MOST_LOST:
            del self.members[robot_id]

    def on_status(self, robot_id: int, status: RobotStatus, now: float) -> None:
        """A robot's status, heard at host time `now`."""
        member = self.get(robot_id)
        before, member.status, member.heard = member.status, status, now
        if before is None or before.header.stamp != status.header.stamp:
            member.moved = now
        if member.silent:
            member.silent = False
            self.tell("answers", robot_id, "answers again")
        if status.state == RobotState.FAULT and (before is None or before.state != RobotState.FAULT):
            self.tell("fault", robot_id, f"fault: {status.text}")
        self._adopt(robot_id, member)
        if self.gone:
            self._tell_late(robot_id, member)
        elif member.ready and not member.was_ready:
            member.was_ready = True
            done, awaited = f"{len(self.ready)} of {self.team_size}", self.waiting_for(reasons=False)
            self.tell("ready", robot_id, f"ready ({done}; waiting for {awaited})" if awaited else f"ready ({done})")
        elif not member.ready:
            member.was_ready = False

    def forgive_silence(self, now: float) -> None:
        """Nothing could be heard until `now`: silence counts from here on."""
        for member in self.members.values():
            member.heard = now

    def has_silent(self, now: float) -> bool:
        """Whether `check_silence` has something to tell."""
        return any(member.falls_silent(now) for member in self.members.values())

    def check_silence(self, now: float) -> None:
        """Tell of robots that live and send no further status."""
        for robot_id, member in self.members.items():
            if member.falls_silent(now):
                member.silent, member.was_ready = True, False
                self.tell("silent", robot_id, f"does not answer for {now - member.heard:.0f} s")

    def _adopt(self, robot_id: int, member: KnownRobot) -> None:
        """The newest GO that a robot of this team obeys is the team's."""
        status = member.status
        if status is None or not member.alive or status.state != RobotState.RUNNING:
            return
        if status.epoch <= self.epoch or not self.counts(robot_id):
            return
        self.epoch = status.epoch
        if not self.gone:
            self.gone = self._adopted = True
            self.tell("adopted", None, f"the team is running already (epoch {self.epoch})")

    def _tell_late(self, robot_id: int, member: KnownRobot) -> None:
        if not member.ready or member.told_go or member.status is None:
            return
        member.told_go = True
        # A robot that comes late may obey the latched GO before its first status. One that obeys a GO that this monitor
        # has not given may have been there before the monitor.
        if member.status.epoch < self.epoch or (member.came_late and not self._adopted):
            self.tell("late", robot_id, "is ready late: told GO")

    def try_go(self, stamp: int) -> bool:
        """Give GO from simulated time `stamp` (ns) on if all robots are ready; True when that happened now."""
        if self.gone or self.missing or len(self.ready) < self.team_size:
            return False
        self.check_leaders(0.0, at_once=True)
        self._next_epoch()
        self.gone, self.go_stamp = True, stamp
        for member in self.members.values():
            member.told_go = member.ready
        self.tell("go", None, "All robots GO!")
        return True

    def _next_epoch(self) -> None:
        self.epoch = min(self.epoch + 1, _LAST_EPOCH)

    def renew(self, stamp: int) -> None:
        """Time went back: the standing GO holds from `stamp` on."""
        if self.gone:
            self.go_stamp = stamp

    def waiting_for(self, *, reasons: bool = True) -> str:
        """What GO waits for, in words: each missing robot, with the reason. Empty when all are ready."""
        unready, unknown = self.unready(), self.unknown()
        parts = [f"{unknown} more of any id"] if unknown else []
        for robot_id in unready[:_NAMED]:
            reason = f": {self.get(robot_id).why_not_ready}" if reasons else ""
            parts.append(f"{names.robot_name(robot_id)}{reason}")
        if len(unready) > _NAMED:
            parts.append(f"and {len(unready) - _NAMED} more robots")
        return ("; " if reasons else ", ").join(parts)

    def unready(self) -> list[int]:
        """Ids of the known robots that GO waits for."""
        if self.expected is not None:
            return self.missing
        if len(self.ready) >= self.team_size:
            return []
        return sorted(i for i, member in self.members.items() if member.alive and not member.ready)

    def unknown(self) -> int:
        """How many further robots GO waits for, whatever their ids are."""
        return 0 if self.expected is not None else max(0, self.team_size - len(self.ready) - len(self.unready()))

    def all_running(self) -> bool:
        """Whether every robot that counts obeys the standing GO, or is gone."""
        there = [member for i, member in self.members.items() if member.alive and self.counts(i)]
        return self.gone and all(m.status is not None and m.status.epoch >= self.epoch for m in there)

    def check_leaders(self, now: float, *, at_once: bool = False) -> None:
        """Report robots that cannot follow: `at_once`, or when that holds for a while, as names come one by one."""
        leaders = {i: m.status.leader for i, m in self.members.items() if m.alive and m.status and m.status.leader >= 0}
        found = list(follow_problems(leaders, self._may_lead))
        self._cannot_follow = {each: self._cannot_follow.get(each, now) for each in found}
        for each in found:
            if each not in self.follow_problems and (at_once or now - self._cannot_follow[each] >= _SETTLED):
                self.follow_problems.append(each)
                self.tell("follow", None, each.text)
        self.follow_problems = [each for each in self.follow_problems if each in self._cannot_follow]

    def _may_lead(self, robot_id: int) -> bool:
        """Whether a robot is there, is still to come, or was lost, which is reported as a loss."""
        if not self.gone and (robot_id in self.unready() or self.unknown()):
            return True
        member = self.members.get(robot_id)
        return member is not None and (member.alive or member.was_lost)

    def status(self, stamp: int) -> TeamStatus:
        """What to publish, at time `stamp` (ns)."""
        return TeamStatus(
            header=Header(time_from_ns(stamp), names.MONITOR),
            state=TeamState.GO if self.gone else TeamState.WAITING,
            epoch=self.epoch,
            go_stamp=time_from_ns(self.go_stamp),
            team_size=self.team_size,
            ready=np.array(self.ready, np.int32),
            missing=np.array(self.missing, np.int32),
            lost=np.array(self.lost, np.int32),
            waiting_for="" if self.gone else self.waiting_for(),
        )


_OF_THE_MONITOR = frozenset({"ready", "late", "unexpected"})
"""Kinds of events that the running monitor tells: in a second one they would come twice."""


class FollowedTeam(Gate):
    """The gate of a running monitor, which decides which robots GO waits for, and when it is out. The robots and their
    processes are observed directly."""

    def __init__(self) -> None:
        super().__init__(None, 0)
        self.newest: TeamStatus | None = None
        """What the running monitor said last."""

    def on_team(self, status: TeamStatus) -> None:
        before, self.newest = self.newest, status
        self.gone, self.epoch, self.team_size = status.state == TeamState.GO, status.epoch, status.team_size
        ids = sorted({*status.ready.tolist(), *status.missing.tolist()})
        self.expected = ids if self.gone or status.missing.size else None
        for robot_id in ids:
            self.get(robot_id)
        ready = f"{status.ready.size} of {status.team_size} ready"
        if not self.gone:
            self.tell("status", None, f"{ready}; waiting for {status.waiting_for or self.waiting_for()}")
        elif before is not None and before.state != TeamState.GO:
            self.tell("go", None, "All robots GO!")
        else:
            self.tell("status", None, f"GO is out; {ready}")

    def tell(self, kind: str, robot: int | None, text: str) -> None:
        if kind not in _OF_THE_MONITOR:
            super().tell(kind, robot, text)

    def _adopt(self, robot_id: int, member: KnownRobot) -> None:
        """The running monitor reports GO."""

    def on_simulator(self, sessions: frozenset[str]) -> None:
        """The running monitor reports the epoch."""

    def waiting_for(self, *, reasons: bool = True) -> str:
        return super().waiting_for(reasons=reasons) or "the running monitor"
