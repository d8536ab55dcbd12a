"""The router of a team: how the launcher, the `team` fixture and the benchmarks start one and learn its endpoint."""

from collections.abc import Callable

from zteam.bus.options import LEASE
from zteam.launch.kinds import ROUTER_KIND
from zteam.launch.process import Process
from zteam.launch.supervisor import Supervisor

ANY_PORT = "tcp/127.0.0.1:0"


def start_router(supervisor: Supervisor, listen: str = ANY_PORT, lease: float = LEASE) -> Process:
    """Start a router that prints its endpoint when it listens; clients bear `lease` host seconds of its silence."""
    arguments = ("--listen", listen, "--announce", "--lease", str(lease))
    return supervisor.start(ROUTER_KIND.name, ROUTER_KIND.command_line(*arguments))


def wait_for_endpoint(
    supervisor: Supervisor, router: Process, timeout: float, stopped: Callable[[], bool] = lambda: False
) -> str:
    """The endpoint that the router prints; empty if it ends, if `timeout` host seconds pass, or if `stopped()`."""
    supervisor.wait(lambda: stopped() or not router.running or bool(_endpoint(router)), timeout)
    return _endpoint(router)


def _endpoint(router: Process) -> str:
    # A copy, because a thread appends lines. Lines of the router's log begin with the time.
    return next((line for line in list(router.lines) if line.startswith(("tcp/", "tls/"))), "")
