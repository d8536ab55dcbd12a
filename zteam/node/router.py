"""The router process. `python -m zteam.node.router ENDPOINT LEASE` is the one on demand (`spawn_router`)."""

import logging
import os
import sys

from zteam.bus.options import RouterOptions
from zteam.bus.router import IDLE_EXIT, Router, detach, open_team_router
from zteam.errors import ZteamError
from zteam.node.logs import start_logging
from zteam.node.ps_name import show_name
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


if __name__ == "__main__":
    show_name("zteam-router")
    start_logging("router")
    try:
        run_router(RouterOptions((sys.argv[1],), lease=float(sys.argv[2]), idle_exit=IDLE_EXIT))
    except ZteamError as error:
        log.error("%s", error)
    logging.shutdown()
    # A thread of Zenoh's may still run, and would abort a process that takes its interpreter apart.
    os._exit(0)
