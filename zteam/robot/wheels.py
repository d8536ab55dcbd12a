"""The way to one robot's wheels: through its process, or straight to the base where it has none.

Of several that drive one robot the one drives whose key was pressed last; the others give way.
"""

import threading

from zteam import names
from zteam.bus import Bus
from zteam.bus.graph import describe_sessions
from zteam.bus.presence import Claim
from zteam.bus.transport import Closeable
from zteam.clock import monotonic
from zteam.errors import DuplicateNameError, ZteamError, log
from zteam.messages import RobotStatus, Twist
from zteam.node.shutdown import Stop
from zteam.node.stopping import StopSwitch, ask_stopped
from zteam.simulator.client import absence_of

GAP = 0.5
"""Host seconds without a command after which a sender has let go of the robot, as for its mux."""
_MOST = 16
"""Senders that are remembered: a sender can invent sessions."""


class Turn:
    """Whose turn it is to drive a robot. Pure: it is told the host's time.

    Commands have no key in them. A key of another sender was pressed when its commands begin, or begin to move. One
    that moves the robot while this one has been idle for GAP drives in any case.
    """

    def __init__(self, now: float) -> None:
        """Others are heard from host time `now` on."""
        self.other = ""
        """The session that drives instead of this one; empty while this one may."""
        self._since, self._idle_since = now, now
        self._heard: dict[str, tuple[float, bool]] = {}
        """Of each other sender: when its last command came, and whether that moves the robot."""

    def hear(self, session: str, command: Twist, now: float) -> bool:
        """A command of another sender came; whether this one gives way to it from now on."""
        if session not in self._heard and len(self._heard) >= _MOST:
            return False
        moves = command != Twist()
        # One that is heard as soon as this one listens was there before.
        last, moved = self._heard.get(session, (self._since, moves))
        self._heard[session] = now, moves
        begins = now - last >= GAP or (moves and not moved)
        if session == self.other or not (begins or (moves and now - self._idle_since >= GAP)):
            return False
        self.other = session
        return True

    def take(self, now: float) -> None:
        """A key of this one was pressed: it drives."""
        self.other, self._idle_since = "", now

    def command(self, command: Twist, now: float) -> bool:
        """A command of this one is due; whether to send it."""
        if command != Twist():
            self._idle_since = now
        return not self.other

    def rivals(self, now: float) -> list[str]:
        """The other sessions that command the robot now."""
        return sorted(session for session, (last, _) in self._heard.items() if now - last < GAP)


class Wheels:
    """Of robot `robot_id`. Made first for all robots, then taken: the waits of all claims are one."""

    direct = False
    """Whether the commands go to the base, under the robot's own name."""

    def __init__(self, bus: Bus, robot_id: int, stop: Stop) -> None:
        self._bus = bus
        self._id = robot_id
        self.name = names.robot_name(robot_id)
        self.status: RobotStatus | None = None
        """The newest of the robot's process."""
        self.command = Twist()
        """The newest that was sent."""
        self.driven = Twist()
        """The newest that the robot's process has sent to its base."""
        self._stop = stop
        self._open: list[Closeable] = []
        self._claim = Claim(bus, self.name)
        self._switch: StopSwitch | None = None
        """Of a robot without a process."""
        self._turn, self._lock = Turn(monotonic()), threading.Lock()
        self._senders: dict[str, str] = {}
        """What people read for other senders, by session."""
        self._began_stopped = False
        """Whether the robot's process said at the start that the robot is stopped."""

    def take(self) -> None:
        """Find out whether the robot has a process; if not, be it. Raises ZteamError if its world lacks the robot."""
        teleop = names.robot_key(self._id, names.CMD_VEL_TELEOP)
        try:
            self._claim.win(self._stop.request)
        except DuplicateNameError:
            self._key = teleop
            self._bus.check_right(self._key)
            self._open = [
                self._bus.subscribe(names.robot_key(self._id, names.STATUS), RobotStatus, self._on_status),
                self._bus.subscribe(names.robot_key(self._id, names.CMD_VEL), Twist, self._on_driven),
            ]
            # Its next status may come after the end of a short script.
            self._began_stopped = any(reply.is_stopped for _, reply in ask_stopped(self._bus, self.name))
        else:
            self.direct, self._key = True, names.robot_key(self._id, names.CMD_VEL)
            self._claim.under_name.append(self._bus.serve_stats(self.name))
            if absence := absence_of(self._bus, self._id):
                raise ZteamError(absence)
            log.warning("%s has no process: driving its base directly, without a safety layer", self.name)
        self._publisher = self._bus.publisher(self._key, Twist, to_others=True)
        self._open.append(self._publisher)
        # Where this drives the base itself, it takes the commands of others as the robot's process would.
        self._open.append(self._bus.subscribe_from(teleop, Twist, self._on_other))
        if self.direct:
            self._switch = StopSwitch(self._bus, self._id, lambda: self.drive(Twist()))
            self._claim.under_name.append(self._switch)
            self._switch.learn()

    def _on_status(self, _key: str, status: RobotStatus) -> None:
        self.status = status

    def _on_driven(self, _key: str, command: Twist) -> None:
        self.driven = command

    def _on_other(self, _key: str, command: Twist, session: str) -> None:
        if session == self._bus.instance:
            return
        with self._lock:
            gives_way = self._turn.hear(session, command, monotonic())
            forwards = self.direct and self._turn.other == session
        if forwards and not self.is_stopped:
            self._publisher.put(command)
        if gives_way:
            # It asks the session what it is, which a thread of the bus must not wait for.
            threading.Thread(target=self._log_sender, args=(session,), name="sender", daemon=True).start()

    def _log_sender(self, session: str) -> None:
        self._senders |= describe_sessions(self._bus, [session])
        sender = self._senders.get(session, f"session {session}")
        log.warning("%s: driven by %s from now on; a key takes it back", self.name, sender)

    def press(self) -> None:
        """A key was pressed here: from now on this one drives."""
        with self._lock:
            self._turn.take(monotonic())

    @property
    def gives_way(self) -> bool:
        """Whether another one drives the robot, and what this one commands is not sent."""
        return bool(self._turn.other)

    @property
    def others(self) -> list[str]:
        """The others that command the robot now, in words."""
        with self._lock:
            found = self._turn.rivals(monotonic())
        return [self._senders.get(session, f"session {session}") for session in found]

    @property
    def unheard(self) -> str:
        """The key that nothing subscribes to; empty if the commands are heard."""
        return "" if self._publisher.has_subscribers else self._key

    @property
    def is_stopped(self) -> bool:
        """Whether the robot is stopped: nothing drives it then."""
        if self._switch is not None:
            return self._switch.is_stopped
        return self._began_stopped if self.status is None else self.status.is_stopped

    def drive(self, command: Twist) -> None:
        """Send a command, unless another one drives; zero where the robot has no process and is stopped."""
        self.command = command
        with self._lock:
            drives = self._turn.command(command, monotonic())
        is_held = self._switch is not None and self._switch.is_stopped
        if drives or is_held:
            self._publisher.put(Twist() if is_held else command)

    def close(self) -> None:
        """Give the name back, and send nothing more."""
        if self.direct:
            self._claim.release()
        for handle in self._open:
            handle.close()
