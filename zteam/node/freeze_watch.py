"""A process that was frozen logs that itself, and no other process is blamed for what it missed (`clock.Freezes`)."""

import logging
import threading
from collections.abc import Callable

from zteam.clock import FREEZE_WATCH, FREEZES, wait_until

log = logging.getLogger("zteam")

_changed = threading.Condition()
_users = 0
"""The nodes of this process that are open."""
_watch: object = None
"""Stands for the thread that watches; None without one."""


def watch_freezes() -> Callable[[], None]:
    """Watch this process from now on; returns a function, to be called once, that ends this. Several nodes share it."""
    global _users, _watch
    with _changed:
        _users += 1
        if _users == 1:
            FREEZES.begin()
            _watch = object()
            threading.Thread(target=_run, args=(_watch,), name="freezes", daemon=True).start()
    return _leave


def _leave() -> None:
    global _users, _watch
    with _changed:
        _users -= 1
        if _users == 0:
            _watch = None
            FREEZES.end()
        _changed.notify_all()


def _run(watch: object) -> None:
    while True:
        with _changed:
            if wait_until(_changed, lambda: _watch is not watch, FREEZE_WATCH):
                return
        if seconds := FREEZES.take():
            log.warning(
                "was frozen for %.1f s (SIGSTOP, docker pause, a suspended or overloaded machine): "
                "what it missed says nothing about the other processes",
                seconds,
            )
