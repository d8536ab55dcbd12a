"""Which sessions have declared publishers and subscribers: what the routers tell of it in Zenoh's admin space.

A session itself learns only whether its own publisher has a subscriber.
"""

import logging

import msgspec
import zenoh

from zteam.bus.options import BusOptions, client_config, open_session
from zteam.bus.transport import Declaration

log = logging.getLogger("zteam.bus")

_TIMEOUT = 1.0
"""Host seconds that the routers have for their answers."""


class _Sources(msgspec.Struct):
    """The sessions that declared one key, as a router lists them; each appears at its own router."""

    peers: list[str] = []
    clients: list[str] = []


def read_declarations(options: BusOptions) -> list[Declaration] | None:
    """All publishers and subscribers in the namespace of `options`; None if no router tells of them.

    They are read through a session of its own without a namespace: one with a namespace gets no answer.
    """
    namespace = f"{options.namespace}/" if options.namespace else ""
    try:
        session = open_session(client_config(msgspec.structs.replace(options, namespace=None)), "small")
    except zenoh.ZError as error:
        log.debug("open: %s", error)
        return None
    try:
        if not any(reply.ok for reply in session.get("@/*/router", timeout=_TIMEOUT)):
            return None
        return [
            declaration
            for kind in ("publisher", "subscriber")
            for reply in session.get(f"@/*/router/{kind}/**", timeout=_TIMEOUT)
            if reply.ok is not None
            for declaration in _read(str(reply.ok.key_expr), reply.ok.payload.to_bytes(), kind, namespace)
        ]
    finally:
        session.close()  # type: ignore[no-untyped-call]


def _read(admin_key: str, payload: bytes, kind: str, namespace: str) -> list[Declaration]:
    """The declarations in one answer, which is about `@/<router>/router/<kind>/<key>`."""
    key = _without(namespace, admin_key.partition(f"/router/{kind}/")[2])
    # A part with an @ is Zenoh's own, such as the caches of latched publishers.
    if not key or any(part.startswith("@") for part in key.split("/")):
        return []
    try:
        sources = msgspec.json.decode(payload, type=_Sources)
    except msgspec.DecodeError as error:
        log.debug("admin space: %s: %s", admin_key, error)
        return []
    return [Declaration(key, session, kind == "publisher") for session in (*sources.clients, *sources.peers)]


def _without(namespace: str, key: str) -> str:
    """The key as the sessions of the namespace see it; empty for one that is not theirs."""
    if key.startswith("**"):
        return key
    return key.removeprefix(namespace) if key.startswith(namespace) else ""
