"""A team as commands: each command parses its command line."""

import sys
from pathlib import Path

import pytest

from zteam.cli import zteam_map, zteam_monitor, zteam_robot, zteam_sim, zteam_tf
from zteam.geometry import Pose2
from zteam.launch.arguments import Pace
from zteam.launch.plan import Plan, launch_of, plan_team
from zteam.launch.process import zteam_command
from zteam.launch.supervisor import Job
from zteam.resources import shipped_team
from zteam.team_file import NodeEntry, RobotEntry, Team, TeamSection, load_team

WORLD = Path("/w/office.world")
BUS = ("--connect", "tcp/127.0.0.1:1", "--namespace", "t")
TEAM = Team(
    robots=[
        RobotEntry(id=0, behavior="wander", params={"speed": 0.4, "name": "a b", "turns": [1, -2]}),
        RobotEntry(id=3, follow=0),
        RobotEntry(id=7, follow=3, model="erratic", pose=Pose2(-1.5, 3.25, -1e-7)),
        RobotEntry(id=8, pose=Pose2(0.0, -0.0, 3.0), model="my-robot"),
    ],
    team=TeamSection(seed=11),
)


def arguments(plan: Plan, name: str) -> list[str]:
    """The arguments after `python -P -m zteam.cli.X`."""
    return plan.commands[name][4:]


def test_processes_are_in_the_order_of_starting() -> None:
    """The simulator first, because it starts slowest; robots in the order of the file; no router."""
    plan = plan_team(launch_of(TEAM, WORLD), BUS)
    assert list(plan.commands) == ["sim", "tf", "monitor", "robot_0", "robot_3", "robot_7", "robot_8"]
    assert plan.robots == ["robot_0", "robot_3", "robot_7", "robot_8"]
    modules = [command[3] for command in plan.commands.values()]
    first = ["zteam.cli.zteam_sim", "zteam.cli.zteam_tf", "zteam.cli.zteam_monitor"]
    assert modules == first + ["zteam.cli.zteam_robot"] * 4


def test_robots_stop_first_and_the_router_last() -> None:
    """A robot's zero velocity reaches the wheels through the router and the simulator."""
    order = plan_team(launch_of(TEAM, WORLD), BUS).stop_order()
    assert order == [["robot_0", "robot_3", "robot_7", "robot_8"], ["tf", "monitor"], ["sim"], ["router"]]


def test_a_process_of_no_kind_stops_first() -> None:
    """A user's own process may command a robot, so its zero velocity must get through too."""
    plan = plan_team(launch_of(TEAM, WORLD), BUS)
    plan.commands["teleop"] = ["teleop"]
    plan.commands["robot #7"] = ["robot"]
    order = plan.stop_order()
    assert set(order[0]) == {"robot_0", "robot_3", "robot_7", "robot_8", "teleop", "robot #7"}
    assert order[1:] == [["tf", "monitor"], ["sim"], ["router"]]


def test_a_node_may_be_a_command_of_zteam() -> None:
    """It runs with this interpreter, as the other processes of the team do."""
    nodes = [
        NodeEntry("goals", ("zteam", "goals", "tour.yaml"), "/t"),
        NodeEntry("map", ("zteam-map", "office.yaml"), "/t"),
        NodeEntry("mine", ("zteam-mine",), "/t"),
    ]
    plan = plan_team(launch_of(Team([RobotEntry(id=0)], nodes=nodes), WORLD), BUS)
    assert plan.nodes["goals"].command == zteam_command("zteam", "goals", "tour.yaml")
    assert plan.nodes["map"].command == zteam_command("zteam-map", "office.yaml")
    assert plan.nodes["mine"].command == ["zteam-mine"]


def test_a_map_takes_the_place_of_the_simulators_own() -> None:
    """The map server gets the file beside the team file, and the simulator is told to publish none."""
    team = Team([RobotEntry(id=0)], TeamSection(map="maps/hall.yaml"))
    plan = plan_team(launch_of(team, WORLD, team_file=Path("/t/team.toml")), BUS)
    assert arguments(plan, "map")[0] == "/t/maps/hall.yaml"
    assert "--no-map" in arguments(plan, "sim")
    assert zteam_map.build_parser().parse_args(arguments(plan, "map")).map == "/t/maps/hall.yaml"
    assert zteam_sim.build_parser().parse_args(arguments(plan, "sim")).no_map
    assert plan.stop_order()[1] == ["map", "tf", "monitor"]
    assert "map" not in plan_team(launch_of(TEAM, WORLD), BUS).commands


def test_nodes_are_jobs_that_stop_with_the_robots() -> None:
    """Each with its folder and its restart; `python` is this interpreter. Lock-step waits for those with `expect`."""
    nodes = [
        NodeEntry("planner", ("python", "planner.py", "2"), "/t", expect=True),
        NodeEntry("camera", ("/bin/camera",), "/u", restart="no"),
    ]
    team = Team([RobotEntry(id=0)], TeamSection(restart="on-failure"), nodes=nodes)
    plan = plan_team(launch_of(team, WORLD, pace=Pace(lockstep=True)), BUS)
    assert plan.nodes == {
        "planner": Job([sys.executable, "planner.py", "2"], folder=Path("/t"), restarts=True, may_end=True),
        "camera": Job(["/bin/camera"], folder=Path("/u"), may_end=True),
    }
    assert plan.restarts == {"robot_0"}
    assert plan.optional == {"camera"}
    assert zteam_sim.build_parser().parse_args(arguments(plan, "sim")).expect == ["tf", "robot_0", "planner"]
    assert plan.stop_order() == [["robot_0", "planner", "camera"], ["tf", "monitor"], ["sim"], ["router"]]


def test_a_users_behaviour_is_imported_from_beside_the_team_file() -> None:
    """Only the robot with such a behaviour gets the folder."""
    team = Team(robots=[RobotEntry(id=0, behavior="mine:Spin"), RobotEntry(id=1, behavior="avoid")])
    plan = plan_team(launch_of(team, WORLD, team_file=Path("/t/team.toml")), BUS)
    assert zteam_robot.build_parser().parse_args(arguments(plan, "robot_0")).path == ["/t"]
    assert zteam_robot.build_parser().parse_args(arguments(plan, "robot_1")).path == []


def test_the_simulator_takes_its_command() -> None:
    """Seed, time limit, additions and gaps arrive unchanged, negative numbers included."""
    args = zteam_sim.build_parser().parse_args(arguments(plan_team(launch_of(TEAM, WORLD, run_for=2.5), BUS), "sim"))
    assert (args.world, args.seed, args.run_for) == (str(WORLD), 11, 2.5)
    assert [zteam_sim.parse_gap(text) for text in args.gap] == [(3, 0), (7, 3)]
    additions = [zteam_sim.parse_addition(text) for text in args.add]
    assert additions == [(7, "erratic", Pose2(-1.5, 3.25, -1e-7)), (8, "my-robot", Pose2(0.0, 0.0, 3.0))]
    assert (args.connect, args.namespace) == ("tcp/127.0.0.1:1", "t")


def test_without_a_limit_the_simulator_runs_on() -> None:
    """The simulator gets no time limit if the user gave none."""
    assert zteam_sim.build_parser().parse_args(arguments(plan_team(launch_of(TEAM, WORLD), BUS), "sim")).run_for is None


def test_a_team_of_real_robots_has_no_simulator() -> None:
    """The other processes are the same, and the simulator's group of the stop order is empty."""
    plan = plan_team(launch_of(TEAM, None), BUS)
    assert list(plan.commands) == ["tf", "monitor", "robot_0", "robot_3", "robot_7", "robot_8"]
    assert plan.stop_order()[2] == []


def test_the_monitor_waits_for_the_robots_of_the_file() -> None:
    """Exactly these ids, so that GO does not come before one of them is ready."""
    args = zteam_monitor.build_parser().parse_args(arguments(plan_team(launch_of(TEAM, WORLD), BUS), "monitor"))
    assert zteam_monitor.parse_team(args.team_size, args.ids) == (4, (0, 3, 7, 8))


def test_robots_take_their_commands() -> None:
    """Leader, behaviour, parameters and seed arrive unchanged."""
    plan = plan_team(launch_of(TEAM, WORLD), BUS)
    leader = zteam_robot.build_parser().parse_args(arguments(plan, "robot_0"))
    assert (leader.id, leader.behavior, leader.follow, leader.seed) == ("0", "wander", None, 11)
    assert dict(map(zteam_robot.parse_param, leader.param)) == {"speed": 0.4, "name": "a b", "turns": [1, -2]}
    follower = zteam_robot.build_parser().parse_args(arguments(plan, "robot_7"))
    assert (follower.id, follower.follow, follower.behavior) == ("7", "3", None)
    assert follower.connect == "tcp/127.0.0.1:1"


def test_the_aggregator_gets_the_file() -> None:
    """The file has its static transforms; a team without a file gives no such argument."""
    path = Path("/t/team.toml")
    with_file = arguments(plan_team(launch_of(TEAM, WORLD, team_file=path), BUS), "tf")
    assert zteam_tf.build_parser().parse_args(with_file).team == str(path)
    assert zteam_tf.build_parser().parse_args(arguments(plan_team(launch_of(TEAM, WORLD), BUS), "tf")).team is None


@pytest.mark.parametrize("seed", [0, 5, 2**62, -3])
def test_a_seed_on_the_command_line_wins(seed: int) -> None:
    """Simulator and robots get the same seed, 0 included."""
    plan = plan_team(launch_of(TEAM, WORLD, seed=seed), BUS)
    assert zteam_sim.build_parser().parse_args(arguments(plan, "sim")).seed == seed
    assert {zteam_robot.build_parser().parse_args(arguments(plan, name)).seed for name in plan.robots} == {seed}


@pytest.mark.parametrize("name", ["line", "arena", "willow", "chain"])
def test_shipped_teams_make_a_plan(name: str) -> None:
    """Each command parses the command line that a shipped team file gives it."""
    path = shipped_team(name)
    assert path is not None
    plan = plan_team(launch_of(load_team(path), WORLD, team_file=path, run_for=1.0), BUS)
    zteam_sim.build_parser().parse_args(arguments(plan, "sim"))
    for each in plan.robots:
        zteam_robot.build_parser().parse_args(arguments(plan, each))
