"""Where tools find a team in one process: at a router, in this process's session there, under the launcher's name."""

from collections.abc import Iterable
from contextlib import ExitStack

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.router import Router
from zteam.errors import BusError
from zteam.launch.kinds import Pace
from zteam.launch.namespace import claim_namespace, refuse_second_team
from zteam.launch.router import ANY_PORT
from zteam.launch.run import ROUTER_DEADLINE, choose_endpoint, lease_for, node_environment, warn_of_endpoint
from zteam.runtime.logs import LogPublisher
from zteam.runtime.shutdown import Stop


class Outside:
    """Use as: `with Outside(...) as outside:` around the run of the team.

    Without `--connect` the router is one of this process, where `zteam up` has its own as well.
    """

    def __init__(self, options: BusOptions, pace: Pace) -> None:
        self._connect = options.connect
        self._options, self._pace = options, pace
        self._ends = ExitStack()
        self._held = ExitStack()
        with ExitStack() as ends:
            lease = lease_for(pace, options.lease)
            self.endpoint = options.connect or _open_router(ends, lease)
            reached = msgspec.structs.replace(options, connect=self.endpoint, lease=lease, small=False)
            self.bus = connect(reached, patience=ROUTER_DEADLINE)
            ends.callback(self.bus.close)
            self._ends = ends.pop_all()

    @property
    def environment(self) -> dict[str, str]:
        """What lets a process join the team."""
        return node_environment(self.endpoint, self._options, self._pace)

    def hold_namespace(self, bus: Bus, needed: Iterable[str], stop: Stop) -> None:
        """Hold the launcher's name in its session `bus`, and publish its log, until `release`.

        Raises BusError if another team, or a process of one of the names `needed`, is there.
        """
        if self._connect is not None:
            refuse_second_team(bus, needed)
        self._held.callback(claim_namespace(bus, stop).release)
        self._held.callback(LogPublisher(bus, names.LAUNCHER).close)

    def warn_of_endpoint(self) -> None:
        """Say how tools find the router if they do not look there."""
        warn_of_endpoint(self.endpoint, self._connect)

    def release(self) -> None:
        """Give the name back."""
        self._held.close()

    def __enter__(self) -> "Outside":
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.close()


def _open_router(ends: ExitStack, lease: float) -> str:
    """Open a router until `ends`; its endpoint."""
    try:
        router = Router(choose_endpoint(), lease=lease)
    except BusError:
        # Another program took the port after `choose_endpoint` looked: any port will do.
        router = Router(ANY_PORT, lease=lease)
    ends.callback(router.close)
    return router.endpoint
