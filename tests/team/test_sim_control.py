"""`zteam sim` and rates of simulated time, with a real simulator."""

import json
import math
from typing import Any

import pytest
import zenoh

from support.limits import ASKED, LIMIT
from zteam import names
from zteam.bus.options import BusOptions, client_config
from zteam.simulator.client import SimulatorClient
from zteam.team.testing.team import TeamFixture
from zteam.tf import FrameInfo

pytestmark = pytest.mark.team


def sim(team: TeamFixture, *words: str) -> Any:
    """What `zteam sim WORDS --json` prints; it must end with exit code 0."""
    done = team.command("sim", *words, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.real_time
def test_time_stands_still_and_goes_on_by_the_tick(team: TeamFixture) -> None:
    """A paused world stands still, steps have the exact length, resume lets it go on, and reset starts it again."""
    team.spawn("zteam-sim", "arena", name="sim")
    team.wait_for_processes("sim")
    paused = sim(team, "pause")
    assert paused["paused"]
    assert sim(team, "status")["tick"] == paused["tick"]
    assert sim(team, "step", "3")["tick"] == paused["tick"] + 3
    assert sim(team, "step")["tick"] == paused["tick"] + 4
    # A quarter of an hour of simulated time, in one go.
    far = sim(team, "step", "9000")
    assert far["tick"] == paused["tick"] + 9004
    assert far["now"] == far["tick"] * far["interval"]
    assert far["paused"]

    assert sim(team, "speed", "max")["speed"] is None
    assert not sim(team, "resume")["paused"]
    client = SimulatorClient(team.bus)
    team.wait_for(lambda: client.status().tick > far["tick"] + 10)
    assert sim(team, "pause")["tick"] > far["tick"] + 10
    assert sim(team, "speed", "2.5")["speed"] == 2.5

    again = sim(team, "reset")
    assert (again["tick"], again["paused"]) == (1, True)
    assert sim(team, "step", "3")["tick"] == 4

    table = team.command("sim", "status").stdout.splitlines()
    assert table[:3] == [
        "world             arena, seed 1",
        "time              0.400 s",
        "tick              4, 100 ms each",
    ]


def test_robots_come_move_and_go(team: TeamFixture) -> None:
    """Each command changes the world from the next tick on, and an impossible change ends with one line."""
    team.spawn("zteam-sim", "arena", "--paused", name="sim")
    team.wait_for_processes("sim")
    assert sim(team, "status")["robots"] == [0, 1]
    assert team.command("sim", "spawn", "--pose", "1", "-0.5", "-1e-1").stdout == "2\n"
    assert sim(team, "spawn", "--pose", "3", "0.5", "0", "--id", "7") == {"id": 7}
    moved = team.command("sim", "move", "0", "-0.5", "-1.5", "-0.3")
    assert moved.stdout == "robot 0 is at x -0.5, y -1.5, yaw -0.3\n"
    sim(team, "step")
    team.wait_for(lambda: team.robot(7).truth is not None and team.robot(0).pose.x == pytest.approx(-0.5))
    assert tuple(team.robot(0).pose) == pytest.approx((-0.5, -1.5, -0.3))
    assert tuple(team.robot(2).pose) == pytest.approx((1.0, -0.5, -0.1))
    assert tuple(team.robot(7).pose) == pytest.approx((3.0, 0.5, 0.0))

    assert sim(team, "remove", "2")["robots"] == [0, 1, 7]
    gone = team.command("sim", "remove", "2")
    assert (gone.returncode, gone.stdout) == (1, "")
    assert gone.stderr == "zteam sim: no robot 2 in this world: it has 0, 1, 7\n"
    taken = team.command("sim", "spawn", "--pose", "0", "0", "0", "--id", "7")
    assert taken.returncode == 1
    assert "remove it first, or take another id" in taken.stderr

    assert sim(team, "reset")["robots"] == [0, 1]
    team.wait_for(lambda: math.dist(team.robot(0).pose[:2], (-0.5, -1.5)) > 0.1)


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


def test_without_a_simulator_the_error_names_the_way_out(team: TeamFixture) -> None:
    """Exit code 1 and one line."""
    done = team.command("sim", "status")
    assert done.returncode == 1
    assert "start one with 'zteam-sim WORLD'" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_messages_are_published_in_simulated_time(team: TeamFixture) -> None:
    """`topic pub` publishes at ticks, not while the world stands still, and ends after the last message."""
    team.spawn("zteam-sim", "arena", "--paused", name="sim")
    team.wait_for_processes("sim")
    robot, client = team.robot(0), SimulatorClient(team.bus)
    client.stand(ASKED)
    assert robot.commands == 0
    team.spawn("zteam", "topic", "pub", "robot_0/cmd_vel", "Twist", "{}", "--rate", "5", "--times", "4", name="pub")
    team.wait_for_line("pub", "simulated time stands still at 0.100 s")
    for count in (1, 1, 2, 2, 3):
        team.wait_for(lambda least=count: robot.commands == least)  # type: ignore[misc]
        client.step()
    team.wait_for(lambda: robot.commands == 3)
    # The last message is due in the next tick.
    assert team.exit_code("pub") is None
    client.step()
    assert team.wait_for_exit("pub") == 0
    team.wait_for(lambda: robot.commands == 4)
