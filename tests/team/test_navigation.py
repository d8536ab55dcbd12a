"""`zteam-nav` in a team: goals reached, replaced, cancelled and refused; the same run in one process."""

import math
from pathlib import Path
from typing import Any

import pytest

from support.navigated_team import DONE, FAKE, NavigatedTeam
from zteam import messages, names
from zteam.messages import Message, NavigationState, OccupancyGrid, PolygonStamped, PoseArray, ns_from_time
from zteam.messages.topics import is_latched
from zteam.navigation.client import GLOBAL_LOCALIZATION, GlobalLocalizationReply, GlobalLocalizationRequest
from zteam.robot.client import navigation_query
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

AMCL = """
[team]
world = "arena"
seed = 4
[simulation]
gaussian_noise = 0.02
odom_alphas = [0.1, 0.1, 0.1, 0.1]
[[robots]]
ids = "0-1"
navigation = true
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "team.toml"
    path.write_text(text)
    return path


def test_amcl_brings_robots_to_their_goals_in_processes_and_in_one(
    team: TeamFixture, same_team: TeamFixture, empty_folder: Path
) -> None:
    """With noisy odometry and scans, both robots of one process arrive, and each run has the same trajectory."""
    path, found = write(empty_folder, AMCL), []
    for one, in_process in ((team, False), (same_team, True)):
        one.launch(path, in_process=in_process)
        one.wait_for_go()
        nav = NavigatedTeam(one)
        nav.go(0, 3.0, 3.0)
        nav.go(1, 3.0, -4.0)
        nav.wait(0, *DONE, within=40.0)
        nav.wait(1, *DONE, within=40.0)
        assert [nav.state(i) for i in (0, 1)] == [NavigationState.SUCCEEDED] * 2
        assert nav.distance(0, 3.0, 3.0) < 0.5
        found.append((one.tick, one.report.trajectory_sha256))
    assert found[0] == found[1]


def test_a_new_goal_replaces_the_old_one_and_a_query_cancels_it(same_team: TeamFixture, empty_folder: Path) -> None:
    """The robot turns to the new goal at once; canceled, it stands and takes the next goal."""
    same_team.launch(write(empty_folder, FAKE), in_process=True)
    same_team.wait_for_go()
    nav = NavigatedTeam(same_team)
    assert not nav.cancel(0)
    nav.go(0, 3.0, 3.0)
    same_team.run(3.0)
    nav.go(0, -3.0, -4.0)
    same_team.run(0.3)
    assert (nav.state(0), nav.newest(0).goal.pose.position.x) == (NavigationState.DRIVING, -3.0)
    same_team.run(2.0)
    assert nav.cancel(0)
    nav.wait(0, NavigationState.CANCELED, within=0.3)
    same_team.run(0.3)
    stands = same_team.robot(0).pose
    same_team.run(1.0)
    assert same_team.robot(0).pose == stands
    nav.go(0, -3.0, 0.0)
    nav.wait(0, *DONE, within=40.0)
    assert nav.state(0) is NavigationState.SUCCEEDED


def test_a_goal_that_is_not_finite_is_refused_as_programs_send_it(team: TeamFixture, empty_folder: Path) -> None:
    """A goal with NaN: a reason in the status, the robot stops, and the next goal works."""
    team.launch(write(empty_folder, FAKE))
    team.wait_for_go()
    nav = NavigatedTeam(team)
    nav.go(0, 3.0, 3.0)
    nav.wait(0, NavigationState.DRIVING, within=1.0)
    nav.go(0, math.nan, 1.0)
    nav.wait(0, NavigationState.ABORTED, within=1.0)
    assert nav.newest(0).text.startswith("the goal cannot be read: ")
    assert "not finite" in nav.newest(0).text
    team.run(0.5)
    stands = team.robot(0).pose
    team.run(0.5)
    assert team.robot(0).pose == stands
    nav.go(0, 0.0, -1.0)
    nav.wait(0, *DONE, within=20.0)
    assert nav.state(0) is NavigationState.SUCCEEDED


def test_a_robot_stops_when_its_navigation_is_killed(team: TeamFixture, empty_folder: Path) -> None:
    """Half a second later the velocity mux no longer obeys; a new process is navigated by a new goal."""
    team.launch(write(empty_folder, FAKE))
    team.wait_for_go()
    nav = NavigatedTeam(team)
    nav.go(0, 3.0, 3.0)
    team.run(3.0)
    team.kill("nav_0")
    team.run(0.8)
    stands = team.robot(0).pose
    team.run(1.0)
    assert team.robot(0).pose == stands
    team.restart("nav_0")
    team.run(0.3)
    nav.go(0, 3.0, 3.0)
    nav.wait(0, NavigationState.SUCCEEDED, within=30.0)


def test_a_second_process_for_a_robot_is_refused(team: TeamFixture, empty_folder: Path) -> None:
    """Also when it is the first of several robots of one process and the second of another."""
    team.launch(write(empty_folder, AMCL))
    second = team.spawn("zteam-nav", "--id", "1", "--localizer", "none", name="second")
    assert team.wait_for_exit(second) == 1
    assert any("nav_1 is taken by process" in line for line in team.lines(second))


def test_after_a_reset_the_robot_begins_anew(same_team: TeamFixture, empty_folder: Path) -> None:
    """It has no goal, knows its start again, and drives to the next goal."""
    same_team.launch(write(empty_folder, AMCL), in_process=True)
    same_team.wait_for_go()
    nav = NavigatedTeam(same_team)
    nav.go(0, 3.0, 3.0)
    same_team.run(3.0)
    same_team.sim.reset()
    same_team.run(1.0)
    assert nav.state(0) is NavigationState.IDLE
    nav.go(0, 1.0, 0.0)
    nav.wait(0, *DONE, within=20.0)
    assert nav.state(0) is NavigationState.SUCCEEDED


def test_what_is_for_looking_at_is_published_while_there_is_a_subscriber(
    same_team: TeamFixture, empty_folder: Path
) -> None:
    """Pose, plan and costmaps are there for a late subscriber too; costmaps come at most twice a second. A robot whose
    particles are spread by a query says that it is lost."""
    same_team.launch(write(empty_folder, AMCL), in_process=True)
    same_team.wait_for_go()
    nav = NavigatedTeam(same_team)
    nav.go(0, 3.0, 3.0)
    same_team.run(2.0)
    heard: dict[str, list[Any]] = {}
    kinds = {
        names.PLAN: messages.Path,
        names.LOCAL_PLAN: messages.Path,
        names.GLOBAL_COSTMAP: OccupancyGrid,
        names.LOCAL_COSTMAP: OccupancyGrid,
        names.AMCL_POSE: messages.PoseWithCovarianceStamped,
        names.PARTICLE_CLOUD: PoseArray,
        names.PUBLISHED_FOOTPRINT: PolygonStamped,
    }
    subscribed = same_team.now
    for topic, kind in kinds.items():
        heard[topic] = []

        def take(_key: str, message: Message, topic: str = topic) -> None:
            heard[topic].append(message)

        same_team.bus.subscribe(names.robot_key(0, topic), kind, take, latched=is_latched(f"robot_0/{topic}"))
    same_team.run(3.0)
    assert {topic for topic, received in heard.items() if not received} == set()
    first = {topic: ns_from_time(received[0].header.stamp) / 1e9 for topic, received in heard.items()}
    assert first[names.AMCL_POSE] <= subscribed
    assert first[names.PLAN] <= subscribed < first[names.GLOBAL_COSTMAP]
    assert all(len(heard[topic]) <= 6 for topic in (names.GLOBAL_COSTMAP, names.LOCAL_COSTMAP))
    whole, near = heard[names.GLOBAL_COSTMAP][-1], heard[names.LOCAL_COSTMAP][-1]
    assert isinstance(whole, OccupancyGrid) and isinstance(near, OccupancyGrid)
    assert (whole.info.width, near.info.width) == (200, 60)
    assert (int(whole.data.min()), int(whole.data.max())) == (0, 100)
    cloud, outline = heard[names.PARTICLE_CLOUD][-1], heard[names.PUBLISHED_FOOTPRINT][-1]
    assert isinstance(cloud, PoseArray) and len(cloud.poses) >= 500
    assert isinstance(outline, PolygonStamped) and len(outline.polygon.points) == 4
    key = navigation_query(0, GLOBAL_LOCALIZATION)
    assert same_team.bus.ask(key, GlobalLocalizationReply, GlobalLocalizationRequest()).refused == ""
    same_team.until(lambda: "it is lost" in nav.newest(0).text, 0.5)
