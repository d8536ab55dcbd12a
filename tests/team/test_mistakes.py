"""Mistakes beside a team: each answer is short, names place and way out, and ends with the right exit code."""

import re
import shlex
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.mistakes import BESIDE_A_TEAM, Mistake
from zteam.errors import UsageError
from zteam.team.launch.process import Job, Process, zteam_command
from zteam.team.launch.warm_parent import WarmParent
from zteam.team.testing.team import TeamFixture, TeamTimeout

pytestmark = pytest.mark.team

_PROGRESS = re.compile(r"\d\d:\d\d:\d\d \[[^]]+\] (?!error)|publishing ")
"""The beginning of a line that tells what goes on and no mistake."""


@pytest.fixture(scope="module")
def warm() -> Iterator[WarmParent]:
    """Commands start fast."""
    with closing(WarmParent()) as parent:
        yield parent


def run(words: Sequence[str], warm: WarmParent, environment: Mapping[str, str], folder: Path) -> tuple[int | None, str]:
    """The exit code and the output of a command."""
    lines: list[str] = []
    first, *rest = words
    job = Job([sys.executable, *rest] if first == "python" else zteam_command(first, *rest), environment, folder)
    process = Process("mistake", job, lambda _, line: lines.append(line), lambda *_: None, lambda _: None, warm.start)
    process.write_line("")
    assert process.join(LIMIT)
    return process.exit_code, "".join(f"{line}\n" for line in lines)


def faults_of(mistake: Mistake, warm: WarmParent, environment: Mapping[str, str], folder: Path) -> str:
    """What is wrong with the answer to a mistake that is made in an empty `folder`; empty if nothing is."""
    name, text = mistake.file
    if name:
        (folder / name).write_text(text)
    exit_code, answer = run(shlex.split(mistake.command), warm, environment, folder)
    faults = [f"{told!r} is missing" for told in mistake.told if told not in answer]
    if exit_code != mistake.exit_code:
        faults.append(f"exit code {exit_code} instead of {mistake.exit_code}")
    if len([line for line in answer.splitlines() if not _PROGRESS.match(line)]) > mistake.lines:
        faults.append(f"more than {mistake.lines} lines")
    if any(not line.partition('"')[2].startswith(str(folder)) for line in answer.splitlines() if '  File "' in line):
        faults.append("a traceback outside of the user's own files")
    return f"{mistake.label}: {', '.join(faults)}:\n{answer}" if faults else ""


@pytest.mark.real_time
def test_mistakes_beside_a_team_are_answered(team: TeamFixture, warm: WarmParent, tmp_path: Path) -> None:
    """All answers are given by the same team, which goes on undisturbed (one team, because its start is slow)."""
    team.start("arena", robots="0-1", behavior="forward", params={i: {"speed": 0.05} for i in (0, 1)}, lockstep=False)
    team.wait_for_go()
    for i, place in enumerate([(-4, -4), (-2, -4), (0, -4), (2, -4)]):
        assert team.sim.spawn(*place, 0.0) == i + 2

    # What is forked takes no PYTHONPATH.
    environment = {name: value for name, value in team.environment.items() if name.startswith("ZTEAM_")}

    def make(mistake: Mistake) -> str:
        return faults_of(mistake, warm, environment, Path(tempfile.mkdtemp(dir=tmp_path)))

    with ThreadPoolExecutor(2) as pool:
        # Many of them wait for something.
        faults = [*filter(None, pool.map(make, BESIDE_A_TEAM))]
    assert not faults, "\n".join(faults)
    assert team.alive("robot_0")


@pytest.mark.real_time
def test_a_process_that_waits_says_for_what(team: TeamFixture) -> None:
    """A robot names the process that it lacks, one after the other, and a robot that is not in the world."""
    team.spawn("zteam-sim", "arena", name="sim")
    team.wait_for_processes("sim")
    for i, words in ((0, ()), (1, ("--follow", "5")), (7, ())):
        team.spawn("zteam-robot", "--id", str(i), *words, name=f"robot_{i}")
    team.wait_for_line("robot_0", "waiting for its own pose in map (tf, from zteam-tf)")
    team.wait_for_line(
        "robot_7", "robot_7 is not in the world; it has 0, 1 ('zteam sim spawn --id 7 --pose X Y YAW' adds"
    )
    team.spawn("zteam-tf", name="tf")
    team.wait_for_line("robot_0", "waiting for the monitor's GO (zteam-monitor; --no-gate drives at once)")
    team.wait_for_line("robot_1", "the pose of its leader robot_5: robot_5 is not in the world; it has 0, 1")


def test_a_team_that_cannot_be_started_is_answered(team: TeamFixture) -> None:
    """A world, a team file and robots that are not there are named."""
    with pytest.raises(UsageError, match=r"world 'nowhere': No such file or directory, nor a shipped world \(arena, "):
        team.start("nowhere")
    with pytest.raises(UsageError, match=r"team 'missing.toml': No such file or directory, nor a shipped team"):
        team.launch("missing.toml")
    with pytest.raises(UsageError, match=r"robots\[3\]\.id: the world has no robot 3 \(it has 0, 1\)"):
        team.start("arena", robots=4, behavior="forward")


def test_mistakes_in_a_test_are_answered(team: TeamFixture) -> None:
    """A robot that is not there is named, and a condition that never comes true tells where the robots are."""
    team.start("arena", robots=1, behavior="forward")
    with pytest.raises(UsageError, match="there is no robot 9; the world has 0, 1"):
        team.robot(9)
    with pytest.raises(TeamTimeout, match=r"not true within 0.2 simulated seconds \(now .* s\); robot_0 at x -?\d"):
        team.until(lambda: team.robot(0).speed > 5.0, within=0.2)
