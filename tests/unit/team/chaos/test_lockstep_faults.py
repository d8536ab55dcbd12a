"""Faults of a plan in lock-step, with the whole team in one process."""

from pathlib import Path

import msgspec
import pytest

import zteam
from zteam.cli.up import main
from zteam.config.fault import Fault
from zteam.team.chaos.means import plan_text

PAUSE = Fault(at=2.0, fault="pause", name="robot_1", seconds=1.0)
CUT = Fault(at=2.0, fault="cut", name="robot_1", seconds=1.0)
SLOW = Fault(at=2.0, fault="slow", name="robot_1", seconds=2.0, delay=0.3)


def trajectory(folder: Path, *faults: Fault) -> str:
    """The hash of a line's first seconds under these faults."""
    plan, report = folder / "plan.toml", folder / "run.json"
    plan.write_text(plan_text(faults))
    chaos = ["--chaos", str(plan)] if faults else []
    assert main(["line", "--for", "6", "--lockstep", "--in-process", "--report", str(report), *chaos]) == 0
    return str(msgspec.json.decode(report.read_bytes())["trajectory_sha256"])


@pytest.mark.ci
def test_a_plan_repeats_to_the_bit_and_each_plan_is_another_run(tmp_path: Path) -> None:
    """The same faults give the same trajectory, other faults another; a pause and a cut are the same for the world."""
    none, pause, again, cut, slow = (
        trajectory(tmp_path, *faults) for faults in ((), (PAUSE,), (PAUSE,), (CUT,), (SLOW,))
    )
    assert pause == again == cut
    assert len({none, pause, slow}) == 3


@pytest.mark.ci
def test_a_run_from_python_takes_a_plan(tmp_path: Path) -> None:
    """Its report tells when the robot stood, and that it drove on."""
    plan = tmp_path / "plan.toml"
    plan.write_text(plan_text([PAUSE]))
    found = zteam.run_team("line", seconds=5.0, chaos=plan).chaos
    assert found is not None and found.violations == []
    assert [(each.name, each.problem) for each in found.faults] == [("robot_1", "")]


def test_faults_that_need_processes_are_refused_in_one_process(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A kill, or a pause in real time, has no process to happen to: one line says so, and what to do."""
    plan = tmp_path / "plan.toml"
    plan.write_text(plan_text([Fault(at=1.0, fault="kill", name="robot_1")]))
    assert main(["line", "--in-process", "--lockstep", "--chaos", str(plan)]) == 2
    assert "kill robot_1 does not work in one process: leave --in-process out" in capsys.readouterr().err
    plan.write_text(plan_text([PAUSE]))
    assert main(["line", "--in-process", "--chaos", str(plan)]) == 2
    assert "pause robot_1 does not work in one process: say --lockstep" in capsys.readouterr().err
