"""Bad links of real processes: cut, late and lossy ones."""

import shutil
from pathlib import Path

import pytest

from support.pairs import LINE
from zteam import names
from zteam.clock import HOST_FACTOR, monotonic
from zteam.config.resources import find_world
from zteam.messages import Odometry, ns_from_time
from zteam.monitor.observer import TeamObserver
from zteam.team.chaos.carry_out import Watchdog
from zteam.team.chaos.links import Link
from zteam.team.chaos.means import Wire
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

CUT, LONG_CUT = 3.0, 20.0
"""Host seconds: the lease of real time is 2."""
MOST_MOTION = 0.3
"""Simulated seconds for which a robot moves after its last command."""
BACK = 1.0 * HOST_FACTOR
"""Seconds after which it moves again on a good link, of simulated time, which is no faster than the host's."""
STANDS = 1e-6
"""m/s or rad/s."""
LATE = Wire(delay=1.6)
RATE = Wire(rate=50_000.0)
LAST_TICK = 60


def link_of(team: TeamFixture, name: str) -> Link:
    """The link of a process."""
    assert team._processes.links is not None
    return team._processes.links._links[name]


def test_a_cut_link_does_not_change_a_run_of_lock_step(team: TeamFixture) -> None:
    """The world waits while simulator, aggregator, monitor or a robot is cut off for 3 s, or all are for 20 s."""
    team.start("office", robots=2, follow={1: 0}, lockstep_timeout=60.0, chaos=True)
    team.wait_for_go()
    assert team._processes.links is not None
    every = (names.SIMULATOR, names.AGGREGATOR, names.MONITOR, "robot_1")
    hashes = []
    for cut_off, seconds in (((), 0.0), *(((name,), CUT) for name in every), (every, LONG_CUT)):
        team.sim.reset()
        team.at(20)
        begin = monotonic()
        for name in cut_off:
            team._processes.links.change(name, Wire(stalled=True), seconds)
        team.at(LAST_TICK)
        assert monotonic() - begin >= (0.0 if cut_off == (names.MONITOR,) else seconds)
        hashes.append(team.report.trajectory_sha256)
    assert hashes == hashes[:1] * len(hashes)
    assert team.report.hung == []


def drive_in_line(team: TeamFixture, folder: Path) -> Watchdog:
    """Start four robots in real time, wait until all drive, and watch that none moves without commands."""
    (folder / "team.toml").write_text(LINE)
    team.launch(folder / "team.toml", lockstep=False, chaos=True)
    team.wait_for_go()
    team.until(lambda: all(team.robot(i).speed > 0.1 for i in range(4)), within=60.0)
    return Watchdog(TeamObserver(team.bus), lockstep=False)


def all_drive(team: TeamFixture, *robot_ids: int) -> None:
    """Wait until each of these robots has driven half a metre from now on."""
    goals = {i: team.robot(i).distance_travelled + 0.5 for i in robot_ids}
    team.until(lambda: all(team.robot(i).distance_travelled > goal for i, goal in goals.items()), within=60.0)


def pause_with_no_command_under_way(team: TeamFixture, robot_id: int) -> None:
    """Let the world stand still, and wait until the robot's command for the newest scan is with the simulator.

    The loop that commands also sends the status, once a second: of two, the second came after the command.
    """
    team.sim.pause()
    for _ in range(2):
        spoke = team.robot(robot_id).spoke
        team.wait_for(lambda spoke=spoke: team.robot(robot_id).spoke > spoke)  # type: ignore[misc]


@pytest.mark.real_time
def test_a_robot_that_is_cut_off_stops_and_its_line_waits(team: TeamFixture, tmp_path: Path) -> None:
    """By the ground truth it moves for 0.3 simulated s at most after its last command and then stands. It moves again
    within a second of the heal, and the others drive on."""
    observer = drive_in_line(team, tmp_path)
    link, robot, moved = link_of(team, "robot_3"), team.robot(3), list[float]()

    def on_truth(_key: str, truth: Odometry) -> None:
        if max(abs(truth.twist.twist.linear.x), abs(truth.twist.twist.angular.z)) > STANDS:
            moved.append(ns_from_time(truth.header.stamp) / 1e9)

    team.bus.subscribe(names.robot_key(3, names.GROUND_TRUTH), Odometry, on_truth)
    team.until(lambda: robot.speed > 0.1 and bool(moved), within=60.0)
    pause_with_no_command_under_way(team, 3)
    # It may look dead meanwhile.
    team.expect_end("robot_3")
    link.change(Wire(stalled=True), Wire(stalled=True))
    begin = team.sim_status.now / 1e9
    team.sim.resume()
    team.run(CUT)
    assert moved[-1] <= begin + MOST_MOTION + 1e-6, (begin, moved[-5:])
    healed = team.now
    link.change()
    team.until(lambda: moved[-1] > healed, within=BACK)
    all_drive(team, *range(4))
    assert observer.violations == []


@pytest.mark.real_time
def test_a_team_drives_on_slow_links(team: TeamFixture, tmp_path: Path) -> None:
    """All robots drive where every link is 100 ms late in both directions, then with 50 kB a second, into which scans
    of 271 beams fit; none drives without commands."""
    office = find_world("office")
    shutil.copy(office.with_suffix(".png"), tmp_path)
    (tmp_path / "office.world").write_text(office.read_text().replace("samples 1081", "samples 271"))
    observer = drive_in_line(team, tmp_path)
    assert team._processes.links is not None
    for name in team._processes.links._links:
        team._processes.links.change(name, Wire(delay=0.1))
    all_drive(team, *range(4))
    link_of(team, "robot_3").change(RATE, RATE)
    all_drive(team, *range(4))
    assert observer.violations == []


def late_commands(team: TeamFixture) -> int:
    """Commands of robot_1 that the simulator has refused because they came too late."""
    return next(robot.late_commands for robot in team.report.robots if robot.id == 1)


def stands(team: TeamFixture) -> bool:
    """Whether robot_1 does not move for half a second."""
    before = team.robot(1).pose
    team.run(0.5)
    return team.robot(1).pose == before


@pytest.mark.real_time
def test_old_commands_move_no_robot(team: TeamFixture) -> None:
    """With an uplink that is 1.6 s late robot_1 stands, though its commands come. On a late downlink it leaves out the
    scans, and stands. On a good link it drives again."""
    team.start("office", robots=2, follow={1: 0}, lockstep=False, chaos=True)
    team.wait_for_go()
    robot, link = team.robot(1), link_of(team, "robot_1")
    team.until(lambda: robot.speed > 0.05, within=30.0)
    link.change(up=LATE)
    team.wait_for(lambda: late_commands(team) > 2)
    # What is left of the last command in time.
    team.until(lambda: robot.speed == 0.0, within=10.0)
    assert all(stands(team) for _ in range(2))
    link.change()
    team.until(lambda: robot.speed > 0.05, within=30.0)
    link.change(down=LATE)
    team.wait_for_line("robot_1", f"{names.scan_key(1, 0)}: it came more than 0.5 s late")
    # Its time is late too: it learns after a while that its newest scan is old, and then brakes from no old command.
    before = robot.distance_travelled
    team.run(2.0)
    assert robot.distance_travelled == before
    link.change()
    team.until(lambda: robot.speed > 0.05, within=30.0)
