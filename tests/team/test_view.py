"""The view of a real team: what pages see, what they may do, and that the team takes no notice of it."""

import math
import resource
import socket
from contextlib import ExitStack

import pytest
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from support.limits import LIMIT
from support.web_view import TOKEN, Page, open_page
from zteam import names
from zteam.messages import PoseStamped, Twist
from zteam.team.testing.team import TeamFixture
from zteam.view.frames import DOC, GRID, POSES, SCAN, TEAM

pytestmark = [pytest.mark.team, pytest.mark.gate]

FOXGLOVE = Subprotocol("foxglove.sdk.v1")


def start_view(team: TeamFixture, *further: str, name: str = names.VIEW) -> int:
    """Start a view of the team; the port of its page."""
    arguments = ("--port", "0", "--token", TOKEN, "--no-browser", "--name", name, *further)
    team.spawn("zteam-view", *arguments, name=name)
    team.wait_for_processes(name)
    team.wait_for_line(name, "the view is at http")
    line = next(line for line in team.lines(name) if "the view is at http" in line)
    return int(line.partition("127.0.0.1:")[2].partition("/")[0])


def look(page: Page, *layers: str, docs: tuple[str, ...] = ()) -> None:
    """The page shows these layers and documents."""
    page.say(op="look", layers=list(layers), docs=list(docs), beams=90)


def robots(page: Page) -> dict[int, dict[str, object]]:
    """The rows of the newest `team`."""
    return {row["id"]: row for row in page.docs.get("team", {}).get("robots", [])}


@pytest.mark.real_time
def test_a_page_sees_the_team(team: TeamFixture) -> None:
    """Map, poses, scans, the state of each robot, with its outline, and what the doctor finds."""
    team.start("office", 2, follow={1: 0}, lockstep=False)
    port = start_view(team)
    with open_page(port) as page:
        look(page, "scans", "tf", docs=("tf", "topics", "log", "doctor"))
        wanted = {(POSES, TEAM), (SCAN, 0), (SCAN, 1), (GRID, TEAM), (DOC, TEAM)}
        page.wait(lambda: wanted <= page.blocks.keys())
        page.wait(lambda: [row["state"] for row in robots(page).values()] == ["running", "running", *2 * ["undriven"]])
        page.wait(lambda: page.docs["team"]["outlines"])
        row = robots(page)[1]
        assert (row["behavior"], row["leader"], row["model"]) == ("follow", 0, "erratic")
        assert page.docs["team"]["outlines"][row["outline"]]
        page.wait(lambda: {"tf", "topics", "log"} <= page.docs.keys())
        wanted_frames = {"robot_0/base_footprint", "robot_1/base_laser_link"}
        page.wait(lambda: wanted_frames <= {frame["name"] for frame in page.docs["tf"]["frames"]})
        page.wait(lambda: any(row["hz"] for row in page.docs["topics"]))
        assert page.docs["team"]["gate"]["state"] == "go"
        page.wait(lambda: page.docs.get("doctor", {}).get("findings"))
        assert ("robots", "robot_0, robot_1") in {(row["what"], row["text"]) for row in page.docs["doctor"]["findings"]}


def test_the_token_is_in_no_log(team: TeamFixture) -> None:
    """A page that may only watch sees all logs, and must not learn there how to command."""
    team.start("arena", 1)
    port = start_view(team)
    with open_page(port, token="") as page:
        look(page, docs=("log",))
        lines: list[str] = []

        def heard() -> bool:
            lines.extend(line["text"] for line in page.docs.pop("log", []))
            return any("ready" in line for line in lines)

        page.wait(heard)
        assert TOKEN not in " ".join(lines)
        assert TOKEN not in team.command("log", "--once", "--json").stdout


def test_a_goal_goes_to_each_selected_robot(team: TeamFixture) -> None:
    """Two robots get goals beside each other; one whose behaviour takes none is named."""
    team.start("office", 3, behavior="go_to", follow={2: 1})
    heard: dict[str, PoseStamped] = {}
    team.bus.subscribe("robot_$*/goal_pose", PoseStamped, lambda key, goal: heard.update({key: goal}))
    with open_page(start_view(team)) as page:
        look(page, "goals")
        page.wait(lambda: len(robots(page)) == 4)
        assert page.command(op="goal", robots=[0, 1], x=12.0, y=26.0, yaw=0.5) == ""
        team.wait_for(lambda: {"robot_0/goal_pose", "robot_1/goal_pose"} <= heard.keys())
        places = [(goal.pose.position.x, goal.pose.position.y) for _, goal in sorted(heard.items())]
        assert min(math.dist(place, (12.0, 26.0)) for place in places) < 1e-6
        assert 0.8 < math.dist(*places) < 1.0
        page.wait(lambda: [goal["robot"] for goal in page.docs.get("goals", [])] == [0, 1])


@pytest.mark.real_time
def test_one_page_drives_a_robot_and_all_see_which(team: TeamFixture) -> None:
    """A second page is refused until the first lets go; commands go through the robot's process."""
    team.start("arena", 1, behavior="idle", lockstep=False)
    port = start_view(team)
    with open_page(port) as first, open_page(port) as second:
        assert first.command(op="take", robot=0) == ""
        viewer = first.welcome["viewer"]
        assert second.command(op="take", robot=0) == f"viewer {viewer} drives this robot"
        second.wait(lambda: robots(second).get(0, {}).get("lease") == viewer)
        first.say(op="drive", robot=0, linear=0.0, angular=0.5)
        first.wait(lambda: robots(first).get(0, {}).get("driver") == "teleop")
        assert first.command(op="release", robot=0) == ""
        assert second.command(op="take", robot=0) == ""


@pytest.mark.real_time
def test_a_page_that_is_closed_stops_its_robot(team: TeamFixture) -> None:
    """The robot turns as the page says, until the socket ends."""
    team.start("arena", 1, behavior="idle", lockstep=False)
    rates: list[float] = []
    team.bus.subscribe("robot_0/cmd_vel", Twist, lambda _, command: rates.append(command.angular.z))
    with open_page(start_view(team)) as page:
        assert page.command(op="take", robot=0) == ""

        def turns() -> bool:
            # What was said counts for half a second: a crowded machine may take longer.
            page.say(op="drive", robot=0, linear=0.0, angular=0.5)
            return bool(rates) and rates[-1] == 0.5

        team.wait_for(turns)
        page.close()
        team.wait_for(lambda: rates[-1] == 0.0)


@pytest.mark.real_time
def test_the_world_is_controlled_by_pages_with_the_token(team: TeamFixture) -> None:
    """Pause, step, speed, spawn, remove and drag; what is refused is told in words."""
    team.start("arena", 1, behavior="idle", lockstep=False)
    with open_page(start_view(team)) as page:
        page.wait(lambda: robots(page))
        assert page.command(op="pause") == ""
        page.wait(lambda: page.docs["team"]["sim"]["state"] == "paused")
        tick = team.sim_status.tick
        assert page.command(op="step", ticks=3) == ""
        team.wait_for(lambda: team.sim_status.tick == tick + 3)
        assert page.command(op="move", robot=0, x=1.0, y=1.0, yaw=0.0) == ""
        assert "no room" in page.command(op="move", robot=0, x=500.0, y=0.0, yaw=0.0)
        assert "--force" not in page.replies[max(page.replies)]
        assert page.command(op="spawn", model="erratic", x=-1.0, y=-1.0, yaw=0.0) == ""
        page.wait(lambda: len(robots(page)) == 2)
        assert page.command(op="remove", robot=1) == ""
        assert page.command(op="speed", factor=2.0) == ""
        assert page.command(op="resume") == ""
        page.wait(lambda: page.docs["team"]["sim"]["speed"] == 2.0)


def test_a_run_repeats_with_and_without_a_view(team: TeamFixture) -> None:
    """A view that watches, and is killed in the middle, leaves the trajectory as it is without one."""
    team.start("arena", 2, follow={1: 0}, seed=3)
    team.wait_for_go()
    team.sim.reset()
    team.run(10.0)
    alone = team.report.trajectory_sha256
    team.sim.reset()
    with open_page(start_view(team)) as page:
        look(page, "scans", "tf")
        page.wait(lambda: (SCAN, 1) in page.blocks)
        team.run(5.0)
        team.kill(names.VIEW)
        team.run(5.0)
    assert team.report.trajectory_sha256 == alone
    assert team.report.external_commands == 0


def test_a_view_ends_in_order(team: TeamFixture) -> None:
    """On SIGTERM, with a page open, with exit code 0; its socket is closed."""
    team.start("arena", 1)
    with open_page(start_view(team)) as page:
        page.wait(lambda: page.frames)
        # A process that does not end in time ends by force, and then with 1.
        assert team.stop(names.VIEW) == 0
        assert page.end()[0] in (1001, 1012, 1006)


@pytest.mark.real_time
def test_a_page_comes_before_the_team_and_stays_after_it(team: TeamFixture) -> None:
    """It sees no robot, then the team, then that its simulator has gone."""
    port = start_view(team)
    with open_page(port) as page:
        page.wait(lambda: page.docs.get("team", {}).get("sim", {}).get("present") is False)
        assert page.docs["team"]["robots"] == []
        team.start("arena", 1, lockstep=False)
        page.wait(lambda: (POSES, TEAM) in page.blocks)
        page.wait(lambda: robots(page).get(0, {}).get("state") == "running")
        team.kill(names.robot_name(0))
        page.wait(lambda: robots(page).get(0, {}).get("state") in ("lost", "absent"))
        team.kill(names.SIMULATOR)
        page.wait(lambda: page.docs["team"]["sim"]["present"] is False)


def test_a_page_opens_beside_more_connections_than_a_process_can_have(team: TeamFixture) -> None:
    """1150 that say nothing at the page's port, then at Foxglove's: pages still open, and the log stays short."""
    port = start_view(team, "--foxglove", "--foxglove-port", "0")
    team.wait_for_line(names.VIEW, "find the team at ws://")
    line = next(line for line in team.lines(names.VIEW) if "find the team at ws://" in line)
    other, before = int(line.rpartition(":")[2]), len(team.lines(names.VIEW))
    own = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, own[1]), own[1]))
    try:
        for flooded in (port, other):
            with ExitStack() as ends:
                for _ in range(1150):
                    ends.enter_context(socket.create_connection(("127.0.0.1", flooded), LIMIT))
                with open_page(port) as page, connect(f"ws://127.0.0.1:{other}", subprotocols=[FOXGLOVE]) as viewer:
                    assert page.welcome["may_command"] and "serverInfo" in str(viewer.recv(LIMIT))
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, own)
    assert len(team.lines(names.VIEW)) - before <= 2, team.lines(names.VIEW)[before:]
