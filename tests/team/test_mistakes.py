"""Mistakes beside a team: each answer is short, names place and way out, and ends with the right exit code."""

import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from support.forks import Ended, Forks
from support.limits import LIMIT
from support.mistakes import BESIDE_A_TEAM, Mistake
from zteam.errors import UsageError
from zteam.team.testing.team import TeamFixture, TeamTimeout

pytestmark = pytest.mark.team

_PROGRESS = re.compile(r"\d\d:\d\d:\d\d \[[^]]+\] (?!error)|publishing ")
"""The beginning of a line that tells what goes on and no mistake."""


def _run_script(words: Sequence[str], environment: Mapping[str, str], folder: Path) -> Ended:
    done = subprocess.run(
        [sys.executable, *words],
        env={**os.environ, **environment},
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=LIMIT,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    return Ended(done.returncode, done.stdout)


def faults_of(mistake: Mistake, forks: Forks, environment: Mapping[str, str], folder: Path) -> str:
    """What is wrong with the answer to a mistake that is made in an empty `folder`; empty if nothing is."""
    name, text = mistake.file
    if name:
        (folder / name).write_text(text)
    first, *rest = shlex.split(mistake.command)
    run, words = (_run_script, rest) if first == "python" else (forks.run, [first, *rest])
    exit_code, answer = run(words, environment, folder)
    faults = [f"{told!r} is missing" for told in mistake.told if told not in answer]
    if exit_code != mistake.exit_code:
        faults.append(f"exit code {exit_code} instead of {mistake.exit_code}")
    if len([line for line in answer.splitlines() if not _PROGRESS.match(line)]) > mistake.lines:
        faults.append(f"more than {mistake.lines} lines")
    if any(not line.partition('"')[2].startswith(str(folder)) for line in answer.splitlines() if '  File "' in line):
        faults.append("a traceback outside of the user's own files")
    return f"{mistake.label}: {', '.join(faults)}:\n{answer}" if faults else ""


@pytest.mark.real_time
def test_mistakes_beside_a_team_are_answered(team: TeamFixture, tmp_path: Path) -> None:
    """All answers are given by the same team, which goes on undisturbed (one team, because its start is slow)."""
    team.start("arena", robots="0-1", behavior="forward", params={i: {"speed": 0.05} for i in (0, 1)}, lockstep=False)
    team.wait_for_go()
    for i, place in enumerate([(-4, -4), (-2, -4), (0, -4), (2, -4)]):
        assert team.sim.spawn(*place, 0.0) == i + 2

    def make(mistakes: Sequence[Mistake], forks: Forks) -> list[str]:
        folders = [Path(tempfile.mkdtemp(dir=tmp_path)) for _ in mistakes]
        return [faults_of(mistake, forks, team.environment, folders.pop()) for mistake in mistakes]

    with Forks() as one, Forks() as other, ThreadPoolExecutor(2) as pool:
        # Many of them wait for something; a process forks one command at a time.
        answers = pool.map(make, (BESIDE_A_TEAM[::2], BESIDE_A_TEAM[1::2]), (one, other))
        faults = [fault for half in answers for fault in half if fault]
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
    team.wait_for_line("robot_1", "waiting for the pose of its leader robot_5")


def test_a_team_that_cannot_be_started_is_answered(team: TeamFixture) -> None:
    """A world, a team file and robots that are not there are named."""
    with pytest.raises(UsageError, match=r"world 'nowhere': no such file, nor a shipped world \(arena, "):
        team.start("nowhere")
    with pytest.raises(UsageError, match=r"team 'missing.toml': no such file, nor a shipped team"):
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
