"""The simulator's half of lock-step on the bus: it sends numbered ticks and waits for the participants' answers.

A tick that is not answered is sent again, with its inputs, to the participants that owe an answer. `OpenTick` holds the
rules by which a tick ends, `Patience` the times: both are pure.
"""

import logging
import threading
from collections.abc import Callable, Container

from zteam import names
from zteam.clock import monotonic, wait_until
from zteam.errors import BusError
from zteam.messages import TeamState, TeamStatus, Tick, Twist
from zteam.nodes.simulator.answers import Answers
from zteam.nodes.simulator.open_tick import OpenTick
from zteam.nodes.simulator.patience import Patience, Silence
from zteam.process_options import LockStepOptions
from zteam.runtime.lockstep import Lacking
from zteam.runtime.process_node import ProcessNode

log = logging.getLogger("zteam")

Resend = Callable[[list[str]], None]
"""Send the open tick's inputs again, to these participants."""

_LACKING_LIMIT = 0.5
"""Host seconds for the participants to say which inputs they wait for; the world is held meanwhile."""
_LONGEST_LOOK = 1.5
"""Host seconds between two looks at the silence, at most: more is a pause of this process, or of the machine."""


class LockStep:
    """Ticks and answers on the bus. The simulator's main loop calls `open` and `wait`; bus threads call the rest."""

    def __init__(self, node: ProcessNode, options: LockStepOptions, on_command: Callable[[int], None]) -> None:
        """`on_command(robot_id)` is called when a robot's answer carries a command."""
        self._node = node
        self._timeout = options.timeout
        self._lock = threading.RLock()
        self._changed = threading.Condition(self._lock)
        self._tick = OpenTick(options.expected, gate=options.gate)
        self._looked, self._waited = 0.0, 0.0
        """Host time of the last look at the open tick's silence, and the host seconds of it that count."""
        self.resends = 0
        """How often a tick was sent again."""
        self._publisher = node.bus.publisher(names.TICK, Tick)
        node.stop.on_request(self._wake)
        Answers(node, self._tick, self._changed, on_command, self._send_again)
        node.bus.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        if status.state == TeamState.GO:
            with self._lock:
                self._tick.take_go(status.epoch)
                self._changed.notify_all()

    @property
    def hung(self) -> list[str]:
        """What was left behind so far."""
        return self._tick.hung

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
        self._looked, self._waited = monotonic(), 0.0

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
                    wait_until(
                        self._changed, lambda: tick.is_over or tick.must_reopen or stop.requested, patience.delay
                    )
                if tick.is_over:
                    tick.held = False
                    return True
                must_reopen = tick.must_reopen
            if must_reopen:
                self._reopen(resend)
            else:
                self._act_on_silence(resend, patience)
        return False

    def _send_again(self) -> None:
        self._publisher.hand_over(self._tick.refreshed())

    def _reopen(self, resend: Resend) -> None:
        with self._lock:
            self._publisher.hand_over(self._tick.reopen())
            missing = self._tick.barrier.missing()
        if not self._tick.has_time:
            self._waited = 0.0
        if missing:
            resend(missing)

    def _act_on_silence(self, resend: Resend, patience: Patience) -> None:
        now, held = monotonic(), self._tick.has_time
        self._waited += min(now - self._looked, _LONGEST_LOOK)
        self._looked, waited = now, self._waited
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
                # The last answer may have come meanwhile.
                if self._tick.waiting_for():
                    log.warning("%s", self._tick.complaint(waited, lacking))

    def _repeat(self, resend: Resend, missing: list[str]) -> None:
        self.resends += bool(missing)
        with self._lock:
            self._send_again()
            participants = self.participants
        # A held tick is repeated to all: one that has answered may still lack what makes it ready.
        resend(missing or participants)

    def _drop(self, missing: list[str], waited: float) -> None:
        with self._lock:
            dropped = self._tick.drop_silent(missing)
            self._send_again()
        for name in dropped:
            log.error(
                "%s did not answer tick %d within %.0f s: the world goes on without it until it answers again",
                name, self._tick.message.tick, waited,
            )  # fmt: skip
        self._waited = 0.0


def _ask_lacking(node: ProcessNode) -> dict[str, str]:
    """The inputs that participants wait for, in words, by the participant's name."""
    try:
        answers = node.bus.query(names.service_key("*", names.LACKING), Lacking, timeout=_LACKING_LIMIT)
    except BusError as error:
        log.debug("%s", error)
        return {}
    return {key.partition("/")[0]: ", ".join(answer.keys) for key, answer in answers}
