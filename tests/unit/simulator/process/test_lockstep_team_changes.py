"""A whole team in lock-step: changes of world and processes between ticks, and disturbed starts."""

import math
from collections.abc import Callable

import pytest

from support.in_process_team import NAMES, InProcessTeam, TeamOptions, run
from support.lockstep_doubles import lose_first, lossy_bus
from support.log_capture import captured_log
from zteam import names
from zteam.bus import Bus, MemoryHub
from zteam.messages import LaserScan
from zteam.simulator.client import MoveRequest, RemoveRequest, SimReport, SimStatus, SpawnReply, SpawnRequest
from zteam.simulator.process import lockstep

pytestmark = pytest.mark.gate


def steps(*changes: Callable[[InProcessTeam], object]) -> SimReport:
    """A run in steps of 20 ticks with these changes in between; its report."""
    with InProcessTeam(TeamOptions(paused=True, run_for=None)) as team:
        for change in changes:
            team.step(20)
            change(team)
        team.step(20)
        return team.report()


def position(report: SimReport, robot_id: int) -> tuple[float, float]:
    """The robot's last position (m)."""
    (found,) = (robot for robot in report.robots if robot.id == robot_id)
    return found.pose[:2]


@pytest.mark.ci
def test_a_finished_run_may_be_run_again_and_again() -> None:
    """Each run has the same hash; GO stays given."""
    with InProcessTeam() as team:
        hashes = {team.finish().trajectory_sha256}
        for _ in range(3):
            team.ask("reset")
            hashes.add(team.finish().trajectory_sha256)
    assert len(hashes) == 1


@pytest.mark.ci
def test_a_reset_starts_the_same_run_again() -> None:
    """All processes forget the run, and robots that were added, removed or moved are as at the start."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(10)
        team.ask("spawn", SpawnReply, SpawnRequest(2.0, 0.0))
        team.ask("remove", SimStatus, RemoveRequest(2))
        team.ask("move", SimStatus, MoveRequest(0, 1.0, -1.0))
        team.step(10)
        assert team.ask("reset").robots == [0, 1, 2]
        team.ask("resume")
        report = team.finish()
    assert (report.ticks, report.hung, report.resends) == (101, [], 0)
    assert report.trajectory_sha256 == run().trajectory_sha256


@pytest.mark.ci
def test_a_robot_may_be_moved() -> None:
    """It drives on from its new place, and its follower turns to it there."""
    report = steps(lambda team: team.ask("move", SimStatus, MoveRequest(0, 0.0, -1.5, -math.pi / 2)))
    x, y = position(report, 0)
    assert x == pytest.approx(0.0, abs=0.1)
    assert -3.5 < y < -2.0
    calm = steps()
    assert position(report, 1)[1] < position(calm, 1)[1] - 0.1


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


@pytest.mark.ci
def test_a_repeat_changes_nothing() -> None:
    """Data that is sent again while the world stands still arrives, and moves no robot."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(20)
        scans: list[LaserScan] = []
        team.hub.bus().subscribe(names.scan_key(1, 0), LaserScan, lambda _, scan: scans.append(scan))
        team.ask("repeat")
        assert len(scans) == 1
        team.ask("resume")
        assert team.finish().trajectory_sha256 == run().trajectory_sha256


@pytest.mark.ci
def test_a_start_survives_lost_transforms(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot that misses the held tick's transforms receives them again and becomes ready."""
    monkeypatch.setattr(lockstep, "RESEND", 0.002)
    monkeypatch.setattr(lockstep, "MAX_RESEND", 0.01)

    def open_bus(hub: MemoryHub, name: str) -> Bus:
        return lossy_bus(hub, lose_first(names.TF, 20)) if name == "robot_2" else hub.bus()

    with InProcessTeam(TeamOptions(order=NAMES[::-1], staggered=True), open_bus=open_bus) as team:
        assert team.finish().trajectory_sha256 == run().trajectory_sha256


@pytest.mark.ci
def test_a_start_survives_an_aggregator_that_takes_its_name_late() -> None:
    """Transforms that it received before it may answer ticks are in the bundle that it repeats later."""
    team = InProcessTeam(TeamOptions(staggered=True))
    team.prepare(names.AGGREGATOR)
    aggregator = team.nodes[names.AGGREGATOR]

    def win(_key: str, _scan: LaserScan) -> None:
        if not aggregator.present:
            aggregator.become_present()

    team.hub.bus().subscribe(names.scan_key(2, 0), LaserScan, win)
    with team:
        assert team.finish().trajectory_sha256 == run().trajectory_sha256


def test_a_new_process_receives_latched_messages() -> None:
    """They arrive while it is being made, without any error."""
    with captured_log() as log, InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(1)
    assert log.count("error while handling") == 0


def test_a_process_that_gives_its_name_back_publishes_no_more() -> None:
    """It does not answer the tick that tells the others of its end, so no answer has to be dropped."""
    with captured_log() as log, InProcessTeam(TeamOptions(paused=True)) as team:
        team.step(1)
        team.end("robot_2")
        team.step(1)
        assert log.count("no process holds this name") == 0
