"""The monitor process: the start gate and the team's health, shown to a user or as JSON lines."""

import logging
import sys
from collections.abc import Callable

import msgspec

from zteam import names
from zteam.clock import Every, monotonic
from zteam.errors import BusError
from zteam.messages import RobotStatus, TeamStatus, Tick, ns_from_time
from zteam.nodes.monitor.members import Event
from zteam.nodes.monitor.start_gate import Gate
from zteam.nodes.monitor.writer_watch import WriterWatch
from zteam.runtime.node import Node
from zteam.runtime.ticks import Ticks
from zteam.runtime.token_loss import TokenLossFilter
from zteam.services.simulator import SimStatus

log = logging.getLogger("zteam")
_event_log = logging.getLogger("zteam.monitor.events")
"""Events in the log on the bus. The monitor shows them itself, so this logger has no output."""
_event_log.propagate = False
_event_log.addHandler(logging.NullHandler())

_TROUBLE = frozenset({"fault", "lost", "silent"})
"""Kinds of events that are warnings."""
LEAVE_AFTER = 5.0
"""`--exit-on-go` waits this long at most for every robot to obey."""


class MonitorOptions(msgspec.Struct, frozen=True):
    """What the command line asks for."""

    team_size: int
    ids: tuple[int, ...] | None = None
    json: bool = False
    exit_on_go: bool = False


class Monitor:
    """The gate on the bus. Callbacks run under `node.changed`."""

    def __init__(self, node: Node, options: MonitorOptions, show: Callable[[Event], None]) -> None:
        self._node = node
        self._options = options
        self._show = show
        self.gate = Gate(options.ids, options.team_size)
        self._losses = TokenLossFilter()
        self._link_up = True
        self._published: TeamStatus | None = None
        self._sim_seen = False
        self._writers = WriterWatch(node, self.gate)
        self._publisher = node.bus.publisher(names.TEAM_STATUS, TeamStatus, latched=True)
        node.follow_clock()
        self._ticks = Ticks(node, self._on_tick)
        node.on_simulator_lost(self._ticks.listen)
        node.clock.sim.on_jump_back(lambda _old, new: self.gate.renew(new))
        node.bus.watch_link(self._on_link)
        node.subscribe(names.all_robots_key(names.STATUS), RobotStatus, self._on_status)
        node.watch_tokens(names.tokens_key(), self._on_token)

    def _on_tick(self, tick: Tick) -> None:
        """In lock-step GO holds from the tick that carries it: neither time nor further ticks are needed."""
        self._node.take_time_from_ticks()
        self._node.set_time(ns_from_time(tick.stamp))
        self._ticks.deafen()

    def _on_link(self, up: bool) -> None:
        with self._node.changed:
            self._link_up = up
            self._losses.take_link(up, monotonic())
            self.gate.members.forgive_silence(monotonic())
            self.gate.members.tell("link", None, "router is back" if up else "router lost")
            self._node.changed.notify_all()

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is None:
            return
        name, instance = token
        self._writers.take_token(name, instance, alive)
        if name == names.SIMULATOR and alive:
            self._sim_seen = True
        robot_id = names.robot_id_of(name)
        if robot_id is None:
            return
        self._losses.take_token(key, alive, monotonic())
        if alive:
            self.gate.take_token(robot_id, instance, True)

    def _on_status(self, key: str, status: RobotStatus) -> None:
        target = names.split_robot_key(key)
        if target is None or not self.gate.take_status(target[0], status, monotonic()):
            self._node.bus.counters.drop(key, f"it speaks for robot {status.robot_id}")

    def run(self) -> None:
        """Gate and watch until the process is asked to stop."""
        nag = Every(5.0)
        nag.due()
        leave_at: float | None = None
        while not self._node.stopping:
            if self._sim_seen and self.gate.expected is None:
                self._learn_ids()
            self._writers.look()
            with self._node.changed:
                self._take_losses()
                if self._link_up:
                    self.gate.try_go(self._go_stamp())
                self._publish()
                events = self.gate.members.take_events()
                leaving = self._options.exit_on_go and self.gate.gone
                running = self.gate.all_running()
            for event in events:
                # Without the lock: a terminal can be slow, and the live table takes the lock to draw itself.
                _event_log.log(logging.WARNING if event.kind in _TROUBLE else logging.INFO, "%s", sentence(event))
                self._show(event)
            if leaving:
                leave_at = leave_at or monotonic() + LEAVE_AFTER
                if running or monotonic() > leave_at:
                    return
            elif not self.gate.gone and nag.due():
                log.warning(
                    "waiting for %s (a robot started with --no-gate does not wait for GO)", self.gate.waiting_for()
                )
            self._node.wait(self._has_work, 0.2)

    def _has_work(self) -> bool:
        complete = self._link_up and not self.gate.gone and len(self.gate.ready) >= self.gate.team_size
        return self.gate.members.has_events or complete

    def _go_stamp(self) -> int:
        """Now, in simulated time, or in wall time where ready robots have come and no simulator."""
        clock = self._node.clock
        if len(self.gate.ready) >= self.gate.team_size and not self.gate.gone:
            clock.use_wall()
        return clock.now()

    def _take_losses(self) -> None:
        now = monotonic()
        for key in self._losses.take_due(now):
            token = names.split_token_key(key)
            robot_id = names.robot_id_of(token[0]) if token else None
            if token and robot_id is not None:
                self.gate.take_token(robot_id, token[1], False)
        if self._losses.trusted(now):
            self.gate.members.check_silence(now)

    def _learn_ids(self) -> None:
        """Wait for the simulator's own robots if there are as many as asked for."""
        self._sim_seen = False
        try:
            answer = self._node.bus.ask(names.service_key(names.SIMULATOR, "status"), SimStatus)
        except BusError as error:
            log.debug("%s", error)
            return
        with self._node.changed:
            if len(answer.robots) == self.gate.team_size:
                self.gate.expect(answer.robots)

    def _publish(self) -> None:
        status = self.gate.status(self._node.clock.now())
        known = self._published
        if known is not None:
            status.header = known.header
        if status != known:
            self._published = status
            self._publisher.put(status)


def sentence(event: Event) -> str:
    """An event as a line for a user."""
    subject = "" if event.robot is None else f"{names.robot_name(event.robot)} "
    return f"{subject}{event.text}"


def print_event(event: Event) -> None:
    """Print one line for a user."""
    print(sentence(event), flush=True)  # noqa: T201


def print_json(event: Event) -> None:
    """Print one JSON object: {"event", "robot" (or null), "text"}."""
    line = {"event": event.kind, "robot": event.robot, "text": event.text}
    print(msgspec.json.encode(line).decode(), flush=True)  # noqa: T201


def run_monitor(node: Node, options: MonitorOptions) -> None:
    """Be the monitor until asked to stop, or until GO with `exit_on_go`."""
    live = sys.stdout.isatty() and not options.json and not options.exit_on_go
    if live:
        from zteam.nodes.monitor.live_table import LiveTable

        with LiveTable() as table:
            monitor = Monitor(node, options, table.show)
            table.watch(node, monitor.gate)
            node.become_present()
            monitor.run()
        return
    monitor = Monitor(node, options, print_json if options.json else print_event)
    node.become_present()
    monitor.run()
