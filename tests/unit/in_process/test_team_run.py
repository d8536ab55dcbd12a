"""`zteam.run_team`: a team in the caller's process."""

import logging
import signal
from pathlib import Path

import pytest

import zteam
from zteam.messages import Bool, LaserScan

TEAM = '[team]\nworld = "arena"\n[[robots]]\nid = 0\nbehavior = "wander"\nspeed = 0.4\n'
FAULTY = """
from zteam import Behavior
from zteam.messages import Twist

class Faulty(Behavior):
    def step(self, view):
        if view.now > 2_000_000_000:
            raise ValueError("out of plans")
        return Twist()
"""


def test_the_report_is_that_of_the_run() -> None:
    """The run ends at its time; another seed gives another run; the same seed repeats it."""
    first, again, other = (zteam.run_team("arena", seconds=20.0, seed=seed) for seed in (5, 5, 6))
    assert isinstance(first, zteam.RunReport)
    assert (first.seed, first.ticks, first.sim_seconds) == (5, 201, 20.0)
    assert first.trajectory_sha256 == again.trajectory_sha256 != other.trajectory_sha256
    assert [row.name for row in first.processes] == ["up"]


def test_it_ends_before_a_tick() -> None:
    """With `until` the tick before it is the last one that is counted."""
    assert zteam.run_team("arena", until=20).ticks == 19


def test_an_own_node_keeps_time() -> None:
    """An own node takes part from the first tick on, with its inputs of every tick."""
    stamps: list[int] = []
    heard: list[str] = []

    def main(node: zteam.Node) -> None:
        near = node.publisher("robot_0/near", Bool)
        node.subscribe("robot_0/base_scan", LaserScan, lambda key, _scan: heard.append(key), every_tick=True)

        def step(now: int) -> None:
            stamps.append(now)
            near.put(Bool(len(heard) == len(stamps)))

        node.run(step)

    report = zteam.run_team("arena", until=11, nodes={"crowd": main})
    assert stamps[-10:] == [100_000_000 * tick for tick in range(1, 11)]
    assert "crowd" in report.rounds


def test_an_error_of_a_behaviour_is_raised(empty_folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The caller gets the behaviour's own exception, and the log names the robot and the line of the user's code."""
    (empty_folder / "faulty.py").write_text(FAULTY)
    (empty_folder / "team.toml").write_text(TEAM.replace('"wander"\nspeed = 0.4', '"faulty:Faulty"'))
    with pytest.raises(ValueError, match="out of plans"):
        zteam.run_team("team.toml", seconds=10.0)
    told = [record.getMessage() for record in caplog.records if record.levelno == logging.ERROR]
    assert told[0].startswith("[robot_0] ended by an error:\n")
    assert 'faulty.py", line 8, in step' in told[0]
    assert "zteam/" not in told[0]


def test_an_error_of_an_own_node_is_raised() -> None:
    """An own node that fails before its first step ends the run, which would wait for it for ever."""

    def main(node: zteam.Node) -> None:
        raise LookupError("no map")

    with pytest.raises(LookupError, match="no map"):
        zteam.run_team("arena", seconds=10.0, nodes={"planner": main})


def test_ctrl_c_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """SIGINT ends an endless run in order as KeyboardInterrupt, and then goes to the caller's handler again."""

    def main(node: zteam.Node) -> None:
        node.run(lambda now: signal.raise_signal(signal.SIGINT) if now == 500_000_000 else None)

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        zteam.run_team("arena", seconds=1e6, nodes={"planner": main})
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({}, "run_team: give seconds or until"),
        ({"seconds": 1.0, "nodes": {"robot_0": print}}, "node 'robot_0': the team has a process of this name already"),
    ],
)
def test_a_mistake_is_told(options: dict[str, object], told: str) -> None:
    """A run without an end, and a node with a robot's name, are refused before anything starts."""
    with pytest.raises(zteam.ZteamError, match=told):
        zteam.run_team("arena", **options)  # type: ignore[arg-type]
