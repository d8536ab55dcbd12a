"""Plans of faults: read with a line for each mistake, drawn by a seed, and written as they are read."""

from itertools import pairwise
from pathlib import Path

import pytest

from zteam.config.fault import Fault
from zteam.errors import ConfigError, UsageError
from zteam.team.chaos.means import choose_plan, describe, plan_text, random_plan, read_plan

TEAM = ["sim", "tf", "monitor", "router", "robot_0", "robot_1"]


def test_a_plan_is_read_in_the_order_of_time(tmp_path: Path) -> None:
    """Faults of any order come out in that of their beginning, with the defaults of what they leave out."""
    file = tmp_path / "plan.toml"
    file.write_text(
        '[[faults]]\nat = 9\nfault = "slow"\nname = "robot_1"\nfor = 2.5\ndelay = 0.1\nrate = 5e4\n'
        '[[faults]]\nat = 5.0\nfault = "kill"\nname = "tf"\n'
    )
    assert read_plan(file) == (
        Fault(at=5.0, fault="kill", name="tf"),
        Fault(at=9.0, fault="slow", name="robot_1", seconds=2.5, delay=0.1, rate=5e4),
    )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "plan.toml: faults: write a table [[faults]]"),
        ("at = 1\n", "plan.toml: faults: write a table [[faults]]"),
        ('[[faults]]\nat = 1\nfault = "burn"\nname = "tf"\n', "plan.toml:3: faults[0].fault: "),
        ('[[faults]]\nat = 1\nfault = "kill"\n', "plan.toml:1: faults[0]: the key name is missing"),
        ('[[faults]]\nat = -1\nfault = "kill"\nname = "tf"\n', "plan.toml:2: faults[0].at: a number of at least 0"),
        ('[[faults]]\nat = 1\nfault = "cut"\nname = "tf"\nfro = 2\n', "plan.toml:5: faults[0].fro: unknown key"),
        ('seed = 3\n[[faults]]\nat = 1\nfault = "cut"\nname = "tf"\n', "plan.toml:1: seed: unknown key"),
    ],
)
def test_a_wrong_plan_is_refused_with_its_line(tmp_path: Path, text: str, told: str) -> None:
    """Each mistake is one line with file, line and key."""
    file = tmp_path / "plan.toml"
    file.write_text(text)
    with pytest.raises(ConfigError) as refused:
        read_plan(file)
    assert told in str(refused.value) and "\n" not in str(refused.value)


def test_a_plan_of_an_unknown_process_is_refused(tmp_path: Path) -> None:
    """A misspelt name is told with the process that it may mean."""
    file = tmp_path / "plan.toml"
    file.write_text('[[faults]]\nat = 1\nfault = "kill"\nname = "robot1"\n')
    with pytest.raises(ConfigError, match=r"no process 'robot1' \(did you mean robot_1\?\)"):
        choose_plan(str(file), None, TEAM, lockstep=False)


def test_a_seed_draws_one_plan() -> None:
    """The same seed gives the same faults, another one others; none overlap, and all begin within the time."""
    first, again, other = (random_plan(seed, 600.0, TEAM) for seed in (7, 7, 8))
    assert first == again != other
    assert {fault.name for fault in first} == {*TEAM}
    assert {fault.fault for fault in first} == {"kill", "pause", "cut", "slow"}
    assert all(a.at + a.lasts < b.at < 600.0 for a, b in pairwise(first))
    assert {fault.fault for fault in first if fault.name == "router"} == {"kill", "pause"}
    assert "kill" not in {fault.fault for fault in first if fault.name == "sim"}
    assert describe(first).startswith(f"{len(first)} faults (")


def test_in_lockstep_a_seed_draws_faults_that_repeat() -> None:
    """Only robots are drawn, and no kills."""
    drawn = choose_plan("7", 600.0, TEAM, lockstep=True)
    assert {fault.name for fault in drawn} == {"robot_0", "robot_1"}
    assert {fault.fault for fault in drawn} == {"pause", "cut", "slow"}
    with pytest.raises(UsageError, match="--for"):
        choose_plan("7", None, TEAM, lockstep=True)


def test_a_drawn_plan_can_be_kept(tmp_path: Path) -> None:
    """What is printed of a random plan is a file that reads as the same faults."""
    drawn = random_plan(3, 300.0, TEAM)
    file = tmp_path / "plan.toml"
    file.write_text(plan_text(drawn, "seed 3"))
    kept = read_plan(file)
    assert [(f.at, f.fault, f.name, f.lasts) for f in kept] == [(f.at, f.fault, f.name, f.lasts) for f in drawn]
    assert [f.delay for f in kept if f.fault == "slow"] == [f.delay for f in drawn if f.fault == "slow"]
