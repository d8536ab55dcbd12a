"""Which sessions command each robot: two of them fight over its wheels, and neither can see the other."""

RECENT = 5.0
"""Host seconds for which a session counts as a writer after its last command."""
_MAX_SESSIONS = 64
"""Of one robot: a sender can invent sessions."""


class Writers:
    """Sessions heard on `cmd_vel` of late, by robot. Pure: it is told the time."""

    def __init__(self) -> None:
        self._heard: dict[int, dict[str, float]] = {}

    def take(self, robot_id: int, session: str, now: float) -> None:
        """A command for `robot_id` came from `session` at host time `now`."""
        heard = self._heard.setdefault(robot_id, {})
        if session in heard or len(heard) < _MAX_SESSIONS:
            heard[session] = now

    def recent(self, now: float) -> dict[int, set[str]]:
        """The sessions that commanded each robot within the last RECENT seconds; robots without any are left out."""
        for robot_id, heard in list(self._heard.items()):
            self._heard[robot_id] = {session: at for session, at in heard.items() if now - at <= RECENT}
        return {robot_id: set(heard) for robot_id, heard in self._heard.items() if heard}
