"""The bus of a team in one process: each node has a session of its own on one MemoryHub."""

from zteam.bus import Bus, MemoryHub
from zteam.bus.memory import MemoryTransport
from zteam.bus.transport import Closeable, QueryHandler
from zteam.clock import monotonic_times
from zteam.in_process.bridge import Bridge, new_instance
from zteam.in_process.delivery import Delivery, answering_as


class TeamHub:
    """Opens the sessions of the nodes."""

    def __init__(self, outside: Bus | None = None) -> None:
        """With `outside`, a session of this process alone, nodes and processes there find each other."""
        self.delivery = Delivery()
        self._hub = MemoryHub(self.delivery.deliver, None if outside is None else monotonic_times())
        inside = MemoryTransport(self._hub)
        self._bridge = None if outside is None else Bridge(inside, outside, self.delivery)

    def bus(self, owner: str) -> Bus:
        """A session of the node `owner`."""
        bridge = self._bridge
        if bridge is None:
            return Bus(_Session(self._hub, owner))
        return Bus(bridge.open(_Session(self._hub, owner, new_instance()), owner))

    def close(self) -> None:
        """Handle no more messages."""
        self.delivery.close()


class _Session(MemoryTransport):
    """The session of one node."""

    def declare_queryable(self, key: str, handler: QueryHandler) -> Closeable:
        return super().declare_queryable(key, answering_as(self._owner, handler))
