"""One page: what it looks at, what it has, and whether it may be sent the next frame. Pure."""

from zteam.nodes.web.requests import MAX_WATCHES, Ack, Look, Unwatch, Watch

PERIOD, FAST_PERIOD = 0.05, 0.1
"""Host seconds between two frames of one page, at least; the second one where time runs fast, to slow that run less."""


class Viewer:
    """The caller passes the host's time."""

    def __init__(self, number: int, may_command: bool) -> None:
        self.number, self.may_command = number, may_command
        self.look = Look()
        self.watches: dict[Watch, int] = {}
        """What it watches, with the number of the newest message that it has of it."""
        self.has: dict[object, object] = {}
        """What the page has of each thing, such as the number of the scan of a key."""
        self.log_number = 0
        """Of the newest line of logs that it has."""
        self.lacks_tiles = False
        """Whether tiles of grids are left that did not fit into the newest frame."""
        self.frame = 0
        """The number of the newest frame that was sent."""
        self.sent = float("-inf")
        """Host time of that frame."""
        self._acknowledged = 0

    @property
    def has_credit(self) -> bool:
        """Whether it has taken all frames that were sent."""
        return self._acknowledged == self.frame

    def take_ack(self, ack: Ack) -> None:
        """It has taken a frame. One that it was never sent changes nothing."""
        if ack.frame == self.frame:
            self._acknowledged = ack.frame

    def take_watch(self, watch: Watch) -> str:
        """It watches a topic from now on; why not, if it watches too many."""
        if watch not in self.watches and len(self.watches) >= MAX_WATCHES:
            return f"a page watches {MAX_WATCHES} topics at most"
        self.watches.setdefault(watch, 0)
        return ""

    def take_unwatch(self, unwatch: Unwatch) -> None:
        """It watches a topic no more."""
        self.watches.pop(Watch(unwatch.topic, unwatch.field), None)

    def next_frame(self, now: float) -> int:
        """Count a frame that is sent now; its number."""
        self.frame += 1
        self.sent = now
        return self.frame

    def lacks(self, thing: object, version: object) -> bool:
        """Whether it has another version of a thing, or none; from now on it has this one."""
        if self.has.get(thing) == version:
            return False
        self.has[thing] = version
        return True

    def sees(self, x: float, y: float) -> bool:
        """Whether a point of `map` is in its viewport."""
        view = self.look.viewport
        return not view or (view[0] <= x <= view[2] and view[1] <= y <= view[3])
