"""A whole team in lock-step: which circumstances leave a run the same bit for bit, and which change it."""

import hashlib
import math
import random
import struct
from typing import Any

import pytest

from support.in_process_team import NAMES, ROBOTS, InProcessTeam, TeamOptions, load_scene, run
from support.lockstep_doubles import lose_first, lossy_bus
from support.log_capture import captured_log
from zteam import names
from zteam.bus import Bus, MemoryHub
from zteam.messages import Bool, LaserScan, Odometry, Tick, Twist, Vector3
from zteam.sim import Engine
from zteam.simulator.client import MoveRequest, RemoveRequest, SimReport, SimStatus, SpawnReply, SpawnRequest
from zteam.simulator.process import lockstep


@pytest.fixture(scope="module")
def usual_run() -> tuple[InProcessTeam, SimReport]:
    """The run with which others are compared: the team that has ended, and the report."""
    with InProcessTeam() as team:
        return team, team.finish()


@pytest.fixture
def usual(usual_run: tuple[InProcessTeam, SimReport]) -> SimReport:
    """The report of that run."""
    return usual_run[1]


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ticks are soon sent again."""
    monkeypatch.setattr(lockstep, "RESEND", 0.002)
    monkeypatch.setattr(lockstep, "MAX_RESEND", 0.01)


def test_the_team_has_done_something(usual: SimReport) -> None:
    """Ten seconds count from the tick of GO on, no robot was late or dropped, and all have driven."""
    assert (usual.finished, usual.sim_seconds, usual.ticks) == (True, 10.0, 101)
    assert (usual.lockstep, usual.resends, usual.hung, usual.external_commands) == (True, 0, [], 0)
    assert [robot.late_steps for robot in usual.robots] == [0] * ROBOTS
    assert all(robot.distance_m > 2.0 and robot.stalls == 0 for robot in usual.robots)
    assert usual.trajectory_sha256 != hashlib.sha256().hexdigest()


@pytest.mark.ci
@pytest.mark.parametrize(
    "options",
    [
        {"order": NAMES, "staggered": True},
        {"order": NAMES[::-1], "staggered": True},
        {"order": NAMES[::-1], "staggered": True, "standing_go": True},
        {"order": ("robot_1", "tf", "robot_0", "robot_2"), "staggered": True, "standing_go": True, "gate": False},
        {"pace": 50.0},
    ],
)
def test_circumstances_do_not_matter(usual: SimReport, options: dict[str, Any]) -> None:
    """Neither when processes come, nor when GO does, nor whether the world waits for the host's clock between ticks."""
    assert run(**options).trajectory_sha256 == usual.trajectory_sha256


@pytest.mark.ci
@pytest.mark.parametrize("options", [{"seed": 2}, {"speed": 0.8000001}])
def test_the_seed_and_the_slightest_other_command_matter(usual: SimReport, options: dict[str, Any]) -> None:
    """The wanderer drives elsewhere, and the others follow it."""
    assert run(**options).trajectory_sha256 != usual.trajectory_sha256


def test_spectators_and_foreign_commands_do_not_matter(usual: SimReport) -> None:
    """Subscribers make no difference, and commands of another process on `cmd_vel` move no robot that answers; the
    report counts them."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        seen: set[str] = set()
        for topic, kind in (
            (names.GROUND_TRUTH, Odometry),
            (names.ODOM, Odometry),
            (names.BASE_SCAN, LaserScan),
            (names.STALL, Bool),
            (names.CMD_VEL, Twist),
        ):
            team.hub.bus().subscribe(names.all_robots_key(topic), kind, lambda key, _: seen.add(key))
        team.step(50)
        team.hub.bus().publisher(names.robot_key(1, names.CMD_VEL), Twist).put(Twist(Vector3(1.0)))
        team.ask("resume")
        report = team.finish()
    assert (report.external_commands, len(seen)) == (1, 5 * ROBOTS)
    assert report.trajectory_sha256 == usual.trajectory_sha256


@pytest.mark.ci
@pytest.mark.usefixtures("often")
def test_lost_messages_do_not_matter(usual: SimReport) -> None:
    """Lost ticks, answers, scans and transforms are sent again, and no robot acts on a part of its inputs."""
    chance = random.Random(1)
    lost: set[str] = set()
    heard: list[Tick] = []

    def loses(key: str) -> bool:
        # Another test covers losses during the start.
        if not heard or heard[-1].tick < 2 or chance.random() >= 0.1:
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


@pytest.mark.ci
@pytest.mark.usefixtures("often")
def test_a_start_survives_lost_transforms(usual: SimReport) -> None:
    """A robot that misses the held tick's transforms receives them again and becomes ready."""

    def open_bus(hub: MemoryHub, name: str) -> Bus:
        return lossy_bus(hub, lose_first(names.TF, 20)) if name == "robot_2" else hub.bus()

    with InProcessTeam(TeamOptions(order=NAMES[::-1], staggered=True), open_bus=open_bus) as team:
        assert team.finish().trajectory_sha256 == usual.trajectory_sha256


@pytest.mark.ci
def test_a_start_survives_an_aggregator_that_takes_its_name_late(usual: SimReport) -> None:
    """Transforms that it received before it may answer ticks are in the bundle that it repeats later."""
    team = InProcessTeam(TeamOptions(staggered=True))
    team.prepare(names.AGGREGATOR)
    aggregator = team.nodes[names.AGGREGATOR]

    def win(_key: str, _scan: LaserScan) -> None:
        if not aggregator.present:
            aggregator.become_present()

    team.hub.bus().subscribe(names.scan_key(2, 0), LaserScan, win)
    with team:
        assert team.finish().trajectory_sha256 == usual.trajectory_sha256


def test_the_hash_is_that_of_the_poses(usual_run: tuple[InProcessTeam, SimReport]) -> None:
    """The engine alone, given the commands that the answers carried, goes through the poses that were hashed.

    x, y, yaw as little-endian 64-bit floats, by robot id, for every tick from that of GO on.
    """
    team, report = usual_run
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
    assert trajectory.hexdigest() == report.trajectory_sha256
    assert len(commands) == report.ticks


@pytest.mark.ci
def test_a_reset_starts_the_same_run_again(usual: SimReport) -> None:
    """All processes forget the run, and robots that were added, removed or moved are as at the start; GO stays given.
    A repeat changes nothing."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(10)
        team.ask("spawn", SpawnReply, SpawnRequest(2.0, 0.0))
        team.ask("remove", SimStatus, RemoveRequest(2))
        team.ask("move", SimStatus, MoveRequest(0, 1.0, -1.0))
        team.step(10)
        assert team.ask("reset").robots == [0, 1, 2]
        team.step(10)
        scans: list[LaserScan] = []
        team.hub.bus().subscribe(names.scan_key(1, 0), LaserScan, lambda _, scan: scans.append(scan))
        team.ask("repeat")
        assert len(scans) == 1
        team.ask("resume")
        report = team.finish()
        assert (report.ticks, report.hung, report.resends) == (101, [], 0)
        team.ask("reset")
        hashes = {report.trajectory_sha256, team.finish().trajectory_sha256}
    assert hashes == {usual.trajectory_sha256}


def position(report: SimReport, robot_id: int) -> tuple[float, float]:
    """The robot's last position (m)."""
    (found,) = (robot for robot in report.robots if robot.id == robot_id)
    return found.pose[:2]


@pytest.mark.gate
def test_a_robot_may_be_removed() -> None:
    """Its process still takes part and delays no tick; its follower stands."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(20)
        assert team.ask("remove", SimStatus, RemoveRequest(0)).robots == [1, 2]
        team.step(20)
        before = position(team.report(), 1)
        status = team.step(20)
        assert status.participants == sorted(NAMES)
        assert status.waiting_for == ""
        assert position(team.report(), 1) == pytest.approx(before, abs=1e-6)
        assert "leader robot_0 not seen" in team.texts["robot_1"]


@pytest.mark.gate
def test_a_robot_may_be_added_and_driven() -> None:
    """The new robot and its process take part from the next tick on, and GO holds for them."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(20)
        assert team.ask("spawn", SpawnReply, SpawnRequest(-3.5, -1.5)) == SpawnReply(3)
        assert team.step(5).robots == [0, 1, 2, 3]
        still = position(team.report(), 3)
        assert still == pytest.approx((-3.5, -1.5))
        team.bring(["robot_3"])
        assert team.ask("status").joining == ["robot_3"]
        assert team.step(30).participants == ["robot_0", "robot_1", "robot_2", "robot_3", "tf"]
        assert math.dist(position(team.report(), 3), still) > 0.5
        assert team.report().hung == []


@pytest.mark.ci
def test_the_aggregator_may_end_and_come_back() -> None:
    """Without transforms the followers stop; with the new aggregator they follow again."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(20)
        team.end("tf")
        assert team.step(20).participants == ["robot_0", "robot_1", "robot_2"]
        stood = position(team.report(), 1)
        team.step(10)
        assert position(team.report(), 1) == pytest.approx(stood, abs=1e-6)
        team.bring(["tf"])
        team.step(20)
        assert math.dist(position(team.report(), 1), stood) > 0.1


@pytest.mark.gate
def test_a_process_that_gives_its_name_back_publishes_no_more() -> None:
    """It does not answer the tick that tells the others of its end, so no answer has to be dropped; and a new process
    receives latched messages while it is being made, without any error."""
    with captured_log() as log, InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(1)
        team.end("robot_2")
        team.step(1)
    assert log.count("no process holds this name") == 0
    assert log.count("error while handling") == 0
