"""The open tick of lock-step: its participants, their answers, and the rules by which it ends. Pure: no bus, no time.

A process joins when it answers any tick. The simulator waits for it from the next tick that is opened. A process leaves
with its last presence token, or when it is dropped because it does not answer. The first tick is held until all
expected processes take part in it and, with the gate, until the monitor has given GO.
"""

from collections.abc import Container, Iterable, Mapping

import msgspec
import numpy as np

from zteam import names
from zteam.messages import Done, Tick, Twist, time_from_ns
from zteam.runtime.tokens import TokenSet

LINK = "router"
"""In `hung`, the router: the simulator has lost its link."""


class Barrier:
    """The participants of one simulator. Names are process names: `robot_1`, `tf`, …"""

    def __init__(self, expected: Iterable[str] = ()) -> None:
        self.expected = frozenset(expected)
        """The first tick is held until all of these take part."""
        self.members: list[str] = []
        """Participants of the open tick, sorted. The list is replaced, not changed: ticks that were sent hold it."""
        self.joining: set[str] = set()
        """Processes that have answered and become participants with the next tick."""
        self.answers: dict[str, Done] = {}
        """Answers to the open tick, by participant."""
        self.left: set[str] = set()
        """Participants that have ended since the tick was opened. What they answered does not count: whether their
        answer or their end comes first is chance."""
        self._gone: set[tuple[str, str]] = set()
        """Names and sessions of participants that have left with their last token."""
        self._owing: set[str] = set()
        """Participants that have not answered the open tick."""
        self._key = (0, 0)
        self._holders = TokenSet()

    def take_token(self, name: str, instance: str, alive: bool) -> None:
        """The presence token of session `instance` for `name` came (`alive`) or went."""
        self._holders.take(name, instance, alive)
        if name in self._holders:
            return
        if name in self.members:
            self.left.add(name)
            self.answers.pop(name, None)
            self._gone.add((name, instance))
        self.drop(name)

    def was_cut_off(self, name: str, session: str) -> bool:
        """Whether the token that comes is that of a participant that left: it was frozen or without a link meanwhile.

        A process that has ended comes back with another session. True once.
        """
        gone = (name, session) in self._gone
        self._gone.discard((name, session))
        return gone

    def holds(self, name: str, session: str) -> bool:
        """Whether this session holds this name."""
        return session in self._holders.instances(name)

    def name_of(self, session: str) -> str | None:
        """A name that this session holds; None if it holds none."""
        return self._holders.name_of(session)

    def take_done(self, name: str, session: str, done: Done) -> bool:
        """Take an answer. False if its session does not hold `name`: the answer is ignored."""
        if not self.holds(name, session):
            return False
        counts = (done.epoch, done.tick) == self._key
        if not (counts and name in self._owing) and name not in self.members:
            self.joining.add(name)
        elif counts:
            self.answers[name] = done
            self._owing.discard(name)
            self.left.discard(name)
        return True

    def open(self, epoch: int, tick: int, *, admit: bool = True) -> list[str]:
        """Open a tick and return its participants; `admit` lets in the processes that joined.

        A tick that is opened again keeps its answers.
        """
        if (epoch, tick) != self._key:
            self._key = (epoch, tick)
            self.answers = {}
            self.left = set()
        if admit and self.joining:
            self.members = sorted({*self.members, *self.joining})
            self.joining.clear()
        self._owing = {name for name in self.members if name not in self.answers}
        return self.members

    def missing(self) -> list[str]:
        """Participants that have not answered the open tick."""
        return [name for name in self.members if name in self._owing]

    @property
    def complete(self) -> bool:
        """Whether every participant has answered."""
        return not self._owing

    @property
    def absent(self) -> list[str]:
        """Expected processes that neither take part nor join."""
        return sorted(self.expected.difference(self.members, self.joining))

    def drop(self, name: str) -> None:
        """Stop waiting for this participant. An answer that it gave for the open tick stays."""
        self.members = [member for member in self.members if member != name]
        self._owing.discard(name)
        self.joining.discard(name)


class OpenTick:
    """The tick that the participants are to answer, and the rules by which it ends."""

    def __init__(self, expected: Iterable[str] = (), *, gate: bool = True) -> None:
        self.barrier = Barrier(expected)
        self.held = True
        """Whether this is the first tick and may not end yet."""
        self._gate = gate
        self._complete = False
        """Whether the held tick was sent with all expected processes, and with GO if there is a gate.

        A process that ends after that is not waited for.
        """
        self._go_epoch = 0
        self._changed = False
        """Whether a token, a joining process or GO came since the tick was opened."""
        self.hung: list[str] = []
        """Participants that were left behind so far, for their silence or their lease; LINK for a lost link."""
        self.message = Tick()
        """The tick as it was sent last, which is not changed any more; number 0 before the first one."""

    def take_token(self, name: str, instance: str, alive: bool) -> bool:
        """Take a presence token. True if the tick has to be sent again because of it."""
        self.barrier.take_token(name, instance, alive)
        self._changed = True
        if self.message.tick == 0:
            return False
        # A new process joins by answering a tick, and the next one may be far away. The other participants must learn
        # that the process that left is not to be waited for.
        return alive or name in self.message.participants

    def take_done(self, name: str, session: str, done: Done) -> bool:
        """Take an answer. False if its session does not hold `name`."""
        joining = len(self.barrier.joining)
        if not self.barrier.take_done(name, session, done):
            return False
        if len(self.barrier.joining) > joining:
            self._changed = True
        return True

    def take_go(self, epoch: int) -> None:
        """The monitor gave GO; the highest epoch counts."""
        self._go_epoch = max(self._go_epoch, epoch)
        self._changed = True

    def open(self, stamp: int, tick: int, robots: list[int]) -> Tick:
        """Open tick `tick` at simulated time `stamp` (ns), with these robots in the world."""
        # A held tick admits no process and carries no GO until all can: an answer that was given with half the team
        # present would depend on the order in which the processes came.
        whole = self._complete or not (self.held and self.barrier.absent)
        epoch = self._go_epoch if whole else 0
        participants = self.barrier.open(epoch, tick, admit=whole)
        self.message = Tick(time_from_ns(stamp), epoch, tick, np.array(robots, np.int32), participants)
        self._note_complete()
        self._changed = False
        return self.message

    def reopen(self) -> Tick:
        """Open the held tick again, because processes joined or left or GO came."""
        # GO is announced when all expected processes take part, so that all hear it in the same tick.
        whole = self._complete or not self.barrier.absent
        epoch = self._go_epoch if whole else self.message.epoch
        self.message = msgspec.structs.replace(self.message, epoch=epoch)
        self.barrier.open(epoch, self.message.tick, admit=whole)
        self._note_complete()
        self._changed = False
        return self.refreshed()

    def refreshed(self) -> Tick:
        """The open tick with its current participants."""
        self.message = msgspec.structs.replace(self.message, participants=self.barrier.members)
        return self.message

    def start_anew(self) -> None:
        """The world returns to its start: answers to earlier ticks no longer count."""
        self.barrier.open(0, 0)

    @property
    def must_reopen(self) -> bool:
        """Whether the tick is held and has to be opened again."""
        return self.held and self._changed

    @property
    def has_time(self) -> bool:
        """Whether it may stay open for any time, as a start may: with GO the first tick is one like any other."""
        return self.held and not self.message.epoch

    @property
    def needs_attention(self) -> bool:
        """Whether the wait for the answers may be over, or the tick may have to be opened again."""
        return self._changed or self.barrier.complete

    @property
    def is_over(self) -> bool:
        """Whether every participant has answered and the tick is not held."""
        return self.barrier.complete and not (self.held and (self._changed or not self._complete))

    def _note_complete(self) -> None:
        released = self.message.epoch > 0 or not self._gate
        if released and not self.barrier.expected.difference(self.barrier.members):
            self._complete = True

    def drop_silent(self, missing: list[str]) -> list[str]:
        """Drop those that are to blame for the silence of `missing`; their names. They may join again later."""
        # Robots wait for the aggregator's transforms: if it is silent, the robots' silence follows from that.
        culprits = [names.AGGREGATOR] if names.AGGREGATOR in missing else missing
        for name in culprits:
            self.barrier.drop(name)
        self.hung += culprits
        self.held = False
        return culprits

    def note_lost_link(self) -> bool:
        """The link to the router is lost. True if this changes the run."""
        self.hung += [] if self.held else [LINK]
        return not self.held

    def note_return(self, name: str, session: str) -> bool:
        """A token has come. True if it is that of a participant that had left, and did not end meanwhile."""
        back = self.barrier.was_cut_off(name, session) and not self.held
        self.hung += [name] if back else []
        return back

    def waiting_for(self, lacking: Mapping[str, str] | None = None) -> str:
        """What holds the world, in words; empty for nothing. `lacking` says what some participants wait for."""
        absent = self.barrier.absent if self.held and not self._complete else ()
        silent = [_with_need(name, lacking) for name in sorted({*self.barrier.missing(), *absent})]
        if self.held and self._gate and not self._go_epoch:
            silent.append("the monitor's GO (zteam-monitor; zteam-sim --no-gate begins without)")
        return ", ".join(silent)

    def complaint(self, waited: float, lacking: Mapping[str, str]) -> str:
        """What holds the world for `waited` host seconds, as a line of the log; `lacking` as above."""
        holders = self.waiting_for(lacking)
        if self.held:
            return f"the first tick is held: waiting for {holders}"
        return f"tick {self.message.tick} waits for {holders} for {waited:.0f} s"

    def commands(self, robots: Container[int]) -> dict[int, Twist]:
        """The commands in the answers of robots that are in the world, by id: zero if their process has ended."""
        found: dict[int, Twist] = {}
        for name in self.barrier.left:
            robot_id = names.robot_id_of(name)
            if robot_id is not None and robot_id in robots:
                found[robot_id] = Twist()
        for name, done in self.barrier.answers.items():
            robot_id = names.robot_id_of(name)
            if done.has_command and robot_id is not None and robot_id in robots:
                found[robot_id] = done.command
        return dict(sorted(found.items()))


def _with_need(name: str, lacking: Mapping[str, str] | None) -> str:
    need = lacking.get(name) if lacking else None
    return f"{name}, which waits for {need}" if need else name
