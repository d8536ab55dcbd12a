"""Goals and initial poses by mouse: what arrives on the bus is what was clicked."""

import math

import pytest

from support.browser import OpenScreen, Screen, start_view
from zteam import names
from zteam.geometry import yaw_from_quaternion
from zteam.messages import Pose, PoseStamped, PoseWithCovarianceStamped
from zteam.team.testing.team import TeamFixture

PIXELS = 2
"""How far from the clicked place a pose may be."""


def yaw_of(pose: Pose) -> float:
    """The heading of a pose."""
    q = pose.orientation
    return yaw_from_quaternion(q.x, q.y, q.z, q.w)


def hear_goals(team: TeamFixture, *robots: int) -> list[tuple[str, PoseStamped]]:
    """The goals of these robots, as they arrive: key and message."""
    heard: list[tuple[str, PoseStamped]] = []
    for robot in robots:
        team.bus.subscribe(names.robot_key(robot, names.GOAL_POSE), PoseStamped, lambda *sent: heard.append(sent))
    return heard


def start_arena(team: TeamFixture, screen: Screen) -> None:
    """Two robots that stand until they have a goal, and a page that shows them."""
    team.start("arena", 2, behavior="go_to", lockstep=False)
    screen.open(start_view(team), 2)
    screen.wait("zteam.app.store.grids.size === 1")


def test_a_goal_arrives_where_it_was_clicked(team: TeamFixture, screen: Screen) -> None:
    """A press and a drag with the goal tool send the selected robot alone to that place, with that heading."""
    start_arena(team, screen)
    heard = hear_goals(team, 0, 1)
    screen.select(0)
    screen.tool("goal")
    screen.drag((0.5, 1.0), (1.0, 2.0))
    team.wait_for(lambda: len(heard) > 0)
    [(key, goal)] = heard
    assert key == names.robot_key(0, names.GOAL_POSE)
    assert goal.header.frame_id == names.MAP_FRAME
    assert goal.pose.position.x == pytest.approx(0.5, abs=PIXELS * screen.pixel)
    assert goal.pose.position.y == pytest.approx(1.0, abs=PIXELS * screen.pixel)
    assert yaw_of(goal.pose) == pytest.approx(math.atan2(1.0, 0.5), abs=0.05)
    screen.wait("zteam.app.store.docs.goals?.some(({robot, x, y}) => robot === 0 && Math.hypot(x - 0.5, y - 1) < 0.1)")
    team.wait_for(lambda: team.robot(0).distance_travelled > 0.2)


@pytest.mark.parametrize("turn", [0.0, 2.5])
def test_a_goal_arrives_on_a_turned_and_zoomed_map_of_a_dense_screen(
    team: TeamFixture, open_screen: OpenScreen, turn: float
) -> None:
    """Angle and scale of the camera, and a dense screen, do not move the place that was clicked."""
    screen = open_screen(device_scale_factor=2)
    start_arena(team, screen)
    heard = hear_goals(team, 1)
    screen.select(1)
    screen.ask("turn => zteam.app.camera.set({x: -2, y: 1, scale: 90, angle: turn})", turn)
    screen.tool("goal")
    screen.drag((-2.0, 0.5), (-2.5, 0.5))
    team.wait_for(lambda: len(heard) > 0)
    pose = heard[0][1].pose
    assert (pose.position.x, pose.position.y) == pytest.approx((-2.0, 0.5), abs=PIXELS * screen.pixel)
    assert abs(yaw_of(pose)) == pytest.approx(math.pi, abs=0.05)


def test_several_robots_spread_their_goals(team: TeamFixture, screen: Screen) -> None:
    """One click for two robots gives each a goal of its own, far enough apart for both to stand there."""
    start_arena(team, screen)
    heard = hear_goals(team, 0, 1)
    screen.select(0, 1)
    screen.tool("goal")
    screen.drag((0.0, 0.0), (1.0, 0.0))
    team.wait_for(lambda: len(heard) == 2)
    assert {key for key, _ in heard} == {names.robot_key(i, names.GOAL_POSE) for i in (0, 1)}
    (x0, y0), (x1, y1) = ((goal.pose.position.x, goal.pose.position.y) for _, goal in heard)
    assert math.hypot(x0 - x1, y0 - y1) > 0.5
    assert min(math.hypot(x0, y0), math.hypot(x1, y1)) < PIXELS * screen.pixel
    assert max(math.hypot(x0, y0), math.hypot(x1, y1)) < 2.0


def test_an_initial_pose_arrives_where_it_was_clicked(team: TeamFixture, screen: Screen) -> None:
    """A press and a drag with the pose tool tell the selected robot's localisation this place and heading."""
    start_arena(team, screen)
    heard: list[PoseWithCovarianceStamped] = []
    key = names.robot_key(1, names.INITIAL_POSE)
    team.bus.subscribe(key, PoseWithCovarianceStamped, lambda _key, sent: heard.append(sent))
    screen.select(1)
    screen.tool("pose")
    screen.drag((-3.0, -1.0), (-3.0, -2.0))
    team.wait_for(lambda: len(heard) > 0)
    pose = heard[0].pose.pose
    assert (pose.position.x, pose.position.y) == pytest.approx((-3.0, -1.0), abs=PIXELS * screen.pixel)
    assert yaw_of(pose) == pytest.approx(-math.pi / 2, abs=0.05)


def test_a_page_without_the_token_only_watches(team: TeamFixture, screen: Screen) -> None:
    """Its tools that command are disabled, and what its code sends all the same is refused."""
    team.start("arena", 2, behavior="go_to", lockstep=False)
    heard = hear_goals(team, 0)
    screen.open(start_view(team).partition("#")[0], 2)
    assert screen.page.locator("#tools [data-tool=goal]").is_disabled()
    assert "watching only" in screen.ask("zteam.app.send({op: 'goal', robots: [0], x: 0, y: 0, yaw: 0})")
    screen.ask("zteam.app.tell({op: 'goal', robots: [0], x: 0, y: 0, yaw: 0, seq: 1})")
    # Frames come in order after the refusal.
    screen.wait("n => zteam.app.store.frame.number > n", screen.ask("zteam.app.store.frame.number"))
    assert not heard
