"""One team in a namespace: the launcher holds its name there."""

import logging
from collections.abc import Iterable

from zteam import names
from zteam.bus import Bus
from zteam.bus.presence import Claim, ProcessInfo, find_processes
from zteam.clock import local_time_text
from zteam.errors import BusError, DuplicateNameError
from zteam.node.shutdown import Stop

log = logging.getLogger("zteam")


def claim_namespace(bus: Bus, stop: Stop) -> Claim:
    """Hold the launcher's name until the claim is released. Raises BusError if another launcher holds it.

    Requests the stop if a healed network shows an older launcher.
    """

    def on_rival(info: ProcessInfo) -> None:
        log.error("process %d on %s runs a team here too, and is older: stopping", info.pid, info.host)
        stop.request("another team holds the namespace")

    claim = Claim(bus, names.LAUNCHER)
    try:
        claim.win(on_rival)
    except DuplicateNameError:
        refuse_second_team(bus, ())
        raise
    return claim


def refuse_second_team(bus: Bus, needed: Iterable[str]) -> None:
    """Raise BusError if a launcher, or a process of one of the names `needed`, is in the namespace."""
    found = {info.name: info for info in find_processes(bus)}
    for name in (names.LAUNCHER, *needed):
        if name in found:
            info = found[name]
            what = "a team" if name == names.LAUNCHER else name
            raise BusError(
                f"{what} is already running here (pid {info.pid}, since {local_time_text(info.start)}); "
                "stop it, or use --namespace"
            )
