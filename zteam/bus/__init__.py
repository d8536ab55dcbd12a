"""Sessions, typed publishers and subscribers, presence and queries. Only this package imports zenoh."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from zteam.bus.bus import Bus, Publisher
    from zteam.bus.connection import connect
    from zteam.bus.memory import MemoryHub
    from zteam.bus.options import BusOptions
    from zteam.bus.queries import Change, Deferred, NoRequest

_HOME = {
    "Bus": "bus",
    "BusOptions": "options",
    "Change": "queries",
    "Deferred": "queries",
    "MemoryHub": "memory",
    "NoRequest": "queries",
    "Publisher": "bus",
    "connect": "connection",
}

__all__ = ["Bus", "BusOptions", "Change", "Deferred", "MemoryHub", "NoRequest", "Publisher", "connect"]


def __getattr__(name: str) -> Any:
    # Lazy: the router needs neither messages nor numpy, and starts twice as fast without them.
    if name not in _HOME:
        raise AttributeError(f"module 'zteam.bus' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"zteam.bus.{_HOME[name]}"), name)
