"""A running monitor on a bus in memory, robots as it sees them, and its host clock set by hand."""

import threading
from collections.abc import Callable

from support.cuttable_transport import cut_bus
from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.clock import wait_until
from zteam.errors import ZteamError
from zteam.messages import RobotState, RobotStatus, TeamStatus
from zteam.nodes.monitor.display import Lines, MonitorOptions
from zteam.nodes.monitor.members import Event
from zteam.nodes.monitor.node import Monitor
from zteam.runtime.node import Node
from zteam.runtime.shutdown import Stop
from zteam.services.simulator import SimStatus

LIMIT = 20.0
"""Host seconds after which a wait has failed."""
FLICKER, LOSS, RETURN = 0.1, 1.0, 10.0
"""Host seconds: a token that is gone for FLICKER is no loss, one that is gone for LOSS is lost; after RETURN all
processes have found a router that is back."""
SCOUT = 99
"""A robot outside of every team: the monitor has told its fault when it has handled all that happened before."""


class HostTime:
    """The monitor's host clock, set by the test."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


class Robot:
    """A robot process as the monitor sees it."""

    def __init__(self, hub: MemoryHub, robot_id: int, *, present: bool = True) -> None:
        self.id = robot_id
        self._bus = hub.bus()
        self._status = self._bus.publisher(names.robot_key(robot_id, names.STATUS), RobotStatus)
        if present:
            self.appear()

    def appear(self) -> None:
        """Hold the name (again)."""
        self._token = self._bus.declare_token(names.token_key(names.robot_name(self.id), self._bus.instance))

    def vanish(self) -> None:
        """The token goes."""
        self._token.close()

    def say(self, state: int = RobotState.READY, epoch: int = 0, text: str = "") -> None:
        """Publish a status."""
        ready = state in (RobotState.READY, RobotState.RUNNING)
        self._status.put(RobotStatus(robot_id=self.id, is_ready=ready, state=state, epoch=epoch, text=text))


class Desk:
    """A running monitor, and what it shows and publishes."""

    def __init__(self, hub: MemoryHub, time: HostTime, options: MonitorOptions) -> None:
        self.hub = hub
        self.time = time
        self.changed = threading.Condition(threading.RLock())
        self.events: list[Event] = []
        self.published: list[TeamStatus] = []
        self.free: list[bool] = []
        """For each event, whether `node.changed` was free while it was shown."""
        bus, self.link = cut_bus(hub)
        self.stop = Stop()
        self.node = Node(names.MONITOR, bus, self.stop)
        hub.bus().subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status)
        self.monitor = Monitor(self.node, options)
        self.failure: ZteamError | None = None
        """What ended the monitor, if that was an error for users."""
        self.thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        try:
            self.monitor.run(_Shown(self))
        except ZteamError as error:
            self.failure = error

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        with self.changed:
            self.published.append(status)
            self.changed.notify_all()

    def show(self, event: Event) -> None:
        """Note an event, and whether the node's lock is free."""
        probe = threading.Thread(target=self._try_lock)
        probe.start()
        probe.join()
        with self.changed:
            self.events.append(event)
            self.changed.notify_all()

    def _try_lock(self) -> None:
        free = self.node.changed.acquire(blocking=False)
        if free:
            self.node.changed.release()
        self.free.append(free)

    def wait(self, condition: Callable[[], bool]) -> None:
        """Wait until something shown or published makes it true."""
        with self.changed:
            assert wait_until(self.changed, condition, LIMIT), (self.events, self.published[-1:])

    def wait_for(self, kind: str, robot: int | None = None) -> Event:
        """Wait for an event of this kind about this robot."""
        self.wait(lambda: any((e.kind, e.robot) == (kind, robot) for e in self.events))
        return next(e for e in self.events if (e.kind, e.robot) == (kind, robot))

    def pass_by(self, seconds: float) -> None:
        """Let host time pass, and the monitor look at what that means."""
        self.time.now += seconds
        self.look()

    def look(self) -> None:
        """Return when the monitor has looked at, and told, everything that happened until now."""
        # A robot outside of the team is at fault twice. What the monitor tells in the round of the first time may
        # come after it; the second time is told in a later round.
        for _ in range(2):
            with self.changed:
                seen = self.told("fault").count(("fault", SCOUT))
            scout = Robot(self.hub, SCOUT, present=False)
            scout.say(RobotState.BOOT)
            scout.say(RobotState.FAULT)
            self.wait(lambda before=seen: self.told("fault").count(("fault", SCOUT)) > before)  # type: ignore[misc]

    def told(self, *kinds: str) -> list[tuple[str, int | None]]:
        """(kind, robot) of the events of these kinds so far."""
        with self.changed:
            return [(e.kind, e.robot) for e in self.events if e.kind in kinds]

    def end(self) -> None:
        """Stop the monitor and wait for it."""
        self.stop.request("test over")
        if self.thread.ident is not None:
            self.thread.join(LIMIT)
        self.node.close()
        assert not self.thread.is_alive()


class _Shown(Lines):
    """An output that the desk notes."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk

    def show(self, event: Event) -> None:
        """Note an event."""
        self._desk.show(event)


Open = Callable[..., Desk]


def serve_simulator(hub: MemoryHub, robots: list[int]) -> None:
    """A simulator with these robots appears."""
    bus = hub.bus()
    answer = SimStatus("w", robots, 100, 1, 0, 0, 1.0)
    bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: answer)
    bus.declare_token(names.token_key(names.SIMULATOR, bus.instance))
