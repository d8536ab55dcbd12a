"""The open tick of lock-step: its participants, their answers, and the rules by which it ends. Pure: no bus, no time.

A process joins when it answers any tick. The simulator waits for it from the next tick that is opened. A process leaves
with its last presence token, or when it is dropped because it does not answer. The first tick is held until all
expected processes take part in it and, with the gate, until the monitor has given GO.
"""

from collections.abc import Container, Iterable, Mapping
from enum import Enum, auto

import msgspec
import numpy as np

from zteam import names
from zteam.messages import Done, Input, Tick, Twist, time_from_ns
from zteam.node.tokens import TokenSet
from zteam.simulator.recorded_ticks import RecordedTick

_NOTHING: list[Input] = []
_NOBODY: list[str] = []
"""In ticks, which are not changed."""


class Start(Enum):
    """How far the first tick is. Each state is followed by the next one, and no other tick begins before the last."""

    HELD = auto()
    """It waits for the expected processes, and with a gate for GO."""
    COMPLETE = auto()
    """It was sent with all of them: one that ends after that is not waited for."""
    OVER = auto()
    """It has ended, or its silent participants were dropped."""


class OpenTick:
    """The tick that the participants are to answer, and the rules by which it ends. Names are process names: `robot_1`,
    `tf`, … One that is dropped lives, so an answer that it gave still counts."""

    def __init__(self, expected: Iterable[str] = (), *, gate: bool = True) -> None:
        """The first tick is held until all `expected` processes take part and, with `gate`, until GO."""
        self._expected = frozenset(expected)
        self._gate = gate
        self.members: list[str] = []
        """Participants, sorted. The list is replaced, not changed: ticks that were sent hold it."""
        self.joining: set[str] = set()
        """Processes that have answered and become participants with the next tick."""
        self._sessions: list[str] = []
        self._sessions_of: list[str] | None = None
        """The sessions of these members, as they were at the last tick; None after a token has come or gone."""
        self.joined: list[str] = []
        """Those of them that the tick is the first one for."""
        self.answers: dict[str, Done] = {}
        """By participant."""
        self.left: set[str] = set()
        """Participants that have ended since the tick was opened. What they answered does not count: whether their
        answer or their end comes first is chance."""
        self.holders = TokenSet()
        self._is_between = False
        """Whether the commands of the tick are taken and the next one is not sent: what ends now ends in that."""
        self._late: list[tuple[str, str, bool]] = []
        """Tokens that have come or gone meanwhile, which wait for that."""
        self._gone: set[tuple[str, str]] = set()
        """Names and sessions of participants that have left with their last token."""
        self._start = Start.HELD
        self.out: frozenset[str] = frozenset()
        """Processes that a fault on purpose keeps out of the tick. They join when it is over."""
        self.given_up: set[str] = set()
        """Processes that did not come as they did in the run that is run again: no tick waits for them any more."""
        self.recorded: RecordedTick | None = None
        """What the tick was in the run that is run again: the same processes join, and leave, in it."""
        self._go_epoch = 0
        self._changed = False
        """Whether a token, a joining process or GO came since the tick was opened."""
        self.hung: list[str] = []
        """Participants that were left behind so far, for their silence or their lease."""
        self.message = Tick()
        """The tick as it was sent last, which is not changed any more; number 0 before the first one."""

    def defers(self, name: str, session: str, alive: bool) -> bool:
        """Whether a token has to wait until the next tick is sent, which `go_on` tells."""
        waits = self._is_between and (not alive or any(name == late for late, *_ in self._late))
        if waits:
            self._late.append((name, session, alive))
        return waits

    def on_token(self, name: str, session: str, alive: bool) -> bool:
        """The presence token of `session` for `name` came or went. True if the tick has to be sent again for that."""
        self.holders.take(name, session, alive)
        self._sessions_of = None
        if name not in self.holders:
            if name in self.members:
                self.left.add(name)
                self.answers.pop(name, None)
                self._gone.add((name, session))
            self._drop(name)
        self._changed = True
        # A new process joins by answering a tick, and the next one may be far away. The other participants must learn
        # that the process that left is not to be waited for.
        return self.message.tick > 0 and (alive or name in self.message.participants)

    def take_commands(self, robots: Container[int]) -> dict[int, Twist]:
        """The `commands`, which hold: until the next tick is sent no process ends."""
        self._is_between = True
        return self.commands(robots)

    def go_on(self) -> list[tuple[str, str, bool]]:
        """The next tick is sent; the tokens that have waited for it."""
        late, self._late, self._is_between = self._late, [], False
        return late

    def note_return(self, name: str, session: str) -> bool:
        """A token has come. True, once, if it is that of a participant that had left: frozen or without a link. A
        process that has ended comes back with another session."""
        back = (name, session) in self._gone and not self.held
        self._gone.discard((name, session))
        self.hung += [name] if back else []
        return back

    def on_done(self, name: str, session: str, done: Done) -> bool:
        """Take an answer. False if its session does not hold `name`: the answer is ignored."""
        if session not in self.holders.get(name, ()):
            return False
        if name not in self.members:
            self._changed = self._changed or name not in self.joining
            self.joining.add(name)
        elif (done.epoch, done.tick) == (self.message.epoch, self.message.tick):
            self.answers[name] = done
            self.left.discard(name)
        return True

    def on_go(self, epoch: int) -> None:
        """The monitor gave GO; the highest epoch counts."""
        self._go_epoch = max(self._go_epoch, epoch)
        self._changed = True

    def on_latched(self) -> None:
        """A latched input has come: a held tick is opened again to carry it."""
        self._changed = True

    def open(self, stamp: int, tick: int, robots: list[int], out: frozenset[str] = frozenset()) -> Tick:
        """Open tick `tick` at simulated time `stamp` (ns), with these robots in the world, and without `out`."""
        self.out = out
        return self._begin(Tick(time_from_ns(stamp), 0, tick, np.array(robots, np.int32)))

    def reopen(self) -> Tick:
        """Open the held tick again, because processes joined or left or GO came. It keeps its answers without GO."""
        return self._begin(self.message)

    def carry(self, inputs: list[Input]) -> None:
        """The open tick carries these inputs from outside."""
        self.message = msgspec.structs.replace(self.message, inputs=inputs)

    def count_sent(self, sent: int) -> None:
        """The simulator has published so many messages since it sent the tick before."""
        self.message = msgspec.structs.replace(self.message, sent=sent)

    def _begin(self, tick: Tick) -> Tick:
        self.joined = _NOBODY
        # A held tick admits no process and carries no GO until all can: an answer that was given with half the team
        # present would depend on the order in which the processes came, and all are to hear GO in the same tick.
        if self._start is not Start.HELD or not self.absent:
            tick = msgspec.structs.replace(tick, epoch=self._go_epoch)
            if self.joining or self.out:
                early = set[str]() if self.recorded is None else self.joining - self.recorded.members
                present = {*self.members, *self.joining} - early
                self.joined = sorted(present - self.out - {*self.members})
                self.members, self.joining = sorted(present - self.out), (present & self.out) | early
        if self._sessions_of is not self.members:
            self._sessions_of = self.members
            self._sessions = sorted({session for name in self.members for session in self.holders.get(name, ())})
        tick = msgspec.structs.replace(tick, sessions=self._sessions, inputs=_NOTHING)
        if (tick.epoch, tick.tick) != (self.message.epoch, self.message.tick):
            self.start_anew()
        self.message = tick
        has_all = (tick.epoch > 0 or not self._gate) and not self._expected.difference(self.members)
        if self._start is Start.HELD and has_all:
            self._start = Start.COMPLETE
        self._changed = False
        return self.refreshed()

    def refreshed(self) -> Tick:
        """The open tick with its current participants."""
        self.message = msgspec.structs.replace(self.message, participants=self.members)
        return self.message

    def start_anew(self) -> None:
        """The world returns to its start, or another tick is opened: earlier answers no longer count."""
        self.message, self.answers, self.left = Tick(), {}, set()

    def missing(self) -> list[str]:
        """The participants that have not answered; in a run that is run again, and those that have still to end."""
        silent = [name for name in self.members if name not in self.answers]
        if self.recorded is not None:
            silent += [name for name in self.members if name in self.recorded.leaving and name in self.answers]
        return silent

    @property
    def absent(self) -> list[str]:
        """Expected processes that neither take part nor join."""
        return sorted(self._expected.difference(self.members, self.joining))

    @property
    def held(self) -> bool:
        """Whether this is the first tick."""
        return self._start is not Start.OVER

    @property
    def must_reopen(self) -> bool:
        """Whether the tick is held and has to be opened again."""
        return self.held and self._changed

    @property
    def has_time(self) -> bool:
        """Whether it may stay open for any time, as a start may: with GO the first tick is one like any other."""
        return self.held and not self.message.epoch

    @property
    def is_over(self) -> bool:
        """Whether every participant has answered and the tick is not held."""
        return self._start is not Start.HELD and not self.must_reopen and not self.missing()

    def lacks_recorded(self) -> list[str]:
        """The processes that have to join the tick that is about to be opened, and have not asked to."""
        if self.recorded is None or self.held:
            return _NOBODY
        return sorted(self.recorded.members.difference(self.members, self.joining, self.given_up))

    @property
    def may_go_on(self) -> bool:
        """Whether it may be over, or has to be opened again perhaps: False after most answers, in little time."""
        return self._changed or len(self.answers) >= len(self.members)

    def end(self) -> None:
        """The tick is over: the next one is to come."""
        self._start = Start.OVER

    def drop_silent(self, missing: list[str]) -> list[str]:
        """Drop those that are to blame for the silence of `missing`; their names. They may join again later."""
        culprits = _culprits(missing)
        for name in culprits:
            self._drop(name)
        self.hung += culprits
        self._start = Start.OVER
        return culprits

    def _drop(self, name: str) -> None:
        self.members = [member for member in self.members if member != name]
        self.joining.discard(name)

    def silent(self) -> list[str]:
        """The participants that hold the world."""
        absent = self.absent if self._start is Start.HELD else ()
        return sorted({*_culprits(self.missing()), *absent})

    def waiting_for(self, lacking: Mapping[str, str] | None = None) -> str:
        """What holds the world, in words; empty for nothing. `lacking` says what some participants wait for."""
        needs = lacking or {}
        silent = [f"{name}, which waits for {needs[name]}" if needs.get(name) else name for name in self.silent()]
        if self.held and self._gate and not self._go_epoch:
            silent.append("the monitor's GO (zteam-monitor; zteam-sim --no-gate begins without)")
        return ", ".join(silent)

    def complaint(self, waited: float, lacking: Mapping[str, str] | None) -> str:
        """What holds the world for `waited` host seconds, as a line of the log; `lacking` as above. None: no process
        answers anything, so of several participants the router may be at fault, and none is named."""
        holders = self.waiting_for(lacking)
        if self.held:
            return f"the first tick is held: waiting for {holders}"
        if lacking is not None:
            return f"tick {self.message.tick} waits for {holders} for {waited:.0f} s"
        holders = holders if len(self.message.participants) == 1 else "all answers"
        return f"tick {self.message.tick} waits for {holders} for {waited:.0f} s: no process answers over the router"

    def commands(self, robots: Container[int]) -> dict[int, Twist]:
        """The commands in the answers of robots that are in the world, by id: zero if their process has ended."""
        found = {names.robot_id_of(name): Twist() for name in self.left}
        found |= {names.robot_id_of(name): done.command for name, done in self.answers.items() if done.has_command}
        return dict(sorted((i, command) for i, command in found.items() if i is not None and i in robots))


def _culprits(missing: list[str]) -> list[str]:
    """Those of `missing` that are to blame: robots wait for the aggregator's transforms."""
    return [names.AGGREGATOR] if names.AGGREGATOR in missing else missing
