"""A whole team in lock-step: which circumstances leave a run the same bit for bit, and which change it."""

import hashlib
import random
import struct

import pytest

from support.in_process_team import NAMES, ROBOTS, InProcessTeam, TeamOptions, load_scene, run
from support.lockstep_doubles import lossy_bus
from zteam import names
from zteam.bus import Bus, MemoryHub
from zteam.messages import Bool, LaserScan, Odometry, Tick, Twist, Vector3
from zteam.sim import Engine
from zteam.simulator.client import SimReport
from zteam.simulator.process import lockstep


@pytest.fixture(scope="module")
def usual() -> SimReport:
    """The run with which others are compared."""
    return run()


def test_the_team_has_done_something(usual: SimReport) -> None:
    """Ten seconds count from the tick of GO on, no robot was late or dropped, and all have driven."""
    assert (usual.finished, usual.sim_seconds, usual.ticks) == (True, 10.0, 101)
    assert (usual.lockstep, usual.resends, usual.hung, usual.external_commands) == (True, 0, [], 0)
    assert [robot.late_steps for robot in usual.robots] == [0] * ROBOTS
    assert all(robot.distance_m > 2.0 and robot.stalls == 0 for robot in usual.robots)
    assert usual.trajectory_sha256 != hashlib.sha256().hexdigest()


@pytest.mark.ci
@pytest.mark.parametrize("order", [NAMES, NAMES[::-1], ("robot_1", "tf", "robot_2", "robot_0")])
def test_it_does_not_matter_when_processes_come(usual: SimReport, order: tuple[str, ...]) -> None:
    """They may come one by one while the first tick is held."""
    assert run(order=order, staggered=True).trajectory_sha256 == usual.trajectory_sha256


@pytest.mark.ci
@pytest.mark.parametrize(
    "order",
    [
        NAMES,
        NAMES[::-1],
        ("robot_1", "tf", "robot_0", "robot_2"),
    ],
)
@pytest.mark.parametrize("gate", [True, False])
def test_it_does_not_matter_with_an_earlier_go(usual: SimReport, order: tuple[str, ...], gate: bool) -> None:
    """The same with a GO that was given before, and without the gate."""
    report = run(order=order, staggered=True, standing_go=True, gate=gate)
    assert report.trajectory_sha256 == usual.trajectory_sha256


@pytest.mark.ci
@pytest.mark.parametrize("pace", [50.0, 1000.0])
def test_the_pace_does_not_matter(usual: SimReport, pace: float) -> None:
    """A world that waits for the host's clock between its ticks is the same world."""
    assert run(pace=pace).trajectory_sha256 == usual.trajectory_sha256


@pytest.mark.ci
def test_spectators_do_not_matter(usual: SimReport) -> None:
    """Subscribers of data on which no command depends make no difference."""
    with InProcessTeam() as team:
        seen: set[str] = set()
        for topic, kind in (
            (names.GROUND_TRUTH, Odometry),
            (names.ODOM, Odometry),
            (names.BASE_SCAN, LaserScan),
            (names.STALL, Bool),
            (names.CMD_VEL, Twist),
        ):
            team.hub.bus().subscribe(names.all_robots_key(topic), kind, lambda key, _: seen.add(key))
        assert team.finish().trajectory_sha256 == usual.trajectory_sha256
        assert len(seen) == 5 * ROBOTS


@pytest.mark.ci
@pytest.mark.parametrize("share", [0.02, 0.1])
def test_lost_messages_do_not_matter(usual: SimReport, monkeypatch: pytest.MonkeyPatch, share: float) -> None:
    """Lost ticks, answers, scans and transforms are sent again, and no robot acts on a part of its inputs."""
    monkeypatch.setattr(lockstep, "RESEND", 0.002)
    monkeypatch.setattr(lockstep, "MAX_RESEND", 0.01)
    chance = random.Random(1)
    lost: set[str] = set()
    heard: list[Tick] = []

    def loses(key: str) -> bool:
        # Other tests cover losses during the start.
        if not heard or heard[-1].tick < 2 or chance.random() >= share:
            return False
        lost.add(key.rpartition("/")[2])
        return True

    def open_bus(hub: MemoryHub, name: str) -> Bus:
        if name == names.SIMULATOR:
            hub.bus().subscribe(names.TICK, Tick, lambda _, tick: heard.append(tick))
        return lossy_bus(hub, loses)

    with InProcessTeam(open_bus=open_bus) as team:
        report = team.finish()
    assert report.trajectory_sha256 == usual.trajectory_sha256
    assert report.resends > 0
    assert lost >= {"tick", "done", "base_scan", "tf"}


def test_foreign_commands_do_not_matter_but_are_counted(usual: SimReport) -> None:
    """Commands of another process on `cmd_vel` do not move a robot that answers; the report counts them."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(50)
        team.hub.bus().publisher(names.robot_key(1, names.CMD_VEL), Twist).put(Twist(Vector3(1.0)))
        team.ask("resume")
        report = team.finish()
    assert report.external_commands == 1
    assert report.trajectory_sha256 == usual.trajectory_sha256


@pytest.mark.ci
def test_the_seed_matters(usual: SimReport) -> None:
    """The wanderer turns elsewhere, and the others follow it."""
    assert run(seed=2).trajectory_sha256 != usual.trajectory_sha256


@pytest.mark.ci
@pytest.mark.parametrize("speed", [0.81, 0.8000001])
def test_the_slightest_other_command_matters(usual: SimReport, speed: float) -> None:
    """A leader that is a little faster is another run."""
    assert run(speed=speed).trajectory_sha256 != usual.trajectory_sha256


def test_the_hash_is_that_of_the_poses(usual: SimReport) -> None:
    """The engine alone, given the commands that the answers carried, goes through the poses that were hashed.

    x, y, yaw as little-endian 64-bit floats, by robot id, for every tick from that of GO on.
    """
    with InProcessTeam() as team:
        report = team.finish()
    commands: dict[int, dict[int, Twist]] = {}
    for name, done in team.dones:
        robot_id = names.robot_id_of(name)
        if robot_id is not None and done.has_command:
            commands.setdefault(done.tick, {})[robot_id] = done.command
    world, robots = load_scene()
    engine = Engine(world, seed=1, robots=robots)
    trajectory = hashlib.sha256()
    go = min(tick.tick for tick in team.ticks if tick.epoch > 0)
    for tick in range(1, max(tick.tick for tick in team.ticks) + 1):
        engine.move(commands.get(tick - 1, {}))
        if tick >= go:
            for robot_id in sorted(robots):
                trajectory.update(struct.pack("<3d", *engine.truth(robot_id)))
    assert trajectory.hexdigest() == report.trajectory_sha256 == usual.trajectory_sha256
    assert len(commands) == report.ticks
