"""The router process."""

import logging

from zteam.bus.options import RouterOptions
from zteam.bus.router import Router, detach, open_team_router
from zteam.node.shutdown import Stop, exit_hard_later

log = logging.getLogger("zteam")


def run_router(options: RouterOptions, *, for_team: str | None = None, announce: bool = False) -> int:
    """Route until a stop signal; one on demand forks away, and ends when it is idle. The router of a team that `starts`
    or `returns` gets its port from one on demand (`open_team_router`). `announce` prints the first endpoint on stdout
    once it listens.
    """
    if options.idle_exit is not None:
        detach()
    stop = Stop()
    stop.install()
    exit_hard_later(stop)
    router = Router(options) if for_team is None else open_team_router(options, returns=for_team == "returns")
    stop.on_request(router.wake)
    try:
        log.info("router at %s", router.endpoint)
        if announce:
            print(router.endpoint, flush=True)  # noqa: T201
        router.run(stop)
    finally:
        router.close()
    return 0
