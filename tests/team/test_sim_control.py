"""`zteam sim` and rates of simulated time, with a real simulator."""

import json
from typing import Any

import pytest
import zenoh

from support.limits import LIMIT
from zteam import names
from zteam.bus.options import BusOptions, client_config
from zteam.simulator.client import SimulatorClient
from zteam.team.testing.team import TeamFixture
from zteam.tf import FrameInfo

pytestmark = pytest.mark.team


@pytest.mark.real_time
def test_a_look_at_everything_changes_nothing(team: TeamFixture) -> None:
    """A plain client's get("**") reaches every query, whatever its payload; requests for a change are refused, each
    with its reason."""
    team.spawn("zteam-sim", "arena", name="sim")
    team.spawn("zteam-tf", name="tf")
    team.wait_for_processes("sim", "tf")
    client = SimulatorClient(team.bus)
    team.wait_for(lambda: client.status().tick > 3)
    before = client.status()
    plain = zenoh.open(client_config(BusOptions(connect=team.endpoint)))
    refusals = []
    try:
        for payload in (
            None,
            b"",
            b"{}",
            b'{"id": 0}',
            b'{"speed": 5}',
            b'{"id": 0, "x": 1, "y": 1, "ticks": 5}',
            b'{"parent": "map", "child": "table", "caller": "x"}',
        ):
            replies = plain.get("**", payload=payload, target=zenoh.QueryTarget.ALL, timeout=LIMIT)
            refusals += [reply.err.payload.to_string() for reply in replies if reply.err is not None]
    finally:
        plain.close()  # type: ignore[no-untyped-call]
    after = client.status()
    assert (after.robots, after.paused, after.speed) == ([0, 1], False, 1.0)
    assert after.tick >= before.tick
    frames = team.bus.ask(names.service_key(names.AGGREGATOR, "frames"), dict[str, FrameInfo])
    assert "table" not in frames
    for service in ("pause", "resume", "speed", "step", "repeat", "reset", "spawn", "remove", "move"):
        assert any(text.startswith(f"sim/{service} changes something: ask for it by this key") for text in refusals)
    assert any(text.startswith("tf/static changes something: ask for it by this key") for text in refusals)


def test_a_client_of_any_language_changes_the_world(team: TeamFixture) -> None:
    """A request needs no more than the key, also of a simulator that has replaced another one."""
    team.spawn("zteam-sim", "arena", "--paused", name="sim")
    team.wait_for_processes("sim")
    plain = zenoh.open(client_config(BusOptions(connect=team.endpoint, namespace=team.namespace)))

    def ask(service: str, **request: Any) -> tuple[bool, str]:
        (reply,) = plain.get(f"sim/{service}", payload=json.dumps(request), timeout=LIMIT)
        said = reply.ok or reply.err
        assert said is not None
        return reply.ok is not None, said.payload.to_string()

    client = SimulatorClient(team.bus)
    try:
        good, said = ask("remove", id=1)
        assert good
        assert json.loads(said)["robots"] == [0]
        assert client.reset().robots == [0, 1]
        team.restart("sim")
        assert client.remove(1).robots == [0]
        good, said = ask("remove", id=1)
        assert not good
        assert said.startswith("no robot 1 in this world")
    finally:
        plain.close()  # type: ignore[no-untyped-call]
