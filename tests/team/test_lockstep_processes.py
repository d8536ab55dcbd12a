"""Lock-step with real processes: runs repeat bit for bit, and the simulator names the process it waits for."""

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh

from zteam import names
from zteam.messages import Done, Tick, Twist, Vector3, decode, encode, time_from_ns
from zteam.testing.team import TeamFixture

pytestmark = pytest.mark.team

LIMIT = 60.0
LINE = {1: 0, 2: 1}


@pytest.fixture
def busy() -> Iterator[None]:
    """Two busy loops that compete for the processors."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
    yield
    for loop in loops:
        loop.kill()
        loop.wait()


def trajectory(team: TeamFixture, speed: float = 0.4) -> str:
    """The hash of a line of three that drives through the office."""
    team.start("office", robots=3, follow=LINE, params={0: {"speed": speed}})
    team.wait_for_go()
    team.run(8.0)
    assert min(team.robot(i).distance_travelled for i in range(3)) > 0.5
    return team.report.trajectory_sha256


@pytest.fixture
def reference(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The hash of the same run by the launcher, which starts all processes at once and never pauses."""
    folder = tmp_path_factory.mktemp("reference")
    lines = ['[team]\nworld = "office"\nseed = 1\n[[robots]]\nid = 0\nbehavior = "wander"\nspeed = 0.4\n']
    lines += [f"[[robots]]\nid = {i}\nfollow = {i - 1}\n" for i in (1, 2)]
    (folder / "team.toml").write_text("".join(lines))
    from zteam.launch.process import zteam_command

    done = subprocess.run(
        zteam_command("zteam", "up", "team.toml", "--lockstep", "--for", "8", "--report", "r.json"),
        cwd=folder, capture_output=True, text=True, timeout=120, check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    import json

    report = json.loads((folder / "r.json").read_text())
    assert report["ticks"] == 81
    return str(report["trajectory_sha256"])


def test_the_same_seed_gives_the_same_run(team: TeamFixture, reference: str, busy: None) -> None:
    """With the fixture and beside two busy loops, the run is the same as with the launcher."""
    assert trajectory(team) == reference


def test_another_command_gives_another_run(team: TeamFixture, reference: str) -> None:
    """A leader that drives a little faster changes the hash."""
    assert trajectory(team, speed=0.41) != reference


def test_processes_in_any_order_give_the_same_run(team: TeamFixture, reference: str) -> None:
    """The run is the same if the robots and the monitor start first, then the simulator, then the aggregator."""
    team.spawn("zteam-robot", "--id", "2", "--follow", "1", name="robot_2")
    team.spawn("zteam-robot", "--id", "1", "--follow", "0", name="robot_1")
    team.spawn("zteam-robot", "--id", "0", "--behavior", "wander", "--param", "speed=0.4", name="robot_0")
    team.spawn("zteam-monitor", "--ids", "0", "1", "2", name=names.MONITOR)
    expected = ("tf", "robot_0", "robot_1", "robot_2")
    team.spawn("zteam-sim", "office", "--lockstep", "--paused", "--expect", *expected, name=names.SIMULATOR)
    team.wait_for_processes("robot_0", "robot_1", "robot_2", names.SIMULATOR)
    team.spawn("zteam-tf", name=names.AGGREGATOR)
    team.wait_for_go()
    team.run(8.0)
    assert team.report.trajectory_sha256 == reference


def test_a_restart_at_a_tick_repeats(team: TeamFixture) -> None:
    """A robot is killed and started again at the same tick in two runs, and both runs are the same."""

    def run() -> str:
        team.at(20).kill("robot_1")
        team.restart("robot_1")
        team.at(60)
        return team.report.trajectory_sha256

    team.start("office", robots=3, follow=LINE)
    team.wait_for_go()
    first = run()
    assert team.robot(1).speed > 0.0
    assert team.sim.reset().tick == 1
    assert run() == first


def test_a_killed_participant_is_not_waited_for(team: TeamFixture) -> None:
    """The world goes on long before the time-out, and the follower's wheels stop."""
    team.start("office", robots=2, follow={1: 0}, lockstep_timeout=600.0)
    team.wait_for_go()
    team.until(lambda: team.robot(1).speed > 0.05, within=10)
    team.kill("robot_1")
    team.until(lambda: team.robot(1).speed == 0.0, within=0.3)
    assert "robot_1" not in team.sim_status.participants


def test_a_hung_participant_is_named_and_left_behind(team: TeamFixture) -> None:
    """A frozen robot holds the world and is named; after the time-out it is left behind; awake, it takes part again."""
    team.start("office", robots=2, follow={1: 0}, lockstep_timeout=2.0)
    team.wait_for_go()
    team.run(1.0)
    team.pause_process("robot_1")
    running = threading.Thread(target=team.run, args=(1.0,))
    running.start()
    team.wait_for_line(names.SIMULATOR, "waits for robot_1 for 1 s")
    assert team.sim_status.waiting_for == "robot_1"
    team.wait_for_line(names.SIMULATOR, "robot_1 did not answer tick")
    running.join(LIMIT)
    assert team.sim_status.participants == ["robot_0", "tf"]
    assert team.report.hung == ["robot_1"]
    team.resume_process("robot_1")
    team.wait_for(lambda: "robot_1" in team.sim_status.joining)
    team.until(lambda: team.robot(1).speed > 0.05, within=5)


def test_a_frozen_aggregator_alone_is_left_behind(team: TeamFixture) -> None:
    """Robots that wait for the transforms of a frozen aggregator are not left behind with it."""
    team.start("office", robots=2, follow={1: 0}, lockstep_timeout=2.0)
    team.wait_for_go()
    team.run(1.0)
    team.pause_process(names.AGGREGATOR)
    team.run(1.0)
    assert team.report.hung == [names.AGGREGATOR]
    assert team.sim_status.participants == ["robot_0", "robot_1"]
    team.resume_process(names.AGGREGATOR)
    team.wait_for(lambda: names.AGGREGATOR in team.sim_status.joining)
    team.until(lambda: team.robot(1).speed > 0.05, within=5)


class Planner:
    """A participant that implements the protocol of docs/time.md with Zenoh alone."""

    def __init__(self, session: zenoh.Session, namespace: str) -> None:
        self.ticks: list[int] = []
        self.silent = False
        self._done = session.declare_publisher(f"{namespace}/planner/done")
        self._subscriber = session.declare_subscriber(f"{namespace}/sim/tick", self._on_tick)
        self.token = session.liveliness().declare_token(f"{namespace}/planner/alive/1")

    def _on_tick(self, sample: zenoh.Sample) -> None:
        tick = decode(Tick, sample.payload.to_bytes())
        if not self.silent:
            self.ticks.append(tick.tick)
            self._done.put(encode(Done(tick.epoch, tick.tick)))


def test_any_language_can_take_part(team: TeamFixture, outsider: zenoh.Session) -> None:
    """Every tick waits for a plain participant; its silence holds the world until its token is gone."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.05}}, lockstep_timeout=600.0)
    planner = Planner(outsider, team.namespace)
    team.wait_for_go()
    team.wait_for(lambda: "planner" in {*team.sim_status.participants, *team.sim_status.joining})
    team.at(11)
    assert set(range(2, 12)) <= set(planner.ticks)
    assert "planner" in team.sim_status.participants
    planner.silent = True
    running = threading.Thread(target=team.run, args=(1.0,))
    running.start()
    team.wait_for_line(names.SIMULATOR, "waits for planner")
    assert team.tick == 12
    planner.token.undeclare()
    running.join(LIMIT)
    assert team.tick == 21


PLANNER = """
import sys
import zteam
from zteam.messages import Odometry

def main(node):
    odoms = {}
    node.subscribe("robot_$*/odom", Odometry, lambda key, odom: odoms.__setitem__(key, odom), every_tick=True)

    def step(now):
        stamps = {key: odom.header.stamp.sec * 10**9 + odom.header.stamp.nanosec for key, odom in odoms.items()}
        print("STEP", now // 10**8, sorted({stamp // 10**8 for stamp in stamps.values()}), len(stamps), flush=True)

    node.run(step)

sys.exit(zteam.run("planner", main))
"""


def start_planner(team: TeamFixture, tmp_path: Path) -> "subprocess.Popen[str]":
    """The user's own node, as a process."""
    import os

    (tmp_path / "planner.py").write_text(PLANNER)
    command, environment = [sys.executable, "-u", "planner.py"], {**os.environ, **team.environment}
    return subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True)


def test_a_users_node_sees_every_tick_whole(team: TeamFixture, tmp_path: Path) -> None:
    """Its step runs once per tick, with every robot's odometry of that tick."""
    team.start("arena", robots=2, behavior="forward")
    team.wait_for_go()
    with start_planner(team, tmp_path) as planner:
        team.wait_for(lambda: "planner" in team.sim_status.joining)
        team.run(3.0)
        planner.terminate()
        assert planner.stdout is not None
        steps = [line.split(maxsplit=2) for line in planner.stdout if line.startswith("STEP")]
        assert planner.wait(LIMIT) == 0
    assert [int(now) for _, now, _ in steps] == list(range(2, 32))
    assert all(rest.strip() == f"[{now}] 2" for _, now, rest in steps)


def test_a_users_node_works_in_real_time_too(team: TeamFixture, tmp_path: Path) -> None:
    """With a simulator in real time, the step of the same node gets increasing simulated times."""
    team.start("arena", robots=2, behavior="forward", lockstep=False)
    with start_planner(team, tmp_path) as planner:
        assert planner.stdout is not None
        lines = (line for line in planner.stdout if line.startswith("STEP"))
        times = [int(next(lines).split()[1]) for _ in range(5)]
        planner.terminate()
        planner.stdout.read()
        assert planner.wait(LIMIT) == 0
    assert times == sorted(set(times))


def test_a_frozen_subscriber_does_not_stall_the_world(team: TeamFixture) -> None:
    """A frozen process that subscribes to every topic takes no part in lock-step."""
    team.start("office", robots=2, follow={1: 0})
    team.wait_for_go()
    team.spawn("zteam", "topic", "echo", "**", name="spectator")
    team.until(lambda: len(team.lines("spectator")) > 10, within=60)
    team.pause_process("spectator")
    start = team.tick
    team.run(60.0)
    team.resume_process("spectator")
    assert (team.tick - start, team.report.hung) == (600, [])


def test_a_foreign_command_is_counted(team: TeamFixture, outsider: zenoh.Session) -> None:
    """A velocity from outside moves a robot without a process, and the report counts the command."""
    team.start("arena", robots=[0], behavior="forward", params={0: {"speed": 0.0}})
    team.wait_for_go()
    outsider.put(f"{team.namespace}/robot_1/cmd_vel", encode(Twist(Vector3(), Vector3(0.0, 0.0, 0.5))))
    team.wait_for(lambda: team.report.external_commands == 1)
    start = team.robot(1).pose.yaw
    team.run(0.2)
    assert team.robot(1).pose.yaw != start


@pytest.mark.parametrize("lockstep", [False, True])
def test_a_forged_tick_stops_no_team(team: TeamFixture, outsider: zenoh.Session, lockstep: bool) -> None:
    """Every process drops a forged message on the key of ticks, and the robot drives on."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.05}}, lockstep=lockstep)
    team.wait_for_go()
    forged = Tick(time_from_ns(0), 1, 10**6, participants=["robot_0", names.AGGREGATOR])
    outsider.put(f"{team.namespace}/{names.TICK}", encode(forged))
    # In lock-step the monitor subscribes to the first tick alone.
    for name in ("robot_0", names.AGGREGATOR) if lockstep else ("robot_0", names.AGGREGATOR, names.MONITOR):
        team.wait_for_line(name, f"dropped a message on {names.TICK}")
    start = team.robot(0).distance_travelled
    team.until(lambda: team.robot(0).distance_travelled > start + 0.05, within=10.0)


def test_the_pace_can_be_changed_in_lock_step(team: TeamFixture) -> None:
    """Resuming, pausing and spawning a robot during a run lose no tick and no participant."""
    team.start("office", robots=2, follow={1: 0})
    team.wait_for_go()

    team.sim.resume()
    team.wait_for(lambda: team.tick > 30)
    team.sim.pause()
    assert team.sim.spawn(20.0, 25.0) == 4
    team.run(1.0)
    assert team.robot(4).pose[:2] == (20.0, 25.0)
    assert 4 in team.sim_status.robots
    assert team.report.hung == []
