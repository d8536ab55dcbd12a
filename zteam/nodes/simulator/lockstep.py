"""The simulator's half of lock-step on the bus: it sends numbered ticks and waits for the participants' answers.

A tick that is not answered is sent again, with its inputs, to the participants that owe an answer. `OpenTick` holds the
rules by which a tick ends, `Patience` the times: both are pure.
"""

import logging
import threading
from collections.abc import Callable, Container

import msgspec

from zteam import names
from zteam.clock import monotonic, wait_until
from zteam.errors import BusError
from zteam.messages import Done, TeamState, TeamStatus, Tick, Twist
from zteam.nodes.simulator.open_tick import OpenTick
from zteam.nodes.simulator.patience import TIMEOUT, Patience, Silence
from zteam.runtime.node import Node
from zteam.runtime.participant import Lacking

log = logging.getLogger("zteam")

Resend = Callable[[list[str]], None]
"""Send the open tick's inputs again, to these participants."""

_LACKING_LIMIT = 0.5
"""Host seconds for the participants to say which inputs they wait for; the world is held meanwhile."""


class LockStepOptions(msgspec.Struct, frozen=True):
    """What the command line says about lock-step."""

    expected: tuple[str, ...] = ()
    """The first tick is held until these processes take part."""
    timeout: float = TIMEOUT
    """Host seconds until a living participant that does not answer is dropped."""
    gate: bool = True
    """Hold the first tick until the monitor gives GO."""


class LockStep:
    """Ticks and answers on the bus. The simulator's main loop calls `open` and `wait`; bus threads call the rest."""

    def __init__(self, node: Node, options: LockStepOptions, on_command: Callable[[int], None]) -> None:
        """`on_command(robot_id)` is called when a robot's answer carries a command."""
        self._node = node
        self._on_command = on_command
        self._timeout = options.timeout
        self._lock = threading.RLock()
        self._changed = threading.Condition(self._lock)
        self._tick = OpenTick(options.expected, gate=options.gate)
        self._opened = 0.0
        """Host time from which the open tick's silence counts."""
        self.resends = 0
        """How often a tick was sent again."""
        self.hung: list[str] = []
        """Participants that were dropped so far because they did not answer."""
        self._publisher = node.bus.publisher(names.TICK, Tick)
        node.stop.on_request(self._wake)
        node.bus.watch_tokens([names.tokens_key()], self._on_token)
        node.bus.subscribe(names.done_key(), Done, self._on_done)
        node.bus.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is None or token[0] == names.SIMULATOR:
            return
        with self._lock:
            if self._tick.take_token(*token, alive):
                self._publisher.hand_over(self._tick.refreshed())
            self._changed.notify_all()

    def _on_done(self, key: str, done: Done) -> None:
        name = names.split_done_key(key)
        robot_id = names.robot_id_of(name or "")
        if done.has_command and robot_id is not None:
            self._on_command(robot_id)
        with self._lock:
            if name is None or not self._tick.take_done(name, done):
                self._node.bus.counters.drop(key, "no process holds this name")
            elif self._tick.needs_attention:
                self._changed.notify_all()

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        if status.state == TeamState.GO:
            with self._lock:
                self._tick.take_go(status.epoch)
                self._changed.notify_all()

    @property
    def participants(self) -> list[str]:
        """The participants of the open tick."""
        return list(self._tick.barrier.members)

    @property
    def joining(self) -> list[str]:
        """The processes that take part from the next tick on."""
        return sorted(self._tick.barrier.joining)

    @property
    def is_go(self) -> bool:
        """Whether the open tick carries GO."""
        return self._tick.message.epoch > 0

    def waiting_for(self) -> str:
        """What holds the world, in words; empty for nothing."""
        with self._lock:
            return self._tick.waiting_for()

    def take_commands(self, robots: Container[int]) -> dict[int, Twist]:
        """The commands that came with the answers, of robots that are in the world, by id."""
        with self._lock:
            return self._tick.commands(robots)

    def open(self, stamp: int, tick: int, robots: list[int]) -> None:
        """Send tick `tick` at simulated time `stamp` (ns), with these robots in the world."""
        with self._lock:
            self._publisher.hand_over(self._tick.open(stamp, tick, robots))
        self._opened = monotonic()

    def start_anew(self) -> None:
        """The world returns to its start: answers to earlier ticks no longer count."""
        with self._lock:
            self._tick.start_anew()

    def wait(self, resend: Resend) -> bool:
        """Wait until every participant has answered the open tick; False when the process is asked to stop."""
        tick, stop, patience = self._tick, self._node.stop, Patience(self._timeout)
        while not stop.requested:
            with self._lock:
                if not tick.is_over:
                    wait_until(self._changed, lambda: tick.has_news or stop.requested, patience.delay)
                if tick.is_over:
                    tick.held = False
                    return True
                must_reopen = tick.must_reopen
            if must_reopen:
                self._reopen(resend)
            else:
                self._act_on_silence(resend, patience)
        return False

    def _reopen(self, resend: Resend) -> None:
        with self._lock:
            self._publisher.hand_over(self._tick.reopen())
            missing = self._tick.barrier.missing()
        if missing:
            resend(missing)

    def _act_on_silence(self, resend: Resend, patience: Patience) -> None:
        waited, held = monotonic() - self._opened, self._tick.held
        missing = self._tick.barrier.missing()
        if missing or held:
            self._repeat(resend, missing)
            patience.lengthen()
        verdict = patience.judge(waited, held)
        if verdict is Silence.DROP:
            self._drop(missing, waited)
        elif verdict is Silence.NAME:
            lacking = _ask_lacking(self._node)
            with self._lock:
                log.warning("%s", self._tick.complaint(waited, lacking))

    def _repeat(self, resend: Resend, missing: list[str]) -> None:
        self.resends += bool(missing)
        with self._lock:
            self._publisher.hand_over(self._tick.refreshed())
            participants = self.participants
        # A held tick is repeated to all: one that has answered may still lack what makes it ready.
        resend(missing or participants)

    def _drop(self, missing: list[str], waited: float) -> None:
        with self._lock:
            dropped = self._tick.drop_silent(missing)
            self.hung += dropped
            self._publisher.hand_over(self._tick.refreshed())
        for name in dropped:
            log.error(
                "%s did not answer tick %d within %.0f s: the world goes on without it until it answers again",
                name, self._tick.message.tick, waited,
            )  # fmt: skip
        self._opened = monotonic()


def _ask_lacking(node: Node) -> dict[str, str]:
    """The inputs that participants wait for, in words, by the participant's name."""
    try:
        answers = node.bus.query(names.service_key("*", names.LACKING), Lacking, timeout=_LACKING_LIMIT)
    except BusError as error:
        log.debug("%s", error)
        return {}
    return {key.partition("/")[0]: ", ".join(answer.keys) for key, answer in answers}
