"""The way to one robot's wheels: through its process, or straight to the base where it has none."""

import logging

from zteam import names
from zteam.bus import Bus
from zteam.bus.presence import Claim
from zteam.bus.transport import Closeable
from zteam.errors import DuplicateNameError, ZteamError
from zteam.messages import RobotStatus, Twist
from zteam.node.shutdown import Stop
from zteam.node.stopping import StopSwitch, ask_stopped
from zteam.simulator.client import absence_of

log = logging.getLogger("zteam")


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
        self._began_stopped = False
        """Whether the robot's process said at the start that the robot is stopped."""

    def take(self) -> None:
        """Find out whether the robot has a process; if not, be it. Raises ZteamError if its world lacks the robot."""
        try:
            self._claim.win(lambda holder: self._give_way(holder.pid, holder.host))
        except DuplicateNameError:
            self._key = names.robot_key(self._id, names.CMD_VEL_TELEOP)
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
        self._publisher = self._bus.publisher(self._key, Twist)
        self._open.append(self._publisher)
        if self.direct:
            self._switch = StopSwitch(self._bus, self._id, lambda: self.drive(Twist()))
            self._claim.under_name.append(self._switch)
            self._switch.learn()

    def _give_way(self, pid: int, host: str) -> None:
        log.error("%s is also held by process %d on %s, which is older: stopping", self.name, pid, host)
        self._stop.request("another process holds the name")

    def _on_status(self, _key: str, status: RobotStatus) -> None:
        self.status = status

    def _on_driven(self, _key: str, command: Twist) -> None:
        self.driven = command

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
        """Send a command; zero where the robot has no process and is stopped."""
        self.command = command
        is_held = self._switch is not None and self._switch.is_stopped
        self._publisher.put(Twist() if is_held else command)

    def close(self) -> None:
        """Give the name back, and send nothing more."""
        if self.direct:
            self._claim.release()
        for handle in self._open:
            handle.close()
