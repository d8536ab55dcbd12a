"""The blocks of the pages that need processes: tests with the fixture, nodes and scripts beside a team, commands.

Those of the README: tests/proof.
"""

import importlib
import inspect
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.pages import PAGES, ROOT, Block, all_blocks, blocks_of, find_file
from zteam import names
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

README = ROOT / "README.md"
DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"


def environment(extra: dict[str, str]) -> dict[str, str]:
    """The environment of a user's terminal: the commands of this installation come first."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "PYTHONUNBUFFERED": "1", **extra}


@pytest.mark.parametrize(
    ("block", "name"),
    [
        pytest.param(block, name, id=f"{block.id}-{name}")
        for block in all_blocks("python")
        if block.has_team_tests and not block.shares_team and block.page != README
        for name in block.tests
    ],
)
def test_a_test_of_a_page_passes(block: Block, name: str, team: TeamFixture, empty_folder: Path) -> None:
    """The test works as it stands, in a folder that holds only the files that the page names."""
    importlib.invalidate_caches()
    test = getattr(importlib.import_module(block.save(empty_folder).stem), name)
    test(**{"team": team} if "team" in inspect.signature(test).parameters else {})


@pytest.mark.parametrize("block", [b for b in all_blocks("python") if b.shares_team], ids=lambda block: block.id)
def test_a_page_with_a_shared_team_passes(block: Block, tmp_path: Path) -> None:
    """pytest runs it in a folder that holds only the files that the page names."""
    command = [sys.executable, "-m", "pytest", "-q", block.save(tmp_path).name]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 0, done.stdout


def beside_the_team(page: Path) -> list[Block]:
    """The blocks of a page that work beside a team that runs already."""
    return [
        block
        for block in blocks_of(page)
        if block.needs_team
        and (block.is_run or block.language == "python")
        and names.robot_id_of(block.notes.get("process", "")) is None
    ]


COURSE = [page for page in PAGES if page.name == "course.md"]
OTHERS = [page for page in PAGES if page not in (README, *COURSE)]


@pytest.mark.parametrize("pages", [COURSE, OTHERS], ids=["course", "others"])
def test_blocks_work_beside_a_team(pages: list[Path], team: TeamFixture, tmp_path: Path) -> None:
    """Nodes, scripts and commands of the pages do beside a team what their page says, each in a folder of its own."""
    team.launch("line")
    team.wait_for_go()
    blocks = [block for page in pages for block in beside_the_team(page)]
    assert len(blocks) >= 4
    for block in blocks:
        folder = tmp_path / block.id.replace(":", "_")
        folder.mkdir()
        path = block.save(folder)
        path.write_text(for_this_team(path.read_text(), team))
        if "process" in block.notes:
            run_process(block, path, team)
        else:
            run_to_its_end(block, path, team)


def for_this_team(code: str, team: TeamFixture) -> str:
    """The code with this team's router and namespace, for a plain Zenoh client, which names them itself."""
    return code.replace(DEFAULT_ENDPOINT, team.endpoint).replace(
        'mode: "client"', f'mode: "client", namespace: "{team.namespace}"'
    )


def run_process(block: Block, path: Path, team: TeamFixture) -> None:
    """Let a process take part for a while, and stop it."""
    name, output = block.notes["process"], path.parent / "output.txt"
    with (
        output.open("w") as file,
        subprocess.Popen(
            [sys.executable, path.name], cwd=path.parent, env=environment(team.environment), stdout=file, stderr=file
        ) as process,
    ):
        try:
            team.wait_for(lambda: process.poll() is not None or name in team.sim_status.joining)
            assert process.poll() is None, output.read_text()
            team.run(2.0)
            assert name in team.sim_status.participants, output.read_text()
            shown = block.notes.get("shows", "")
            team.wait_for(lambda: shown in output.read_text())
        finally:
            process.terminate()
            code = process.wait(LIMIT)
    assert code in (0, -signal.SIGTERM), output.read_text()
    team.wait_for(lambda: name not in team.sim_status.participants)


def run_to_its_end(block: Block, path: Path, team: TeamFixture) -> None:
    """Run a script or a shell block while the world runs, at the pace that a user sees."""
    team.sim.set_speed(1.0)
    team.sim.resume()
    try:
        run(block, path, team.environment)
    finally:
        team.sim.pause()


def run(block: Block, path: Path, extra: dict[str, str]) -> None:
    """Run a saved block to its end, which has to be a success."""
    command = [sys.executable, path.name] if block.language == "python" else ["bash", "-e", path.name]
    done = subprocess.run(
        command, cwd=path.parent, env=environment(extra), capture_output=True, text=True, timeout=LIMIT, check=False
    )
    assert done.returncode == 0, f"{block.id}\n{done.stdout}{done.stderr}"
    assert block.notes.get("shows", "") in done.stdout, f"{block.id}\n{done.stdout}{done.stderr}"


@pytest.mark.parametrize(
    "block", [b for b in all_blocks("sh") if b.is_run and not b.needs_team], ids=lambda block: block.id
)
def test_a_command_works(block: Block, tmp_path: Path) -> None:
    """A shell block that needs no team works in a folder that holds only the files that the page names."""
    run(block, block.save(tmp_path), {})


DRIVERS = [
    block
    for block in all_blocks("python")
    if names.robot_id_of(block.notes.get("process", "")) is not None and block.file != "racer.py"
]


@pytest.mark.parametrize("block", DRIVERS, ids=lambda block: block.id)
@pytest.mark.real_time
def test_a_robots_own_process_drives_it(block: Block, team: TeamFixture, tmp_path: Path) -> None:
    """A process with a robot's name, whose number it gets as its argument, moves the robot until it is stopped."""
    robot_id = names.robot_id_of(block.notes["process"])
    assert robot_id is not None
    path = block.save(tmp_path)
    team.spawn("zteam-sim", "office", name=names.SIMULATOR)
    team.wait_for_processes(names.SIMULATOR)
    command = [sys.executable, path.name, str(robot_id)]
    with subprocess.Popen(command, cwd=tmp_path, env=environment(team.environment)) as process:
        try:
            team.wait_for(lambda: team.robot(robot_id).truth is not None)
            team.wait_for(lambda: team.robot(robot_id).distance_travelled > 0.1)
        finally:
            process.terminate()
            assert process.wait(LIMIT) == 0
    team.wait_for(lambda: team.robot(robot_id).speed == 0.0)


def test_a_follower_of_a_published_frame_repeats(team: TeamFixture, empty_folder: Path) -> None:
    """In lock-step the behaviour of a page follows the frame of a page, and a second run gives the same hash."""
    carrot = find_file("carrot.py", PAGES[0]).save(empty_folder)
    find_file("donkey.py", PAGES[0]).save(empty_folder)
    with subprocess.Popen([sys.executable, carrot.name], env=environment(team.environment)) as process:
        try:
            team.start("arena", robots=2, behavior="donkey:Donkey", expect=["carrot"])
            team.wait_for_go()
            hashes = []
            for _ in range(2):
                team.run(10.0)
                assert team.robot(1).distance_travelled > 1.0
                hashes.append(team.report.trajectory_sha256)
                team.sim.reset()
        finally:
            process.terminate()
            assert process.wait(LIMIT) == 0
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize("mode", [pytest.param("real time", marks=pytest.mark.real_time), "lock-step"])
def test_a_robots_own_process_joins_the_gate(mode: str, team: TeamFixture, tmp_path: Path) -> None:
    """The node of the page is ready when it has a scan, waits for GO, and drives from GO on."""
    path = find_file("racer.py", PAGES[0]).save(tmp_path)
    lockstep = ["--lockstep", "--expect", "tf", "robot_0", "robot_1"] if mode == "lock-step" else []
    team.spawn("zteam-tf", name=names.AGGREGATOR)
    team.spawn("zteam-sim", "arena", *lockstep, name=names.SIMULATOR)
    team.spawn("zteam-robot", "--id", "0", "--behavior", "wander", name="robot_0")
    with subprocess.Popen(
        [sys.executable, path.name], cwd=tmp_path, env=environment(team.environment), stdout=subprocess.PIPE
    ) as process:
        try:
            team.wait_for_processes("robot_0", "robot_1", names.SIMULATOR)
            team.wait_for(lambda: team.robot(1).status is not None and team.robot(1).status.is_ready)
            assert team.robot(1).status.epoch == 0
            assert team.robot(1).distance_travelled == 0.0
            team.spawn("zteam-monitor", "--ids", "0", "1", name=names.MONITOR)
            team.wait_for_line(names.MONITOR, "All robots GO!")
            team.wait_for(lambda: team.robot(1).distance_travelled > 0.3 and team.robot(1).status.epoch == 1)
            team.wait_for(lambda: team.robot(0).distance_travelled > 0.3)
        finally:
            process.terminate()
            assert process.wait(LIMIT) == 0
