"""Clients: the parameters of a robot that does not answer; which processes confirm a stop, and which do not."""

from collections.abc import Callable
from functools import partial

import pytest

from support.named_sessions import open_named
from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.bus.transport import TIMED_OUT
from zteam.errors import BusError
from zteam.node.stopping import EngageRequest, StopReply, serve_stop
from zteam.robot.client import CONFIRM_LIMIT, ParametersClient, StopClient, StopResult
from zteam.simulator.client import SimStatus

WITHIN = f"within {CONFIRM_LIMIT:g} s"


def test_a_robot_that_is_not_there_or_does_not_answer_is_named(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """The error names the command that lists the robots, or says what to do next."""
    bus = hub.bus()
    client = ParametersClient(bus)
    assert client.describe_all() == {}
    for act in (client.describe, partial(client.set, parameters={"speed": 0.1})):
        with pytest.raises(BusError, match=r"^no process robot_7 with parameters: 'zteam param list' shows"):
            act("robot_7")
    monkeypatch.setattr(bus.transport, "get", lambda *_: [TIMED_OUT])
    with pytest.raises(BusError, match=r"^robot_1: no answer within 10 s: see 'zteam doctor'$"):
        client.describe("robot_1")
    with pytest.raises(BusError, match=r"^all robots: no answer within 10 s: see 'zteam doctor'$"):
        client.describe_all()


class StoppingTeam:
    """Processes that answer or do not; what each robot was told last."""

    def __init__(self, hub: MemoryHub) -> None:
        self.hub = hub
        self.stopped: dict[tuple[int, str], bool] = {}
        self.client = StopClient(hub.bus())

    def add(self, robot_id: int, by: str = "", *, answers: bool = True) -> None:
        """A robot's process; or the simulator with its body."""
        name = by or names.robot_name(robot_id)
        bus = self.hub.bus() if by else open_named(self.hub, name)
        key = robot_id, name

        def change(stopped: bool) -> None:
            self.stopped[key] = stopped

        if answers:
            serve_stop(bus, robot_id, name, lambda: self.stopped.get(key, False), change)

    def add_simulator(self, *robots: int, answers: bool = True) -> None:
        """One with these robots in its world."""
        bus = open_named(self.hub, names.SIMULATOR)
        if answers:
            status = SimStatus("arena", [*robots], 100, 1, 0, 0, 1.0)
            bus.serve("sim/status", NoRequest, lambda _: status)
            for robot_id in robots:
                self.add(robot_id, names.SIMULATOR)


@pytest.fixture
def team(hub: MemoryHub) -> StoppingTeam:
    """A team without processes."""
    return StoppingTeam(hub)


@pytest.mark.gate
def test_robot_and_simulator_both_confirm(team: StoppingTeam) -> None:
    """Of all robots that are there, with a process or without; then of those that are named alone."""
    team.add_simulator(0, 1, 2)
    team.add(0)
    team.add(1)
    results = team.client.engage()
    assert [(each.robot, each.confirmed, each.is_done) for each in results] == [
        (0, ["robot_0", "sim"], True), (1, ["robot_1", "sim"], True), (2, ["sim"], True),
    ]  # fmt: skip
    assert str(results[0]) == "robot_0: stopped, confirmed by robot_0, sim"
    assert all(team.stopped.values())
    assert [str(each) for each in team.client.release([1])] == ["robot_1: released, confirmed by robot_1, sim"]
    assert {key for key, on in team.stopped.items() if not on} == {(1, "robot_1"), (1, "sim")}
    assert [each.robot for each in team.client.release()] == [0, 1, 2]
    assert not any(team.stopped.values())


@pytest.mark.few(2)
@pytest.mark.parametrize("act", [StopClient.engage, StopClient.release])
@pytest.mark.parametrize("robots", [None, [0, 1, 2, 9]])
def test_what_does_not_confirm_is_named(
    team: StoppingTeam, act: Callable[..., list[StopResult]], robots: list[int] | None
) -> None:
    """A process that is there and does not answer; a base without a process; a robot that is not there."""
    team.add(0)
    team.add(1, answers=False)
    open_named(team.hub, names.base_name(2))
    results = {each.robot: each for each in act(team.client, robots)}
    assert results[0].is_done
    assert str(results[1]) == f"robot_1: not confirmed by robot_1 {WITHIN}"
    assert str(results[2]) == "robot_2: nothing holds it: it has no process, and no simulator has its body"
    assert not any(results[i].is_done for i in (1, 2))
    assert (9 in results) == (robots is not None)
    # A simulator that hangs may have each robot's body.
    team.add_simulator(0, answers=False)
    (result,) = act(team.client, [0])
    assert (result.confirmed, result.missing, result.is_done) == (["robot_0"], ["sim"], False)
    assert str(result) == f"robot_0: confirmed by robot_0; not confirmed by sim {WITHIN}"


@pytest.mark.gate
def test_a_refusal_has_its_reason(team: StoppingTeam) -> None:
    """Such as that of access control."""

    def refuse(_request: EngageRequest) -> StopReply:
        raise BusError("this certificate may not")

    open_named(team.hub, "robot_0").serve("robot_0/stop/engage", EngageRequest, refuse)
    for robots in ([0], None):
        (result,) = team.client.engage(robots)
        assert str(result) == f"robot_0: not confirmed by robot_0 {WITHIN}; this certificate may not"


def test_without_robots_there_is_no_result(team: StoppingTeam) -> None:
    """Neither a process nor a simulator is there."""
    assert team.client.engage() == team.client.release() == []
