"""Which sessions have commanded a robot of late."""

from collections import defaultdict

RECENT = 5.0
"""Host seconds after its last command for which a session is still a writer."""
_MOST = 64
"""Sessions of a robot that are remembered: a sender can invent them."""


class Writers:
    """The sessions that command each robot. Pure."""

    def __init__(self) -> None:
        self._heard: defaultdict[int, dict[str, float]] = defaultdict(dict)
        """The last host time, by robot and session."""

    def take(self, robot_id: int, session: str, now: float) -> None:
        """A command of the robot came from `session` at host time `now`."""
        heard = self._heard[robot_id]
        if session in heard or len(heard) < _MOST:
            heard[session] = now

    def recent(self, now: float) -> dict[int, set[str]]:
        """The sessions that were heard of late, by robot."""
        for robot_id, heard in self._heard.items():
            self._heard[robot_id] = {session: at for session, at in heard.items() if now - at <= RECENT}
        return {robot_id: {*heard} for robot_id, heard in self._heard.items() if heard}
