"""The router process."""

import logging

from zteam.bus.options import RouterOptions
from zteam.bus.router import Router, detach
from zteam.node.shutdown import Stop, exit_hard_later

log = logging.getLogger("zteam")


def run_router(options: RouterOptions, *, detached: float | None = None, announce: bool = False) -> int:
    """Route until a stop signal. `detached` forks away and ends after that many idle seconds; `announce` prints the
    first endpoint (with the real port) on stdout once it listens.
    """
    if detached is not None:
        detach()
    stop = Stop()
    stop.install()
    exit_hard_later(stop)
    router = Router(options)
    stop.on_request(router.wake)
    try:
        log.info("router at %s", router.endpoint)
        if announce:
            print(router.endpoint, flush=True)  # noqa: T201
        router.run(stop, detached)
    finally:
        router.close()
    return 0
