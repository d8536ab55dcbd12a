"""`zteam.run_team`: a team in the caller's process."""

import logging
import re
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

import zteam
from support.limits import LIMIT
from zteam.behaviors import Behavior, View
from zteam.clock import HOST_FACTOR
from zteam.messages import Bool, LaserScan, RobotStatus, Twist
from zteam.team.launch.plan import Pace
from zteam.team.run import run_team as running

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


@pytest.mark.gate
def test_the_report_is_that_of_the_run() -> None:
    """The run ends at its time; another seed gives another run; the same seed repeats it."""
    first, again, other = (zteam.run_team("arena", seconds=5.0, seed=seed) for seed in (5, 5, 6))
    assert isinstance(first, zteam.RunReport) and first.go_after_seconds is not None
    assert (first.seed, first.ticks, first.sim_seconds) == (5, 51, 5.0)
    assert first.trajectory_sha256 == again.trajectory_sha256 != other.trajectory_sha256
    assert [row.name for row in first.processes] == ["up"]
    assert (
        first.wall_seconds == round(first.wall_seconds, 3) >= first.go_after_seconds == round(first.go_after_seconds, 3)
    )


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
    assert report.ticks == 10
    assert stamps[-10:] == [100_000_000 * tick for tick in range(1, 11)]
    assert "crowd" in report.rounds


NAPPING = """
import time
from msgspec import Struct
from zteam import Behavior
from zteam.messages import Twist, Vector3
from zteam.node.working import hanging

class Naps(Behavior):
    class Params(Struct):
        nap: bool = False

    def step(self, view):
        end = time.monotonic() + 60.0
        while self.params.nap and view.now == 1_000_000_000 and not hanging() and time.monotonic() < end:
            time.sleep(0.1)
        return Twist(Vector3(0.3), Vector3(z=0.1))
"""


@pytest.mark.ci
def test_a_late_answer_holds_the_world(empty_folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    """No time of the host's changes a command: the run is the same, and the log names the step."""
    (empty_folder / "napping.py").write_text(NAPPING)
    robot = '[team]\nworld = "arena"\n[[robots]]\nid = 0\nbehavior = "napping:Naps"\n'
    reports = []
    for nap in ("false", "true"):
        (empty_folder / "team.toml").write_text(f"{robot}nap = {nap}\n")
        reports.append(zteam.run_team("team.toml", until=30))
    assert reports[0].trajectory_sha256 == reports[1].trajectory_sha256
    assert [report.hung for report in reports] == [[], []]
    (told,) = [line for line in caplog.messages if "Naps.step takes" in line]
    assert re.fullmatch(
        r"\[robot_0\] Naps\.step takes \d+\.\d s, a scan comes every 0\.1 s; try zteam check napping:Naps", told
    )


@pytest.mark.ci
def test_shipped_behaviours_say_why_they_stand(empty_folder: Path) -> None:
    """Of a robot that stops before a wall and of its follower no status says that it commands zero velocity."""
    leader = '[team]\nworld = "arena"\n[[robots]]\nid = 0\nbehavior = "avoid"\nspeed = 0.5\n'
    (empty_folder / "team.toml").write_text(f'{leader}[[robots]]\nid = 1\nfollow = "previous"\n')
    reasons: set[str] = set()

    def main(node: zteam.Node) -> None:
        node.subscribe("robot_$*/status", RobotStatus, lambda _key, status: reasons.add(status.reason))
        node.run(lambda _now: None)

    zteam.run_team("team.toml", seconds=30.0, nodes={"listener": main})
    assert any(reason.startswith("waits: robot_0 is ") for reason in reasons), reasons
    assert not [reason for reason in reasons if "commands zero velocity" in reason]


def test_an_error_of_a_behaviour_is_raised(empty_folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The caller gets the behaviour's own exception, and the log names the robot and the line of the user's code."""
    (empty_folder / "faulty.py").write_text(FAULTY)
    (empty_folder / "team.toml").write_text(TEAM.replace('"wander"\nspeed = 0.4', '"faulty:Faulty"'))
    with pytest.raises(ValueError, match="out of plans"):
        zteam.run_team("team.toml", seconds=10.0)
    told = [record.getMessage() for record in caplog.records if record.levelno == logging.CRITICAL]
    assert told[0].startswith("[robot_0] ended by an error:\n")
    assert 'faulty.py", line 8, in step' in told[0]
    assert "zteam/" not in told[0]


@pytest.mark.ci
def test_a_loop_of_an_own_node_is_raised(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    """The caller gets the frames of a callback that does not return, and the log has them too."""

    def loop(_key: str, _scan: LaserScan) -> None:
        while True:
            pass

    def main(node: zteam.Node) -> None:
        node.subscribe("robot_0/base_scan", LaserScan, loop)
        node.run(lambda _now: None)

    monkeypatch.setattr(running, "Pace", partial(Pace, timeout=HOST_FACTOR))
    with pytest.raises(zteam.ZteamError, match=r"^planner hangs: after .* s loop has not returned \(.*\)\n") as told:
        zteam.run_team("arena", seconds=10.0, nodes={"planner": main})
    assert f'File "{__file__}", line ' in str(told.value)
    assert f"[planner] {told.value}" in caplog.messages


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


IMPORTS = """
import sys, threading
from zteam.testing import Team

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name.startswith("zteam") and threading.current_thread() is not threading.main_thread():
            print(threading.current_thread().name, name)

sys.meta_path.insert(0, Finder())
team = Team()
team.launch("team.toml", in_process=True)
team.wait_for_go()
team.run(1)
team.close()
"""


@pytest.mark.gate
def test_no_node_imports_zteam_in_its_own_thread(tmp_path: Path) -> None:
    """pytest parses a package with a plugin when it imports it, which two threads cannot do at once on Python 3.11."""
    (tmp_path / "team.toml").write_text(f"{TEAM}[[robots]]\nid = 1\nnavigation = true\n")
    command = [sys.executable, "-c", IMPORTS]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT, check=True)
    assert done.stdout == ""


def test_a_notebook_runs_its_own_class_and_modules_as_they_stand(
    empty_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A class of `__main__` is the object itself. An edited module is read again at the next run, and so is what
    imports it."""
    asked = list[str]()

    class Mine(Behavior):
        def step(self, view: View) -> Twist:
            asked.append("main")
            return Twist()

    def run(spec: str) -> float:
        (empty_folder / "team.toml").write_text(TEAM.replace('"wander"\nspeed = 0.4', f'"{spec}"'))
        return zteam.run_team("team.toml", seconds=1.0).robots[0].distance_m

    monkeypatch.setattr(sys.modules["__main__"], "MineOfMain", Mine, raising=False)
    run("__main__:MineOfMain")
    assert set(asked) == {"main"}
    (empty_folder / "pace.py").write_text("SPEED = 0.2\n")
    text = "from zteam import Behavior\nfrom zteam.messages import Twist, Vector3\nfrom pace import SPEED\n"
    text += "class Mine(Behavior):\n    step = lambda *_: Twist(Vector3(SPEED))\n"
    (empty_folder / "edited.py").write_text(text)
    before = run("edited:Mine")
    assert before == run("edited:Mine") > 0.0
    (empty_folder / "pace.py").write_text("SPEED = 0.4  # edited\n")
    assert run("edited:Mine") > 1.5 * before
