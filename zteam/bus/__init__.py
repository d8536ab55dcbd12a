"""Sessions, typed publishers and subscribers, presence and queries. Only this package imports zenoh."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from zteam.bus.bus import Bus, Change, Deferred, NoRequest, Publisher
    from zteam.bus.connection import connect
    from zteam.bus.memory import MemoryHub
    from zteam.bus.options import BusOptions

_HOME = {"BusOptions": "options", "MemoryHub": "memory", "connect": "connection"}
"""Where these are; the rest is in `bus`."""

__all__ = ["Bus", "BusOptions", "Change", "Deferred", "MemoryHub", "NoRequest", "Publisher", "connect"]


def __getattr__(name: str) -> Any:
    # Lazy: the router needs neither messages nor numpy, and starts twice as fast without them.
    if name not in __all__:
        raise AttributeError(f"module 'zteam.bus' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"zteam.bus.{_HOME.get(name, 'bus')}"), name)
