"""The simulator's half of lock-step on the bus: it sends numbered ticks and waits for the participants' answers.

A tick that is not answered is sent again, with its inputs, to the participants that owe an answer. `OpenTick` holds the
rules by which a tick ends, `Patience` the times: both are pure. An answer counts from the session that holds the name.
A first answer that overtakes its session's token comes again: with each token the open tick is sent again.
"""

import threading
from collections.abc import Callable
from typing import TypeVar

from zteam import names
from zteam.bus.transport import Held
from zteam.clock import HOST_FACTOR, monotonic, wait_until
from zteam.config.simulation_options import LockStepOptions
from zteam.errors import log
from zteam.messages import Done, Input, TeamState, TeamStatus, Tick
from zteam.node.lockstep import Lacking
from zteam.node.process_node import ProcessNode
from zteam.node.tokens import CertainTokens
from zteam.simulator.process.open_tick import OpenTick
from zteam.simulator.process.outside import Outside
from zteam.simulator.process.recorded import Recorded

T = TypeVar("T")

Resend = Callable[[list[str]], None]
"""Send the open tick's inputs again, to these participants."""

RESEND = 0.05
"""Host seconds until a tick is sent again. The time doubles with each repeat, up to MAX_RESEND."""
MAX_RESEND = 0.5
NAME_AFTER = 1.0
"""Host seconds until the log names the participants that hold the world."""
_NAME_EVERY = 5.0
"""Host seconds between two such lines in the log."""
_MOST_SENT = 256
"""Ticks that are sent again for tokens within a second; then one for all further tokens. Any program may hold some."""
_JOIN_LIMIT = 60.0 * HOST_FACTOR
"""Host seconds for a process to come that joined the run that is run again."""
_LACKING_LIMIT = 0.5
"""Host seconds for the participants to say which inputs they wait for; the world is held meanwhile."""
_LONGEST_LOOK = 1.5
"""Host seconds between two looks at the silence, at most: more is a pause of this process, or of the machine."""


class Patience:
    """How long a tick waits for its answers, in host seconds: until it is sent again, and until the silent participants
    are named in the log and dropped."""

    def __init__(self, timeout: float, now: float) -> None:
        self._timeout, self._looked, self.delay = timeout, now, RESEND
        self.start_anew()

    def start_anew(self) -> None:
        """The participants have the whole time again."""
        self.waited, self._next_name = 0.0, NAME_AFTER

    def look(self, now: float) -> None:
        """Count the time since the last look."""
        self.waited += min(now - self._looked, _LONGEST_LOOK)
        self._looked = now

    def lengthen(self) -> None:
        """The tick was sent again: the next repeat comes later."""
        self.delay = min(MAX_RESEND, 2.0 * self.delay)

    @property
    def is_over(self) -> bool:
        """Whether the silent participants are to be dropped."""
        return self.waited > self._timeout

    def names_silent(self) -> bool:
        """Whether the silent participants are to be named now."""
        is_due = self.waited > self._next_name
        if is_due:
            self._next_name = self.waited + _NAME_EVERY
        return is_due


class LockStep:
    """Ticks and answers on the bus. The simulator's main loop calls `open` and `wait`; bus threads call the rest."""

    def __init__(self, node: ProcessNode, options: LockStepOptions, on_command: Callable[[int], None]) -> None:
        """`on_command(robot_id)` is called when a robot's answer carries a command."""
        self._node = node
        self._on_command = on_command
        self._timeout = options.timeout
        self._lock = threading.RLock()
        self._changed = threading.Condition(self._lock)
        self.tick = OpenTick(options.expected, gate=options.gate)
        """Other threads `ask` it, but for lists that are replaced and not changed."""
        recorded = options.recorded
        self.outside = Outside(node.bus, self._on_latched) if recorded is None else Recorded(node.bus, recorded)
        self._reads: dict[str, list[str]] = {}
        """The key expressions that a participant reads."""
        self._asked: dict[str, int] = {}
        """Number of the newest query that a participant has handed on, by its session."""
        self._is_unsent = False
        """Whether the open tick waits for `send`: a token does not send it before its data."""
        self._sent_before = 0
        """What the simulator had published when it sent the tick before (`Bus.in_ticks`)."""
        self._asking: dict[str, tuple[str, Done]] = {}
        """Session and newest answer of the processes that ask to be let in and wait for what is latched outside."""
        self.resends = 0
        """How often a tick was sent again."""
        self._for_tokens = 0.0, 0
        """Since when tokens are counted that a tick is sent again for, in host time, and how many they are."""
        self._publisher = node.bus.publisher(names.TICK, Tick)
        token = Held(lambda: node.bus.declare_token(names.lockstep_key(node.bus.instance)))
        node.bus.open(token)
        node.claim.under_name.append(token)
        node.stop.on_request(self._wake)
        CertainTokens(node.bus, names.tokens_key("*"), self._on_token)
        node.bus.subscribe_from(names.done_key("*"), Done, self._on_done)
        node.bus.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        if status.state == TeamState.GO:
            with self._changed:
                self.tick.on_go(status.epoch)
                self._changed.notify_all()

    def _on_latched(self) -> None:
        with self._changed:
            self.tick.on_latched()
            self._changed.notify_all()

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is None or token[0] == names.SIMULATOR:
            return
        with self._changed:
            if not self.tick.defers(*token, alive):
                self._take_token(*token, alive)

    def _take_token(self, name: str, session: str, alive: bool) -> None:
        if alive and self.tick.note_return(name, session):
            log.error("%s was cut off, or frozen for longer than its lease: it missed ticks", name)
        if self.tick.on_token(name, session, alive):
            self._send_for_token()
        if not self.tick.holders.names_of(session):
            self.outside.part_with(session)
            self._asked.pop(session, None)
        self._changed.notify_all()

    def _send_for_token(self) -> None:
        now = monotonic()
        since, count = self._for_tokens if now - self._for_tokens[0] < 1.0 else (now, 0)
        self._for_tokens = since, count + 1
        if count < _MOST_SENT:
            self._send_again()
        elif count == _MOST_SENT:
            # Host time: tokens come while the world is held, too.
            timer = threading.Timer(1.0, self._send_late)  # noqa: TID251
            timer.name, timer.daemon = "tokens", True
            timer.start()

    def _send_late(self) -> None:
        with self._changed:
            if self.tick.message.tick:
                self._send_again()

    def _on_done(self, key: str, done: Done, session: str) -> None:
        name = names.process_of(key, names.DONE) or ""
        with self._lock:
            holders = self.tick.holders
            if session not in holders.get(name, ()):
                if name in holders:
                    holder = holders.name_of(session)
                    sender = f"{holder} (session {session})" if holder else f"session {session or 'unknown'}"
                    self._node.bus.counters.drop(key, f"{sender} does not hold the name {name}")
                return
            self.outside.admit(session)
            if done.reads:
                self._reads[name] = done.reads
                self.outside.read(done.reads)
            if name in self.tick.members:
                self._take_done(name, session, done)
                return
            is_first = not self._asking
            self._asking[name] = session, done
            if is_first:
                self._node.bus.transport.when_caught_up(self._let_in)

    def _let_in(self) -> None:
        """What is latched outside has come: the first tick of those that ask carries what they read of it."""
        with self._lock:
            asking, self._asking = self._asking, {}
            for name, (session, done) in asking.items():
                # A participant answers ticks, and this is no answer.
                if name not in self.tick.members:
                    self._take_done(name, session, done)

    def _take_done(self, name: str, session: str, done: Done) -> None:
        if not self.tick.on_done(name, session, done):
            return
        for each in done.inputs:
            self._take(session, each)
        if done.has_command and (robot_id := names.robot_id_of(name)) is not None:
            self._on_command(robot_id)
        if self.tick.may_go_on:
            self._changed.notify_all()

    def _take(self, session: str, asked: Input) -> None:
        """A query that is to change the participant which has answered it; it comes again until a tick carries it."""
        owners = self.tick.holders.names_of(session)
        if asked.number > self._asked.get(session, 0) and any(names.is_own_query(each, asked.key) for each in owners):
            self._asked[session] = asked.number
            self.outside.add(asked.key, asked.data.tobytes())

    @property
    def was_held(self) -> bool:
        """Whether the open tick waited so long that the log has said what for."""
        return self._patience.waited > NAME_AFTER

    def ask(self, question: Callable[[OpenTick], T]) -> T:
        """What the open tick answers, under its lock."""
        with self._changed:
            return question(self.tick)

    def open(self, stamp: int, tick: int, robots: list[int], out: frozenset[str] = frozenset()) -> list[Input]:
        """Open tick `tick` at simulated time `stamp` (ns), with these robots in the world, and without `out`, and send
        it later; the inputs that it carries for the first time."""
        # What has come until now is in this tick.
        self._node.bus.transport.settle()
        with self._changed:
            open_tick, stop = self.tick, self._node.stop
            open_tick.recorded = self.outside.recorded(tick)
            if open_tick.lacks_recorded():
                wait_until(self._changed, lambda: stop.requested or not open_tick.lacks_recorded(), _JOIN_LIMIT)
            if absent := open_tick.lacks_recorded():
                open_tick.given_up.update(absent)
                text = "tick %d: %s took part in the run that is run again, and is not there: the world goes on"
                log.error(text, tick, ", ".join(absent))
            open_tick.open(stamp, tick, robots, out)
            self._is_unsent = True
            return self._carry()

    def _carry(self) -> list[Input]:
        """Let the tick that was opened carry what has come from outside; what is new of that."""
        joined = [each for name in self.tick.joined for each in self._reads.get(name, ())]
        again, new = self.outside.take(joined, self.tick.message.tick, is_first=self.tick.held)
        if again or new:
            self.tick.carry([*again, *new])
        return new

    def send(self) -> None:
        """Send the tick that was opened."""
        with self._changed:
            self._is_unsent, count = False, self._node.bus.in_ticks
            self.tick.count_sent(count.sent - self._sent_before)
            self._sent_before = count.sent
            self._send_again()
            for token in self.tick.go_on():
                self._take_token(*token)
        self._patience = Patience(self._timeout, monotonic())

    def wait(self, resend: Resend) -> bool:
        """Wait until every participant has answered the open tick; False when the process is asked to stop."""
        tick, stop, patience = self.tick, self._node.stop, self._patience
        while not stop.requested:
            with self._changed:
                wait_until(self._changed, lambda: tick.is_over or tick.must_reopen or stop.requested, patience.delay)
                if tick.is_over:
                    tick.end()
                    return True
                must_reopen = tick.must_reopen
            if must_reopen:
                self._reopen(resend)
            else:
                self._act_on_silence(resend)
        return False

    def _send_again(self) -> None:
        if not self._is_unsent:
            self._publisher.put_owned(self.tick.refreshed())

    def _reopen(self, resend: Resend) -> None:
        with self._changed:
            self.tick.reopen()
            self._carry()
            self._send_again()
            missing = self.tick.missing()
        if not self.tick.has_time:
            self._patience.waited = 0.0
        if missing:
            resend(missing)

    def _act_on_silence(self, resend: Resend) -> None:
        patience, missing, has_time = self._patience, self.tick.missing(), self.tick.has_time
        patience.look(monotonic())
        if missing or has_time:
            self.resends += bool(missing)
            with self._changed:
                self._send_again()
                participants = self.tick.members
            # A held tick is repeated to all: one that has answered may still lack what makes it ready.
            resend(missing or participants)
            patience.lengthen()
        # A start may take any time.
        if patience.is_over and not has_time:
            self._drop(missing)
        elif patience.names_silent():
            # The inputs that participants wait for, in words, by the participant's name.
            answers = self._node.bus.find(names.service_key("*", names.LACKING), Lacking, timeout=_LACKING_LIMIT)
            lacking = {key.partition("/")[0]: ", ".join(answer.keys) for key, answer in answers}
            reaches_others = self.tick.held or self._node.reaches_others()
            with self._changed:
                # The last answer may have come meanwhile.
                if self.tick.waiting_for():
                    log.warning("%s", self.tick.complaint(patience.waited, lacking if reaches_others else None))

    def _drop(self, missing: list[str]) -> None:
        with self._changed:
            dropped = self.tick.drop_silent(missing)
            self._send_again()
        for name in dropped:
            log.error(
                "%s did not answer tick %d within %.0f s: the world goes on without it until it answers again",
                name, self.tick.message.tick, self._patience.waited,
            )  # fmt: skip
        self._patience.start_anew()
