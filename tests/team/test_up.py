"""`zteam up` from start to report."""

import json
import os
import signal
import subprocess
from pathlib import Path

import pytest

from support.freezing import descendants_of
from support.limits import LIMIT
from zteam.team.launch.process import zteam_command
from zteam.team.launch.warm_parent import can_fork

pytestmark = pytest.mark.team

SHARED = Path(__file__).resolve().parents[3] / "shared"


def up(*arguments: str, cwd: Path) -> "subprocess.CompletedProcess[str]":
    """Run `zteam up` to its end."""
    return subprocess.run(
        zteam_command("zteam", "up", *arguments), cwd=cwd, capture_output=True, text=True, timeout=LIMIT, check=False
    )


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


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_no_process_outlives_the_launcher(tmp_path: Path, number: signal.Signals) -> None:
    """However the launcher ends, all its processes end too, a program of the team file with all that it has started; a
    signal that the launcher handles ends it with exit code 0."""
    node = '[[nodes]]\nname = "helper"\ncommand = ["sh", "-c", "sleep 1000 & wait"]\n'
    (tmp_path / "team.toml").write_text(f'include = ["arena.toml"]\n{node}')
    launcher = subprocess.Popen(
        zteam_command("zteam", "up", "team.toml", "--lockstep"),
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert launcher.stdout is not None
        for line in launcher.stdout:
            if "All robots GO!" in line:
                break
        children = descendants_of(launcher.pid)
        # Router, simulator, aggregator, monitor, two robots; a shell, its child and its guard; and a warm parent, where
        # there is one.
        assert len(children) == 9 + can_fork()
        handles = [os.pidfd_open(pid) for pid in children]
        launcher.send_signal(number)
        launcher.stdout.read()
        code = launcher.wait(LIMIT)
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

    readable, _, _ = select.select([handle], [], [], LIMIT)  # noqa: TID251
    os.close(handle)
    assert readable, "a child process still runs"
