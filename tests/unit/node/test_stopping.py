"""Stop and release: whose queries count, and how a process that begins finds out what holds."""

from collections.abc import Callable

import pytest

from zteam import names
from zteam.bus import Bus, MemoryHub
from zteam.bus.transport import Closeable, QueryHandler
from zteam.errors import BusError
from zteam.node.stopping import EngageRequest, ReleaseRequest, StopReply, StopSwitch, ask_stopped, serve_stop


def stop(bus: Bus, robot_id: int) -> StopReply:
    """Stop a robot by its own key."""
    return bus.ask(names.robot_key(robot_id, names.ENGAGE), StopReply)


def release(bus: Bus, robot_id: int) -> StopReply:
    """Release a robot by its own key."""
    return bus.ask(names.robot_key(robot_id, names.RELEASE), StopReply)


def hold(hub: MemoryHub, robot_id: int, by: str, *, stopped: bool) -> None:
    """Another process that knows whether the robot is stopped."""
    serve_stop(hub.bus(), robot_id, by, lambda: stopped, lambda _: None)


def test_a_robot_is_stopped_and_released_by_its_own_keys(hub: MemoryHub) -> None:
    """A plain query without a request is enough, the answer says what holds now, and a second one changes nothing."""
    changes: list[bool] = []
    switch = StopSwitch(hub.bus(), 1, lambda: changes.append(switch.is_stopped))
    other, bus = StopSwitch(hub.bus(), 2), hub.bus()
    for _ in range(2):
        assert stop(bus, 1) == StopReply("robot_1", True)
    assert (switch.is_stopped, other.is_stopped) == (True, False)
    for _ in range(2):
        assert release(bus, 1) == StopReply("robot_1", False)
    assert (switch.is_stopped, changes) == (False, [True, False])


@pytest.mark.parametrize("key", ["**", "robot_$*/**", "robot_1/stop/*", "*/stop/release", "robot_$*/stop/release"])
def test_of_all_wildcards_one_stops_and_none_releases(hub: MemoryHub, key: str) -> None:
    """A program that asks for all that there is changes nothing; `robot_$*/stop/engage` stops all robots."""
    switches, bus = [StopSwitch(hub.bus(), i) for i in (1, 2)], hub.bus()
    for stopped in (False, True):
        for request in (None, EngageRequest(), ReleaseRequest()):
            try:
                bus.query(key, StopReply, request)
            except BusError:
                # Each of the queries that change something refuses it.
                pass
        assert [switch.is_stopped for switch in switches] == [stopped, stopped]
        bus.query(names.all_robots_key(names.ENGAGE), StopReply, EngageRequest())


@pytest.mark.parametrize(
    ("others", "stopped"),
    [
        ([], False),
        ([(1, "sim", True), (2, "robot_2", False), (2, "sim", False)], True),
        ([(1, "sim", False), (2, "robot_2", True), (2, "sim", True)], False),
        ([(2, "robot_2", False), (3, "robot_3", False)], False),
        ([(2, "robot_2", False), (3, "robot_3", True)], True),
    ],
    ids=["alone", "its body is held", "its body is free", "no teammate is stopped", "a teammate is stopped"],
)
def test_a_process_that_begins_finds_out(hub: MemoryHub, others: list[tuple[int, str, bool]], stopped: bool) -> None:
    """The simulator, which has the body, decides. Without one a robot begins stopped if any teammate is stopped."""
    for robot_id, by, held in others:
        hold(hub, robot_id, by, stopped=held)
    switch = StopSwitch(hub.bus(), 1)
    # Of two that begin together neither goes by the other.
    StopSwitch(hub.bus(), 4)
    assert (switch.is_known, hub.bus().ask("robot_4/stop", StopReply).is_known) == (False, False)
    switch.learn()
    assert (switch.is_known, switch.is_stopped) == (True, stopped)
    assert (1, StopReply("robot_1", stopped)) in ask_stopped(hub.bus(), "robot_1")
    assert ask_stopped(hub.bus(), "robot_4") == []


@pytest.mark.parametrize("change", [stop, release])
def test_a_query_that_comes_meanwhile_counts_more(hub: MemoryHub, change: Callable[[Bus, int], StopReply]) -> None:
    """What the others knew is older than it."""
    wanted, bus = change is stop, hub.bus()

    def is_stopped() -> bool:
        # While the process that begins waits for this answer.
        bus.ask("robot_1/stop/engage" if wanted else "robot_1/stop/release", StopReply)
        return not wanted

    switch = StopSwitch(hub.bus(), 1)
    serve_stop(hub.bus(), 2, "robot_2", is_stopped, lambda _: None)
    switch.learn()
    assert switch.is_stopped is wanted


def test_the_queries_are_declared_anew_when_the_other_process_has_ended(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Linked routers may have forgotten them, as they forget `info` of a claim; after its end it answers no more."""
    declared: list[str] = []
    bus, simulator = hub.bus(), hub.bus()
    switch = StopSwitch(bus, 1)
    token = simulator.declare_token(names.token_key(names.SIMULATOR, simulator.instance))
    declare = bus.transport.declare_queryable

    def spy(key: str, handler: QueryHandler) -> Closeable:
        declared.append(key)
        return declare(key, handler)

    monkeypatch.setattr(bus.transport, "declare_queryable", spy)
    token.close()
    assert declared == ["robot_1/stop", "robot_1/stop/engage", "robot_1/stop/release"]
    assert stop(hub.bus(), 1) == StopReply("robot_1", True)
    switch.close()
    simulator.declare_token(names.token_key(names.SIMULATOR, simulator.instance)).close()
    assert (len(declared), ask_stopped(hub.bus(), "robot_1")) == (3, [])
