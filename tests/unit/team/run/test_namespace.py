"""One team in a namespace."""

import threading

import pytest

from support.limits import LIMIT
from zteam.bus.memory import MemoryHub
from zteam.bus.presence import Claim
from zteam.errors import BusError
from zteam.node.shutdown import Stop
from zteam.team.run.processes import claim_namespace, refuse_second_team


def test_a_process_of_the_team_is_named(hub: MemoryHub) -> None:
    """A robot that was started by hand keeps its name, and the launcher tells which process is in the way."""
    claim = Claim(hub.bus(), "robot_0")
    claim.win(lambda _: None)
    refuse_second_team(hub.bus(), ["robot_1"])
    with pytest.raises(BusError, match=r"^robot_0 is already running here \(pid \d+, since .*; stop it"):
        refuse_second_team(hub.bus(), ["robot_0"])


def test_of_two_launchers_at_once_one_stays(hub: MemoryHub) -> None:
    """The launcher claims a name: of two launchers that both found the namespace empty, one is refused."""
    results: list[object] = []

    def claim() -> None:
        try:
            results.append(claim_namespace(hub.bus(), Stop()))
        except BusError as error:
            results.append(str(error))

    threads = [threading.Thread(target=claim) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LIMIT)
    assert sorted(isinstance(result, Claim) for result in results) == [False, True]
    (refused,) = [result for result in results if isinstance(result, str)]
    assert refused.startswith("a team is already running here")
