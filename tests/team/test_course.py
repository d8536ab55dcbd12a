"""The course's promises, step by step: what each step says that a reader sees is looked at, in short lock-step runs."""

import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from support.limits import LIMIT
from support.paces import BOTH_PACES
from support.pages import DOCS, Block, blocks_of, find_file
from zteam import names
from zteam.bus.receiving import KeyCount
from zteam.messages import PoseWithCovarianceStamped, Twist, Vector3
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture
from zteam.transforms.client import TransformClient

pytestmark = pytest.mark.team

PAGE = DOCS / "course.md"
TESTS = DOCS.parent / "tests"
PROVED_BY = {
    1: "test_a_command_works",
    2: "test_a_png_shows_walls_and_robots_where_they_are",
    3: "test_blocks_work_beside_a_team",
    4: "test_a_command_drives_a_robot_that_has_no_process",
    5: "test_a_program_drives_a_robot_and_another_is_refused",
    6: "test_a_laser_on_top_looks_over_the_others",
    7: "test_lasers_in_mutual_sight_dazzle_each_other",
    8: "test_the_stopper_stands_before_the_first_obstacle",
    10: "test_processes_of_one_terminal_each_start_together",
    11: "test_blocks_work_beside_a_team",
    12: "test_frames_begin_at_the_start_poses_and_have_their_robots_names",
    13: "test_the_carrot_swings",
    14: "test_frames_begin_at_the_start_poses_and_have_their_robots_names",
    15: "test_blocks_work_beside_a_team",
    16: "test_the_follower_keeps_its_distance",
    17: "test_the_chain_follows",
    18: "test_a_user_leads_a_line",
    19: "test_the_formation_keeps_its_places",
    20: "test_robots_are_moved_added_and_removed",
    21: "test_a_described_robot_has_its_joints_in_the_tree",
    22: "test_walkers_walk",
    23: "test_a_robot_drives_on_a_drawn_map",
    24: "test_localisation_and_goals",
    25: "test_localisation_and_goals",
    26: "test_localisation_and_goals",
    27: "test_a_goal_goes_to_each_selected_robot",
    28: "test_blocks_work_beside_a_team",
}
"""Which test looks at what a step promises. Step 9 promises nothing."""


def block(step: int, language: str) -> Block:
    """The first block of this language in a step."""
    text = PAGE.read_text()
    begin = text[: text.index(f"\n## {step}. ")].count("\n") + 2
    return next(found for found in blocks_of(PAGE) if found.line > begin and found.language == language)


def launch(team: TeamFixture, step: int, folder: Path, *changes: tuple[str, str]) -> None:
    """Start the team file of a step in this process, changed so, and wait for GO."""
    path = block(step, "toml").save(folder)
    text = path.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    team.launch(path, in_process=True)
    team.wait_for_go()


def test_every_step_has_a_test() -> None:
    """Each step of the page but the one that promises nothing names a test that exists."""
    steps = [int(number) for number in re.findall(r"^## (\d+)\. ", PAGE.read_text(), re.MULTILINE)]
    assert steps == list(range(1, 29))
    assert sorted(PROVED_BY) == [step for step in steps if step != 9]
    written = "\n".join(path.read_text() for path in TESTS.rglob("test_*.py"))
    assert not [name for name in PROVED_BY.values() if f"def {name}(" not in written]


def test_a_command_drives_a_robot_that_has_no_process(team: TeamFixture) -> None:
    """Step 4: `zteam topic pub` moves robot 2 by 0.2 m a second, and after Ctrl+C it stands within 0.2 s."""
    team.spawn("zteam-sim", "office", "--paused", name=names.SIMULATOR)
    team.wait_for_processes(names.SIMULATOR)

    def heard() -> int:
        counts = team.bus.ask(names.stats_key(names.SIMULATOR), dict[str, KeyCount])
        return counts.get("robot_2/cmd_vel", KeyCount()).received

    team.wait_for(lambda: team.robot(2).truth is not None)
    begin = team.robot(2).pose.x
    words = ["topic", "pub", "-r", "10", "robot_2/cmd_vel", "Twist", "{linear: {x: 0.2}}"]
    with subprocess.Popen(zteam_command("zteam", *words), env=team_environment(team)) as process:
        for count in range(1, 21):
            team.wait_for(lambda least=count: heard() >= least)  # type: ignore[misc]
            team.sim.step()
        process.send_signal(signal.SIGINT)
        assert process.wait(LIMIT) == 130
    team.sim.step(3)
    team.wait_for(lambda: team.robot(2).speed == 0.0)
    assert 0.2 * 2.0 <= team.robot(2).pose.x - begin + 1e-6 <= 0.2 * 2.3


@pytest.mark.real_time
def test_a_program_drives_a_robot_and_another_is_refused(team: TeamFixture, empty_folder: Path) -> None:
    """Step 5: the second one is told which process is robot 2 already; after Ctrl+C the robot stands."""
    find_file("move_robot.py", PAGE).save(empty_folder)
    team.spawn("zteam-sim", "office", name=names.SIMULATOR)
    team.wait_for_processes(names.SIMULATOR)
    words, environment = [sys.executable, "move_robot.py", "2"], team_environment(team)
    with subprocess.Popen(words, env=environment) as process:
        team.wait_for(lambda: team.robot(2).speed > 0.19)
        second = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=LIMIT, check=False)
        process.send_signal(signal.SIGINT)
        assert process.wait(LIMIT) == 0
    assert second.returncode == 1
    assert f"robot_2 is taken by process {process.pid} " in second.stderr
    team.wait_for(lambda: team.robot(2).speed == 0.0)


@pytest.mark.real_time
def test_robots_are_moved_added_and_removed(team: TeamFixture) -> None:
    """Steps 2 and 20: robot 2 is where the command put it; robot 4 drives with its process, and then is gone."""
    team.spawn("zteam-sim", "office", name=names.SIMULATOR)
    team.spawn("zteam-tf", name=names.AGGREGATOR)
    team.wait_for_processes(names.SIMULATOR, names.AGGREGATOR)
    assert team.command("sim", "move", "2", "20", "24", "0").returncode == 0
    team.wait_for(lambda: math.dist(team.robot(2).pose[:2], (20.0, 24.0)) < 1e-3)
    spawn, _ = block(20, "sh").code.splitlines()
    assert team.command(*shlex.split(spawn)[1:]).returncode == 0
    team.spawn("zteam-robot", "--id", "4", "--behavior", "wander", "--no-gate", name="robot_4")
    team.wait_for(lambda: team.robot(4).distance_travelled > 0.2)
    assert team.command("sim", "remove", "4").returncode == 0
    team.wait_for(lambda: team.sim_status.robots == [0, 1, 2, 3])


@BOTH_PACES
@pytest.mark.parametrize(("pose", "stops"), [("0.05 0 -0.1 0", True), ("0.05 0 0 0", False)])
def test_a_laser_on_top_looks_over_the_others(team: TeamFixture, empty_folder: Path, pose: str, stops: bool) -> None:
    """Step 6: let into the robot, the laser stops robot 1 before robot 0; on top it does not: a collision."""
    block(1, "sh").save(empty_folder)
    subprocess.run([sys.executable, "draw_floor.py"], check=True)
    world = empty_folder / "my.world"
    world.write_text(world.read_text().replace("scanner ( pose [0.05 0 -0.1 0] )", f"scanner ( pose [{pose}] )"))
    words = zteam_command("zteam", "world", "scan", "my.world", "--robot", "1", "--json")
    scanned = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    (empty_folder / "team.toml").write_text(
        '[team]\nworld = "my.world"\n[[robots]]\nid = 0\nbehavior = "idle"\n'
        '[[robots]]\nid = 1\nbehavior = "avoid"\nsafety = false\n'
    )
    team.launch(empty_folder / "team.toml", in_process=True)
    team.wait_for_go()
    ahead = team.robot(1).scan.ranges[540]
    # In real time it may have driven ahead.
    before = json.loads(scanned)["lasers"][0]["ranges"][540]
    assert ahead + team.robot(1).distance_travelled == pytest.approx(before, abs=0.1)
    assert (ahead < 1.5) == stops
    team.until(lambda: team.robot(1).distance_travelled > 0.2, within=30.0)
    team.until(lambda: team.robot(1).stall or (stops and team.robot(1).speed == 0.0), within=30.0)
    assert team.robot(1).stall != stops
    assert (team.robot(1).distance_to(0) > 0.5) == stops


@BOTH_PACES
def test_the_stopper_stands_before_the_first_obstacle(team: TeamFixture, empty_folder: Path) -> None:
    """Step 8: it has driven, and stands half a metre from what is nearest ahead; `zteam check` finds nothing."""
    find_file("stopper.py", PAGE).save(empty_folder)
    text = '[team]\nworld = "arena"\n[[robots]]\nid = 0\nbehavior = "stopper:Stopper"\n'
    (empty_folder / "team.toml").write_text(text)
    team.launch(empty_folder / "team.toml", in_process=True)
    team.wait_for_go()
    team.until(lambda: team.robot(0).distance_travelled > 0.5, within=20.0)

    def nearest() -> float:
        scan = team.robot(0).scan
        angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
        return float(scan.ranges[np.abs(angles) <= math.radians(60)].min())

    team.until(lambda: nearest() < 0.5, within=60.0)
    team.run(2.0)
    assert team.robot(0).speed == 0.0
    assert 0.3 < nearest() < 0.5
    subprocess.run(zteam_command("zteam", "check", "stopper:Stopper"), check=True)


@pytest.mark.real_time
def test_processes_of_one_terminal_each_start_together(team: TeamFixture) -> None:
    """Step 10: the page's commands, the monitor last; until then no robot drives, and then all do."""
    *others, monitor = (line.split() for line in block(10, "sh").code.splitlines())
    for number, words in enumerate(others):
        team.spawn(*words, name=f"robot_{number - 2}" if number > 1 else ("sim", "tf")[number])
    team.wait_for_processes("sim", "tf", *(f"robot_{i}" for i in range(4)))
    team.wait_for_line("robot_3", "waiting for the monitor")
    assert [team.robot(i).distance_travelled for i in range(4)] == [0.0] * 4
    team.spawn(*monitor, name=names.MONITOR)
    team.wait_for_line(names.MONITOR, "All robots GO!")
    team.wait_for(lambda: all(team.robot(i).distance_travelled > 0.1 for i in range(4)))


def test_frames_begin_at_the_start_poses_and_have_their_robots_names(team: TeamFixture) -> None:
    """Steps 12 and 14: `map -> robot_N/odom` is where the robot began, in one tree of all robots."""
    team.launch("line", in_process=True)
    team.wait_for_go()
    starts = [(13.0, 26.0), (10.75, 26.0), (13.0, 24.0), (10.75, 24.0)]
    team.run(5.0)
    client = TransformClient(team.bus)
    for robot_id, (x, y) in enumerate(starts):
        found = client.lookup_transform("map", f"robot_{robot_id}/odom").transform
        assert (found.translation.x, found.translation.y) == (x, y)
        client.lookup_transform("map", f"robot_{robot_id}/base_link")


def test_the_carrot_swings(team: TeamFixture, empty_folder: Path) -> None:
    """Step 13: the frame of the page stands half a metre to a metre and a half to robot 0's left."""
    scope: dict[str, Any] = {"__name__": "carrot"}
    exec(find_file("carrot.py", DOCS / "own-nodes.md").code, scope)
    team.start("arena", robots=1, behavior="idle", nodes={"carrot": scope["main"]}, in_process=True)
    team.wait_for_go()
    sides = []
    for _ in range(7):
        team.run(1.0)
        sides.append(
            TransformClient(team.bus).lookup_transform("robot_0/base_link", "robot_0/carrot").transform.translation.y
        )
    assert min(sides) < 0.7 < 1.3 < max(sides)


@BOTH_PACES
def test_the_follower_keeps_its_distance(team: TeamFixture, empty_folder: Path) -> None:
    """Step 16: robot 1 comes after robot 0, which goes on after its first wall; nearer than 0.8 m it soon stands."""
    launch(team, 16, empty_folder)
    least = math.inf

    def far() -> bool:
        nonlocal least
        # The leader may pass it by on its way back.
        if team.robot(1).speed > 0.1:
            least = min(least, team.robot(0).distance_to(1))
        return team.robot(1).distance_travelled > 10.0

    team.until(far, within=60.0)
    assert 0.6 < least < 1.0


@BOTH_PACES
def test_the_chain_follows(team: TeamFixture, empty_folder: Path) -> None:
    """Step 17: all four robots drive in a line, 0.8 m apart."""
    launch(team, 17, empty_folder)
    team.run(25.0)
    assert all(team.robot(i).distance_travelled > 8.0 for i in range(4))
    assert [team.robot(i).distance_to(i - 1) for i in (1, 2, 3)] == pytest.approx([0.8] * 3, rel=0.1)


@BOTH_PACES
def test_a_user_leads_a_line(team: TeamFixture, empty_folder: Path) -> None:
    """Step 18: what comes from the keyboard goes before the behaviour of robot 0, which stops before a wall; the others
    follow."""
    launch(team, 17, empty_folder, ('behavior = "wander"', 'behavior = "idle"'))
    keys = team.bus.publisher(names.robot_key(0, names.CMD_VEL_TELEOP), Twist)

    def held() -> bool:
        keys.put(Twist(Vector3(0.5)))
        return all(team.robot(i).distance_travelled > 2.0 for i in range(4))

    team.until(held, within=40.0)
    team.until(lambda: held() and abs(team.robot(0).speed) < 1e-3, within=120.0)
    assert team.robot(0).scan.ranges.min() > 0.1
    assert not team.robot(0).stall


@BOTH_PACES
def test_the_formation_keeps_its_places(team: TeamFixture, empty_folder: Path) -> None:
    """Step 19: after a minute robots 1 to 3 stand in a row across the leader's way, each at its side."""
    find_file("formation.py", PAGE).save(empty_folder)
    launch(team, 19, empty_folder)
    team.run(60.0)
    sides = [float(side) for side in re.findall(r"side = (\S+)", block(19, "toml").code)]
    assert team.robot(0).distance_travelled > 15.0
    for robot_id, side in zip((1, 2, 3), sides, strict=True):
        place = team.robot(0).pose.inverse().compose(team.robot(robot_id).pose)
        assert place.y == pytest.approx(side, abs=0.05)
        assert -1.7 < place.x < -1.0


@BOTH_PACES
def test_walkers_walk(team: TeamFixture, empty_folder: Path) -> None:
    """Step 22: the robots drive metres."""
    launch(team, 22, empty_folder)
    team.run(30.0)
    assert all(team.robot(i).distance_travelled > 2.0 for i in (0, 1))


@pytest.mark.real_time
def test_a_robot_drives_on_a_drawn_map(team: TeamFixture, empty_folder: Path) -> None:
    """Step 23: the simulator takes the map as its world; what it publishes lies as the file says."""
    block(23, "sh").save(empty_folder)
    subprocess.run([sys.executable, "draw_floor.py"], check=True)
    team.spawn("zteam-sim", "floor.yaml", "--add", "0:erratic:2.0:2.0:0", name=names.SIMULATOR)
    team.wait_for_processes(names.SIMULATOR)
    team.spawn("zteam-robot", "--id", "0", "--behavior", "forward", "--no-gate", name="robot_0")
    team.wait_for(lambda: team.robot(0).distance_travelled > 0.2)
    done = team.command("doctor", "--map", "floor.yaml")
    assert "floor.yaml" in done.stdout
    assert "map" not in "".join(line for line in done.stdout.splitlines() if line.startswith(("problem", "✗"))), (
        done.stdout
    )


@BOTH_PACES
def test_localisation_and_goals(team: TeamFixture, empty_folder: Path) -> None:
    """Steps 24 to 26: amcl is near the truth; both ways to send a goal, and the program, bring a robot there."""
    find_file("navigated.toml", PAGE).save(empty_folder)
    script = find_file("send_goals.py", PAGE).save(empty_folder)
    team.launch(empty_folder / "navigated.toml")
    team.wait_for_go()
    team.sim.resume()
    believed: list[PoseWithCovarianceStamped] = []
    team.bus.subscribe("robot_1/amcl_pose", PoseWithCovarianceStamped, lambda _key, pose: believed.append(pose))
    first, second = block(25, "sh").code.splitlines()
    assert team.command(*shlex.split(second)[1:]).returncode == 0
    done = team.command(*shlex.split(first)[1:])
    assert done.returncode == 0, done.stderr
    assert math.dist(team.robot(1).pose[:2], (20.0, 26.0)) < 0.5
    place = believed[-1].pose.pose.position
    assert math.dist((place.x, place.y), team.robot(1).pose[:2]) < 0.6
    team.wait_for(lambda: math.dist(team.robot(2).pose[:2], (22.0, 25.0)) < 0.5)
    ran = subprocess.run(
        [sys.executable, script], env=team_environment(team), capture_output=True, text=True, check=True
    )
    assert [line.strip() for line in ran.stdout.splitlines() if line.startswith(("SUCC", "FAIL"))] == ["SUCCEEDED"] * 2


def team_environment(team: TeamFixture) -> dict[str, str]:
    """The environment of a terminal beside the team."""
    return {**os.environ, **team.environment}
