"""A stop with real processes: zero within 0.3 s whatever drives, in lock-step, and with certificates."""

import threading
from contextlib import closing
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam import names
from zteam.bus import BusOptions, connect
from zteam.clock import HOST_FACTOR, monotonic
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.navigation.client import NavigationClient, TaskResult, goal_message
from zteam.robot.client import StopClient
from zteam.team.security.access import OPERATOR
from zteam.team.security.certificates import files_of
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

ZERO = 0.3 * HOST_FACTOR
"""Host seconds after a query until zero velocity is commanded."""
FOUR = """
[team]
world = "arena"

[[robots]]
id = 0
behavior = "wander"

[[robots]]
id = 1
navigation = {localizer = "fake", planner_server.GridBased.tolerance = 0.2}

[[robots]]
id = 2
model = "erratic"
pose = [-3.5, 1.5, 0.0]
behavior = "idle"
"""
"""A robot that wanders, one that is navigated, and one that stands by itself; robot 3 is added without a process."""


class Pushing:
    """A program that commands a robot again and again, from outside the team's processes."""

    def __init__(self, team: TeamFixture, key: str, command: Twist) -> None:
        self._publisher, self._command = team.bus.publisher(key, Twist), command
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._over.wait(0.05):
            self._publisher.put(self._command)

    def __enter__(self) -> "Pushing":
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join(LIMIT)


class Commands:
    """The host time of each robot's last command that was not zero."""

    def __init__(self, team: TeamFixture, robots: list[int]) -> None:
        self.last = dict.fromkeys(robots, 0.0)
        for robot_id in robots:
            team.bus.subscribe(names.robot_key(robot_id, names.CMD_VEL), Twist, self._take)

    def _take(self, key: str, command: Twist) -> None:
        target = names.split_robot_key(key)
        if target is not None and command != Twist():
            self.last[target[0]] = monotonic()


def moves(team: TeamFixture, robot_id: int) -> bool:
    """Whether the robot drives or turns, in truth."""
    truth = team.robot(robot_id).truth
    return truth is not None and abs(truth.twist.twist.linear.x) + abs(truth.twist.twist.angular.z) > 0.01


def stands(team: TeamFixture, robots: list[int], seconds: float = 1.0) -> bool:
    """Whether none of these robots moves within so many simulated seconds."""
    before = [team.robot(i).pose for i in robots]
    team.run(seconds)
    return [team.robot(i).pose for i in robots] == before


@pytest.mark.real_time
def test_zero_is_commanded_whatever_drives(team: TeamFixture, tmp_path: Path) -> None:
    """A behaviour, navigation, teleop, and a foreign program at a body without a process: all stand, nothing of them
    ends, and after the release each goes on, navigation to its goal without a recovery."""
    (tmp_path / "four.toml").write_text(FOUR)
    team.launch(tmp_path / "four.toml", lockstep=False)
    team.wait_for_go()
    assert team.sim.spawn(-3.5, -3.5, robot_id=3) == 3
    robots = [0, 1, 2, 3]
    client = NavigationClient(team.bus, 1, lambda: round(team.now * 1e9))
    watch = client.send(goal_message(Pose2(3.5, -3.5, 0.0)))
    turn = Twist(angular=Vector3(z=0.5))
    with (
        Pushing(team, "robot_2/cmd_vel_teleop", turn),
        Pushing(team, "robot_3/cmd_vel", Twist(Vector3(0.0), Vector3(z=0.5))),
    ):
        team.until(lambda: all(moves(team, i) for i in robots), within=LIMIT)
        commands = Commands(team, [0, 1, 2])
        begin = monotonic()
        done = team.command("stop")
        assert done.returncode == 0, done.stderr
        assert [line.partition(",")[2] for line in done.stdout.splitlines()[:4]] == [
            *(f" confirmed by robot_{i}, sim" for i in (0, 1, 2)), " confirmed by sim",
        ]  # fmt: skip
        # The command's own start is not the robots'.
        stopped = monotonic()
        team.run(1.0)
        assert stands(team, robots, 12.0)
        assert max(commands.last.values()) < stopped + ZERO
        assert begin < stopped
        assert [team.robot(i).status.is_stopped for i in (0, 1, 2)] == [True] * 3
        assert (watch.result, client.is_stopped) == (TaskResult.UNKNOWN, True)
        said = team.command("teleop", "--id", "2", "--script", "i*3")
        assert (said.returncode, "robot_2: stopped (zteam stop --release)" in said.stderr) == (1, True)
        assert "'zteam stop' holds robots 0-3" in team.command("doctor").stdout
        assert team.command("stop", "--release").returncode == 0
        for robot_id in robots:
            team.until(lambda i=robot_id: moves(team, i), within=LIMIT)  # type: ignore[misc]
    team.until(lambda: watch.ended, within=60.0)
    assert watch.result == TaskResult.SUCCEEDED, watch.text
    assert watch.status is not None
    assert watch.status.recoveries == 0


def test_in_lockstep_a_stop_repeats(team: TeamFixture) -> None:
    """Between two ticks it takes effect with the next one, in one process as with processes, also where a robot's
    process starts again meanwhile. Afterwards the line goes on: its head does not hand over because it stood."""
    hashes = []
    with closing(TeamFixture()) as same_team:
        for one, in_process in ((team, False), (same_team, True)):
            one.start("office", 3, follow={1: 0, 2: 1}, seed=7, in_process=in_process)
            one.wait_for_go()
            one.run(5.0)
            one.stop()
            assert stands(one, [0, 1, 2], 10.0)
            one.restart("robot_1")
            assert stands(one, [0, 1, 2], 10.0)
            assert one.robot(1).status.is_stopped
            one.release()
            one.run(10.0)
            assert [one.robot(i).status.turns for i in range(3)] == [0, 0, 0]
            assert all(one.robot(i).speed > 0.1 for i in range(3))
            hashes.append(one.report.trajectory_sha256)
    assert hashes[0] == hashes[1]


def test_every_certificate_stops_and_few_release(team: TeamFixture, tmp_path: Path) -> None:
    """A node of the team stops all robots; the router drops its release, and the one of the operator passes."""
    file = tmp_path / "team.toml"
    node = '[[nodes]]\nname = "near"\ncommand = ["sleep", "1000"]\n'
    file.write_text('[team]\nworld = "arena"\n[[robots]]\nids = "0-1"\nbehavior = "wander"\n' + node)
    certs = tmp_path / "certs"
    team.launch(file, lockstep=False, secure=certs)
    team.wait_for_go()
    options = {
        name: BusOptions(team.endpoint, team.namespace, tls=files_of(certs, name)) for name in ("near", OPERATOR)
    }
    with (
        closing(connect(options["near"], patience=LIMIT)) as member,
        closing(connect(options[OPERATOR], patience=LIMIT)) as operator,
    ):
        for robots in (None, [0, 1]):
            assert [result.is_done for result in StopClient(member).engage(robots)] == [True, True]
            for robot_id, result in enumerate(StopClient(member).release(robots)):
                assert (result.is_done, result.missing) == (False, [f"robot_{robot_id}", "sim"])
                assert "this process's certificate may not ask for it" in result.problem
            assert team.sim_status.stopped == [0, 1]
            assert [result.is_done for result in StopClient(operator).release(robots)] == [True, True]
            assert team.sim_status.stopped == []
