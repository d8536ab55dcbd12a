"""A monitor on a bus in memory that runs when the test lets it, robots as it sees them, and its host clock by hand."""

import threading
from collections.abc import Callable

from support.cuttable_transport import cut_bus
from support.limits import LIMIT
from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.bus.presence import own_info
from zteam.errors import ZteamError
from zteam.messages import RobotState, RobotStatus, TeamStatus
from zteam.monitor.process.display import Lines
from zteam.monitor.process.node import Monitor
from zteam.monitor.process.start_gate import Event
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import MonitorOptions
from zteam.node.shutdown import Stop

FLICKER, LOSS, RETURNED = 0.1, 1.0, 2.9
"""Host seconds: a token that is gone for FLICKER is no loss, one that is gone for LOSS is lost; after RETURNED
all processes have found a router that is back."""


class HostTime:
    """The monitor's host clock, set by the test."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


class Robot:
    """A robot process as the monitor sees it."""

    def __init__(self, hub: MemoryHub, robot_id: int, *, present: bool = True, answers: bool = True) -> None:
        self.id = robot_id
        self._bus = hub.bus()
        self._status = self._bus.publisher(names.robot_key(robot_id, names.STATUS), RobotStatus)
        if answers:
            name = names.robot_name(robot_id)
            self._bus.serve(names.info_key(name), NoRequest, lambda _: own_info(name, self._bus.instance, 0))
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


class Shown(Lines):
    """An output that keeps the events."""

    def __init__(self) -> None:
        self.events: list[Event] = []

    def show(self, event: Event) -> None:
        """Keep an event."""
        self.events.append(event)


class Desk:
    """A monitor, and what it shows and publishes. Its main loop goes on while the test is in `look`, and only then."""

    def __init__(self, hub: MemoryHub, time: HostTime, options: MonitorOptions, output: Lines | None = None) -> None:
        self._time = time
        self._shown = Shown()
        self._output = output or self._shown
        self.published: list[TeamStatus] = []
        bus, self.link = cut_bus(hub)
        self.stop = Stop()
        self.node = ProcessNode(names.MONITOR, bus, self.stop)
        self._node_wait = self.node.wait
        self.node.wait = self._wait  # type: ignore[method-assign]
        hub.bus().subscribe(names.TEAM_STATUS, TeamStatus, lambda _, status: self.published.append(status))
        self.monitor = Monitor(self.node, options)
        self.ended = False
        self.failure: ZteamError | None = None
        """What ended the monitor, if that was an error for users."""
        self._idle, self._may_go_on = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        assert self._idle.wait(LIMIT)

    def _run(self) -> None:
        try:
            self.monitor.run(self._output)
        except ZteamError as error:
            self.failure = error
        finally:
            self.ended = True
            self._idle.set()

    def _wait(self, ready: Callable[[], bool], _timeout: float) -> bool:
        """Instead of `Node.wait`: where there is no work, the next round is that of the next `look`."""
        if not ready() and not self.stop.requested:
            self._idle.set()
            self._may_go_on.wait()
            self._may_go_on.clear()
        return self._node_wait(ready, 0.0)

    def look(self) -> None:
        """Return when the monitor has looked at, and told, everything that happened until now."""
        if not self.ended:
            self._idle.clear()
            self._may_go_on.set()
            assert self._idle.wait(LIMIT)

    def pass_by(self, seconds: float) -> None:
        """Let host time pass, and the monitor look at what that means."""
        self._time.now += seconds
        self.look()

    @property
    def events(self) -> list[Event]:
        """All that it has shown so far; it looks first."""
        self.look()
        return self._shown.events

    def event(self, kind: str, robot: int | None = None) -> Event:
        """The first event of this kind about this robot."""
        return next(e for e in self.events if (e.kind, e.robot) == (kind, robot))

    def told(self, *kinds: str) -> list[tuple[str, int | None]]:
        """(kind, robot) of the events of these kinds so far."""
        return [(e.kind, e.robot) for e in self.events if e.kind in kinds]

    def end(self) -> None:
        """Stop the monitor and wait for it."""
        self.stop.request("test over")
        self._may_go_on.set()
        self._thread.join(LIMIT)
        self.node.close()
        assert not self._thread.is_alive()


Open = Callable[..., Desk]
