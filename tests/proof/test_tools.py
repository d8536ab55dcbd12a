"""Tools."""

import json
import shlex
from pathlib import Path

import pytest

from support.pages import ROOT, blocks_of
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

ENDS = {
    "zteam teleop --id 0": "--script 'i*2 k'",
    "zteam topic pub": "--times 2",
    "zteam tf echo": "--once",
    "zteam log": "--once",
}
"""What ends the README's commands that go on until Ctrl+C."""


@pytest.mark.gate
def test_the_tools_of_the_readme_work_on_a_running_team(
    team: TeamFixture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each command of the README's "Look at a running team" works on one team, and `topic hz` measures 10 Hz."""
    monkeypatch.chdir(tmp_path)
    team.start("arena", robots=2, follow={1: 0})
    team.wait_for_go()
    # As a user sees it; the figures are those of lock-step.
    team.sim.set_speed(1.0)
    team.sim.resume()
    (block,) = (block for block in blocks_of(ROOT / "README.md") if "zteam topic list" in block.code)
    commands = [line.partition("#")[0].strip() for line in block.code.splitlines()]
    assert len(commands) > 10
    for command in commands:
        words = shlex.split(command + next((f" {end}" for start, end in ENDS.items() if command.startswith(start)), ""))
        assert words[0] == "zteam"
        done = team.command(*words[1:])
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
        assert done.stdout or words[1] == "teleop", command
        if words[1:3] == ["sim", "pause"]:
            assert team.command("sim", "resume").returncode == 0
        if words[1] == "stop":
            assert team.command("stop", "--release").returncode == 0

    def rate() -> float:
        measured = team.command("topic", "hz", "robot_0/base_scan", "--clock", "sim", "--once", "--json")
        return float(json.loads(measured.stdout)["rate"])

    # A scan may come before the clock of its tick or after it: eleven scans in nine to eleven tenths of a second. On a
    # crowded machine a second brings fewer scans, and the same step counts for more.
    team.wait_for(lambda: rate() == pytest.approx(10.0, abs=1.2))


def commanded(team: TeamFixture) -> float:
    """The speed that robot 0 is commanded at the beginning of the next tick."""
    robot = team.robot(0)
    before = robot.commands
    team.run(0.1)
    team.wait_for(lambda: robot.commands > before)
    assert robot.command is not None
    return robot.command.linear.x


@pytest.mark.ci
def test_a_set_counts_from_the_next_tick_on(team: TeamFixture) -> None:
    """`zteam param set` changes a robot's speed from the next tick on; a wrong value is refused in one line."""
    team.start("arena", behavior="forward", params={0: {"speed": 0.1}})
    team.wait_for_go()
    team.run(1)
    assert [commanded(team) for _ in range(2)] == [0.1, 0.1]

    done = team.command("param", "set", "robot_0", "speed", "0.3")
    assert (done.returncode, done.stdout) == (0, "robot_0: speed = 0.3\n")
    # The command that a tick shows is the answer to the tick before, which was given before the set.
    assert [commanded(team) for _ in range(3)] == [0.1, 0.3, 0.3]

    refused = team.command("param", "set", "robot_0", "speed", "fast")
    assert refused.returncode == 2
    assert refused.stderr == ('zteam param: robot_0: behaviour forward: speed: a number is expected, not "fast"\n')
    assert [commanded(team) for _ in range(2)] == [0.3, 0.3]

    team.sim.reset()
    team.run(1)
    assert commanded(team) == 0.3
    (listed,) = json.loads(team.command("param", "list", "--json").stdout)
    assert (listed["name"], listed["parameters"][0]["value"]) == ("robot_0", 0.3)
    assert team.command("param", "dump", "0").stdout == 'behavior = "forward"\nspeed = 0.3\n'
