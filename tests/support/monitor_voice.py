"""A monitor's messages without a monitor."""

from zteam import names
from zteam.bus import Bus
from zteam.messages import TeamStatus, time_from_ns


class MonitorVoice:
    """Publishes the team's state in place of a monitor."""

    def __init__(self, bus: Bus) -> None:
        self._status = bus.publisher(names.TEAM_STATUS, TeamStatus, latched=True)

    def status(self, state: int, go_ns: int = 0) -> None:
        """Publish a state; `go_ns` is the simulated time of GO."""
        self._status.put(TeamStatus(state=state, epoch=1, go_stamp=time_from_ns(go_ns)))
