"""The simulator's half of lock-step: numbered ticks out, answers in, nothing waited for in silence.

A tick that is not answered is sent again with the inputs of those who owe an answer, after RESEND and then ever more
seldom. Whoever lives and stays silent is named, and left behind after a time-out; whoever dies is not waited for.
"""

import logging
import threading
from collections.abc import Callable, Mapping

import msgspec
import numpy as np

from zteam import names
from zteam.clock import Every, monotonic, wait_until
from zteam.messages import Done, TeamState, TeamStatus, Tick, Twist, time_from_ns
from zteam.nodes.simulator.barrier import Barrier
from zteam.runtime.node import Node

log = logging.getLogger("zteam")

RESEND = 0.05
"""Host seconds until a tick is sent again; the time doubles each time, up to MAX_RESEND."""
MAX_RESEND = 0.5
NAME_AFTER = 1.0
"""Host seconds until those who hold the world are named."""
TIMEOUT = 10.0
"""Host seconds until a living participant that does not answer is left behind."""

Resend = Callable[[list[str]], None]
"""Send the open tick's inputs again, to these participants."""


class LockStepOptions(msgspec.Struct, frozen=True):
    """What the command line says about lock-step."""

    expected: tuple[str, ...] = ()
    """Participants without which the first tick is held."""
    timeout: float = TIMEOUT
    gate: bool = True
    """Hold the first tick until the monitor gives GO."""


class LockStep:
    """Ticks and answers on the bus. `wait` is called by the simulator's main loop, everything else by bus threads."""

    def __init__(self, node: Node, options: LockStepOptions, answered: Callable[[int], None]) -> None:
        """`answered(robot_id)` is called when a robot's command has come."""
        self._node = node
        self._answered = answered
        self._options = options
        self._lock = threading.Condition()
        self.barrier = Barrier(options.expected)
        self._go_epoch = 0
        self._held = True
        """The first tick waits for everybody expected, and for GO."""
        self._news = False
        self._tick = Tick()
        self._opened = 0.0
        self.resends = 0
        """How often a tick was sent again."""
        self.hung: list[str] = []
        """Who was left behind so far."""
        self._publisher = node.bus.publisher(names.TICK, Tick)
        node.stop.on_request(self._wake)
        node.bus.watch_tokens([names.tokens_key()], self._on_token)
        node.bus.subscribe(names.done_key(), Done, self._on_done)
        node.bus.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)

    def _wake(self) -> None:
        with self._lock:
            self._lock.notify_all()

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is None or token[0] == names.SIMULATOR:
            return
        with self._lock:
            self.barrier.take_token(*token, alive)
            # A newcomer has to hear of the tick at hand to join, for ticks may stand still for long; and the others
            # that the one who went is not to be waited for.
            if alive or token[0] in self._tick.participants:
                self._repeat()
            self._news = True
            self._lock.notify_all()

    def _repeat(self) -> None:
        """Send the open tick again, with those who take part now."""
        if self._tick.tick:
            self._tick.participants = list(self.barrier.members)
            self._publisher.put(self._tick)

    def _on_done(self, key: str, done: Done) -> None:
        name = names.split_done_key(key)
        robot_id = names.robot_id_of(name or "")
        if done.has_command and robot_id is not None:
            self._answered(robot_id)
        with self._lock:
            joining = len(self.barrier.joining)
            if name is None or not self.barrier.take_done(name, done):
                self._node.bus.counters.drop(key, "no process holds this name")
                return
            if len(self.barrier.joining) > joining:
                self._news = True
            if self._news or self.barrier.complete:
                self._lock.notify_all()

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        if status.state == TeamState.GO:
            with self._lock:
                self._go_epoch = max(self._go_epoch, status.epoch)
                self._news = True
                self._lock.notify_all()

    @property
    def participants(self) -> list[str]:
        """Who takes part in the open tick."""
        return list(self.barrier.members)

    @property
    def joining(self) -> list[str]:
        """Who will take part from the next tick on."""
        return sorted(self.barrier.joining)

    @property
    def is_go(self) -> bool:
        """Whether the open tick carries GO."""
        return self._tick.epoch > 0

    def open(self, stamp: int, tick: int, robots: list[int]) -> None:
        """Send tick `tick` at simulated time `stamp` (ns), with these robots in the world."""
        with self._lock:
            # Nobody is let into the held tick, and none hears of GO, before all can: an answer that was given with
            # half the team there would depend on who came first.
            whole = not (self._held and self.barrier.absent)
            epoch = self._go_epoch if whole else 0
            participants = list(self.barrier.open(epoch, tick, admit=whole))
            self._tick = Tick(time_from_ns(stamp), epoch, tick, np.array(robots, np.int32), participants)
            self._news = False
            self._publisher.put(self._tick)
        self._opened = monotonic()

    def start_anew(self) -> None:
        """The world goes back to its start: answers to what was before count no more."""
        with self._lock:
            self.barrier.open(0, 0)

    def wait(self, resend: Resend) -> bool:
        """Until everybody has answered the open tick; False when the process is asked to stop."""
        delay, say = RESEND, Every(5.0)
        while not self._node.stopping:
            with self._lock:
                wait_until(self._lock, lambda: self._node.stopping or self._settled or self._due_news, delay)
                if self._settled:
                    self._held = False
                    return True
                news = self._due_news
            if news:
                self._reopen(resend)
                continue
            waited = monotonic() - self._opened
            missing = self.barrier.missing()
            if missing or self._held:
                # Held, it goes to all: who has answered may lack what makes it ready, and who is absent may not have
                # heard the tick.
                self._resend(resend, missing)
                delay = min(MAX_RESEND, 2.0 * delay)
            if self._held:
                if waited > NAME_AFTER and say.due():
                    log.warning("the first tick is held: waiting for %s", self.waiting_for())
            elif waited > self._options.timeout:
                self._leave_behind(missing, waited)
            elif waited > NAME_AFTER and say.due():
                log.warning("tick %d waits for %s for %.0f s", self._tick.tick, ", ".join(missing), waited)
        return False

    @property
    def _settled(self) -> bool:
        return self.barrier.complete and not (self._held and (self._due_news or not self._may_begin))

    @property
    def _may_begin(self) -> bool:
        released = self._tick.epoch > 0 or not self._options.gate
        return released and not self.barrier.expected.difference(self.barrier.members)

    @property
    def _due_news(self) -> bool:
        """Whether the held tick has to be opened again, for who has joined, left, or with GO."""
        return self._held and self._news

    def _reopen(self, resend: Resend) -> None:
        with self._lock:
            # GO is told when all who are expected are there, so that they all hear it in the same tick.
            whole = not self.barrier.absent
            self._tick.epoch = self._go_epoch if whole else self._tick.epoch
            self.barrier.open(self._tick.epoch, self._tick.tick, admit=whole)
            self._news = False
            self._repeat()
            missing = self.barrier.missing()
        if missing:
            resend(missing)

    def _resend(self, resend: Resend, missing: list[str]) -> None:
        self.resends += bool(missing)
        with self._lock:
            self._repeat()
            everybody = self.participants
        resend(missing or everybody)

    def _leave_behind(self, missing: list[str], waited: float) -> None:
        # Robots wait for the aggregator's transforms, so it alone is to blame when all are silent.
        culprits = [names.AGGREGATOR] if names.AGGREGATOR in missing else missing
        for name in culprits:
            log.error(
                "%s did not answer tick %d within %.0f s: the world goes on without it until it answers again",
                name, self._tick.tick, waited,
            )  # fmt: skip
        with self._lock:
            for name in culprits:
                self.barrier.drop(name)
            self.hung += culprits
            self._repeat()
        self._opened = monotonic()

    def waiting_for(self) -> str:
        """What holds the world, in words; empty for nothing."""
        with self._lock:
            silent = sorted({*self.barrier.missing(), *(self.barrier.absent if self._held else ())})
            if self._held and self._options.gate and not self._go_epoch:
                silent.append("the monitor's GO (zteam-monitor; zteam-sim --no-gate begins without)")
        return ", ".join(silent)

    def take_commands(self, robots: Mapping[int, object]) -> dict[int, Twist]:
        """The commands that came with the answers, of robots that are in the world."""
        found: dict[int, Twist] = {}
        with self._lock:
            for name, done in self.barrier.answers.items():
                robot_id = names.robot_id_of(name)
                if done.has_command and robot_id in robots:
                    assert robot_id is not None
                    found[robot_id] = done.command
        return dict(sorted(found.items()))
