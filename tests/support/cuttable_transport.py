"""A bus in memory whose link to the router can be cut, for tests of what processes do then."""

from collections.abc import Callable

from zteam.bus import Bus, MemoryHub
from zteam.bus.memory import MemoryTransport


class CutTransport(MemoryTransport):
    """Tells its watchers of a link that the test takes away and gives back; tokens are the test's to close."""

    def __init__(self, hub: MemoryHub) -> None:
        super().__init__(hub)
        self._watchers: list[Callable[[bool], None]] = []

    def watch_link(self, handler: Callable[[bool], None]) -> None:
        self._watchers.append(handler)

    def set_link(self, up: bool) -> None:
        """Lose the router, or have it back."""
        for handler in self._watchers:
            handler(up)


def cut_bus(hub: MemoryHub) -> tuple[Bus, CutTransport]:
    """A session on the hub and the hand on its link."""
    transport = CutTransport(hub)
    return Bus(transport), transport
