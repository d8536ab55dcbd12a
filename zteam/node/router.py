"""The router process. `python -m zteam.node.router ENDPOINT LEASE IDLE_EXIT` is the one on demand (`spawn_router`)."""

import os
import sys

from zteam.bus.options import RouterOptions
from zteam.bus.router import Router, open_team_router
from zteam.errors import ZteamError, log
from zteam.node.launcher import report, take_link
from zteam.node.leaving import leave, show_name
from zteam.node.logs import start_logging
from zteam.node.shutdown import Stop


def run_router(options: RouterOptions, *, announce: bool = False) -> int:
    """Route until a stop signal; one on demand forks away, and ends when it is idle. `announce` prints the first
    endpoint on stdout once it listens.
    """
    # Away from the spawner, whose half ends here, before Zenoh starts threads.
    if options.idle_exit is not None and hasattr(os, "fork") and os.fork() != 0:
        os._exit(0)
    stop = Stop()
    stop.install()
    router = open_team_router(options) if options.for_team else Router(options)
    stop.on_request(router.wake)
    try:
        if take_link() is None:
            # A launcher names it.
            log.info("router at %s", router.endpoint)
        report(listening=router.endpoint)
        if announce:
            print(router.endpoint, flush=True)  # noqa: T201
        router.run(stop)
    finally:
        router.close()
    return 0


if __name__ == "__main__":
    show_name("zteam-router")
    start_logging("router")
    endpoint, lease, idle_exit = sys.argv[1:]
    try:
        leave(run_router(RouterOptions((endpoint,), lease=float(lease), idle_exit=float(idle_exit))))
    except ZteamError as error:
        log.error("%s", error)
        leave(error.exit_code)
