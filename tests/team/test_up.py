"""`zteam up` from start to report."""

import json
import os
import signal
import subprocess
from pathlib import Path

import pytest

from zteam.launch.process import zteam_command
from zteam.launch.warm_parent import can_fork

pytestmark = pytest.mark.team

SHARED = Path(__file__).resolve().parents[3] / "shared"


def up(*arguments: str, cwd: Path) -> "subprocess.CompletedProcess[str]":
    """Run `zteam up` to its end."""
    return subprocess.run(
        zteam_command("zteam", "up", *arguments), cwd=cwd, capture_output=True, text=True, timeout=110, check=False
    )


def test_the_report_has_every_robot_and_process(tmp_path: Path) -> None:
    """A run of the arena ends with exit code 0 and a report of every robot and every process."""
    done = up("arena", "--for", "5", "--report", "r.json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "r.json").read_text())
    assert 5.0 <= report["sim_seconds"] < 5.2
    assert report["wall_seconds"] >= 5.0
    assert 0 < report["go_after_seconds"] < report["wall_seconds"]
    assert report["seed"] == 1
    assert report["external_commands"] == 0
    assert [robot["id"] for robot in report["robots"]] == [0, 1]
    leader, follower = report["robots"]
    assert leader["follow"] is None
    assert leader["gap_m"] is None
    assert follower["follow"] == 0
    assert 0 < follower["gap_m"]["end"] <= follower["gap_m"]["max"]
    assert leader["distance_m"] > 0.2
    # In real time the simulator may hear of GO some ticks after it was given.
    assert 0 < report["ticks"] == leader["scans"]
    processes = {process["name"]: process for process in report["processes"]}
    parent = {"warm_parent"} if can_fork() else set()
    assert set(processes) == {"router", "sim", "tf", "monitor", "robot_0", "robot_1", "up"} | parent
    assert all(p["exit"] == 0 and p["pss_mb"] > 0 and p["cpu_seconds"] > 0 for p in processes.values())
    assert report["dropped"] == {}


@pytest.mark.skipif(not SHARED.is_dir(), reason="the lectures' world (../shared) is not here")
def test_the_lectures_line_drives_through_willow(tmp_path: Path) -> None:
    """Each of four robots in a line drives more than 2 m in 30 s, and no gap ends above 2.5 m."""
    world = SHARED / "worlds" / "stage_ros" / "willow-lesson3.world"
    done = up("willow", "--world", str(world), "--lockstep", "--for", "30", "--report", "r.json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    robots = json.loads((tmp_path / "r.json").read_text())["robots"]
    assert [r["follow"] for r in robots] == [None, 0, 1, 2]
    assert min(r["distance_m"] for r in robots) > 2.0
    assert max(r["gap_m"]["end"] for r in robots[1:]) <= 2.5
    assert robots[0]["pose"][0] < 11.8 - 0.4


def test_a_team_without_a_world_asks_for_one(tmp_path: Path) -> None:
    """Exit code 2 and one line that names the option."""
    done = up("willow", cwd=tmp_path)
    assert done.returncode == 2
    assert "--world" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_a_circle_of_followers_is_refused(tmp_path: Path) -> None:
    """The launcher names the circle and starts nothing."""
    (tmp_path / "t.toml").write_text(
        '[team]\nworld = "arena"\n[[robots]]\nid = 0\nfollow = 1\n[[robots]]\nid = 1\nfollow = 0\n'
    )
    done = up("t.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "0" in done.stderr
    assert done.stdout == ""


def descendants_of(pid: int) -> list[int]:
    """Ids of the processes that `pid` has started, and of those that they have started."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[1]) == pid:
                found += [int(entry.name), *descendants_of(int(entry.name))]
    return found


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_no_process_outlives_the_launcher(tmp_path: Path, number: signal.Signals) -> None:
    """However the launcher ends, all its processes end too; a signal that it handles ends it with exit code 0."""
    launcher = subprocess.Popen(
        zteam_command("zteam", "up", "arena"), cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        assert launcher.stdout is not None
        for line in launcher.stdout:
            if "All robots GO!" in line:
                break
        children = descendants_of(launcher.pid)
        # Router, simulator, aggregator, monitor, two robots; and their warm parent, where there is one.
        assert len(children) == 6 + can_fork()
        handles = [os.pidfd_open(pid) for pid in children]
        launcher.send_signal(number)
        launcher.stdout.read()
        code = launcher.wait(30)
        for handle in handles:
            wait_for_end(handle)
        assert code == (-signal.SIGKILL if number == signal.SIGKILL else 0)
    finally:
        launcher.kill()
        launcher.wait()
        if launcher.stdout is not None:
            launcher.stdout.close()


def wait_for_end(handle: int) -> None:
    """Wait until the process behind a pidfd has ended."""
    import select

    readable, _, _ = select.select([handle], [], [], 30)
    os.close(handle)
    assert readable, "a child process still runs"
