"""The one Zenoh router of a machine, run from Python."""

import logging
import os
import threading
from collections.abc import Callable
from typing import Any

import msgspec
import zenoh

from zteam.bus.options import LEASE, RELEASE, open_session, router_config
from zteam.clock import monotonic
from zteam.errors import BusError

log = logging.getLogger("zteam.router")


class _Locators(msgspec.Struct):
    locators: list[str]


class Router:
    """An open router; `endpoint` is where it really listens (port 0 becomes the port it got)."""

    def __init__(self, listen: str, config: str | None = None, lease: float = LEASE) -> None:
        try:
            self._session = open_session(router_config(listen, config, lease), "router")
        except zenoh.ZError as error:
            text = str(error)
            if "Address already in use" in text:
                raise BusError(
                    f"{listen} is in use: another router is there (use it), or choose another port with --listen"
                ) from None
            raise BusError(f"cannot listen at {listen}: {text.splitlines()[0]}") from None
        self._clients: set[str] = set()
        self._changed = threading.Condition()
        self._idle_since = monotonic()
        self._idle_exit: float | None = None
        self._events = self._session.info.declare_transport_events_listener(self._on_transport, history=True)
        self.endpoint = self._read_endpoint(listen)

    def _read_endpoint(self, listen: str) -> str:
        for reply in self._session.get(f"@/{self._session.zid()}/router", timeout=1.0):
            if reply.ok is not None:
                locators = msgspec.json.decode(reply.ok.payload.to_bytes(), type=_Locators).locators
                if locators:
                    return locators[0]
        return listen

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        zid = str(event.transport.zid)
        with self._changed:
            if event.kind == zenoh.SampleKind.PUT:
                self._clients.add(zid)
            else:
                self._clients.discard(zid)
                self._idle_since = monotonic()
            self._changed.notify_all()

    def _on_release(self, query: zenoh.Query) -> None:
        """A launcher of this user asks for the port: granted, and then this ends with it, if it is the only client."""
        asker = query.payload.to_bytes() if query.payload else b""
        with query, self._changed:
            if asker == str(os.getuid()).encode() and len(self._clients) == 1:
                self._idle_exit = 0.0
                query.reply(RELEASE, b"")

    def run(self, stopping: Callable[[], bool], idle_exit: float | None = None) -> None:
        """Route until `stopping()`, checked when `wake` is called, or until no client was there for `idle_exit` s."""
        self._idle_exit = idle_exit
        if idle_exit is not None:
            callback: Any = zenoh.handlers.Callback(self._on_release, indirect=False)
            self._session.declare_queryable(RELEASE, callback)
        with self._changed:
            while not stopping():
                left = None
                if self._idle_exit is not None and not self._clients:
                    left = self._idle_since + self._idle_exit - monotonic()
                    if left <= 0:
                        log.info("no client for %g s: the router ends", self._idle_exit)
                        return
                self._changed.wait(left)

    def wake(self) -> None:
        """Let `run` look at `stopping` again."""
        with self._changed:
            self._changed.notify_all()

    def close(self) -> None:
        """Stop routing."""
        self._session.close()  # type: ignore[no-untyped-call]


def detach() -> None:
    """Fork away from the spawner, before Zenoh starts threads; the spawner's half ends here."""
    if os.fork() != 0:
        os._exit(0)
