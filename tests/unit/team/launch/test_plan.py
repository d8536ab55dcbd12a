"""A team as processes: what each is told, which a user could type as well."""

import sys
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import pytest

from zteam.cli import zteam_robot, zteam_sim
from zteam.config.resources import shipped_team
from zteam.geometry import Pose2
from zteam.node.kinds import KINDS
from zteam.node.launcher import Page, Report
from zteam.node.process_options import (
    AggregatorOptions,
    MapOptions,
    MonitorOptions,
    RobotOptions,
    SimOptions,
    ViewOptions,
    from_line,
)
from zteam.team.file.entries import NodeEntry, RobotEntry, StaticTransform, Team, TeamSection, static_transform
from zteam.team.file.reading import load_team
from zteam.team.launch.plan import MEMBER, LaunchPlan, plan_team, stop_order
from zteam.team.launch.process import zteam_command
from zteam.team.launch.supervisor import Job
from zteam.team.launch.team_launch import Pace, TeamLaunch, options_of

WORLD = Path("/w/office.world")
T = TypeVar("T")
TEAM = Team(
    robots=[
        RobotEntry(id=0, behavior="wander", params={"speed": 0.4, "name": "a b", "turns": [1, -2]}),
        RobotEntry(id=3, follow=0),
        RobotEntry(id=7, follow=3, model="erratic", pose=Pose2(-1.5, 3.25, -1e-7)),
        RobotEntry(id=8, pose=Pose2(0.0, -0.0, 3.0), model="my-robot"),
    ],
    team=TeamSection(seed=11),
)


def told(plan: LaunchPlan, name: str, kind: type[T]) -> T:
    """What a process of the plan reads from its standard input."""
    found, options = from_line(plan.own[name].words)
    assert found == name
    assert isinstance(options, kind)
    return options


def test_processes_are_in_the_order_of_starting() -> None:
    """The simulator first, because it starts slowest; robots in the order of the file; no router."""
    plan = plan_team(TeamLaunch(TEAM, WORLD))
    assert list(plan.own) == ["sim", "tf", "monitor", "robot_0", "robot_3", "robot_7", "robot_8"]
    assert {job.command for job in plan.own.values()} == {MEMBER}


def test_robots_stop_first_and_the_router_last() -> None:
    """A robot's zero velocity reaches the wheels through the router and the simulator."""
    order = stop_order([*plan_team(TeamLaunch(TEAM, WORLD)).jobs, "router"])
    assert order == [["robot_0", "robot_3", "robot_7", "robot_8"], ["tf", "monitor"], ["sim"], ["router"]]


def test_a_process_of_no_kind_stops_first() -> None:
    """A user's own process may command a robot, so its zero velocity must get through too."""
    plan = plan_team(TeamLaunch(TEAM, WORLD))
    plan.own["teleop"] = Job(["teleop"])
    plan.own["robot #7"] = Job(["robot"])
    order = stop_order([*plan.jobs, "router"])
    assert set(order[0]) == {"robot_0", "robot_3", "robot_7", "robot_8", "teleop", "robot #7"}
    assert order[1:] == [["tf", "monitor"], ["sim"], ["router"]]


def test_a_node_may_be_a_command_of_zteam() -> None:
    """It runs with this interpreter, as the other processes of the team do."""
    nodes = [
        NodeEntry("goals", ("zteam", "goals", "tour.yaml"), "/t"),
        NodeEntry("map", ("zteam-map", "office.yaml"), "/t"),
        NodeEntry("mine", ("zteam-mine",), "/t"),
    ]
    plan = plan_team(TeamLaunch(Team([RobotEntry(id=0)], nodes=nodes), WORLD))
    assert plan.nodes["goals"].command == zteam_command("zteam", "goals", "tour.yaml")
    assert plan.nodes["map"].command == zteam_command("zteam-map", "office.yaml")
    assert plan.nodes["mine"].command == ["zteam-mine"]


def test_a_map_takes_the_place_of_the_simulators_own() -> None:
    """The map server gets the file beside the team file, and the simulator is told to publish none."""
    team = Team([RobotEntry(id=0)], TeamSection(map="maps/hall.yaml"))
    plan = plan_team(TeamLaunch(team, WORLD, team_file=Path("/t/team.toml")))
    assert told(plan, "map", MapOptions) == MapOptions(Path("/t/maps/hall.yaml"))
    assert not told(plan, "sim", SimOptions).has_map
    assert stop_order([*plan.jobs, "router"])[1] == ["map", "tf", "monitor"]
    assert "map" not in plan_team(TeamLaunch(TEAM, WORLD)).own


def test_a_view_is_started_again_where_nothing_else_is() -> None:
    """It takes no part in the run, so it comes back by itself, at the address of its first page."""
    plan = plan_team(TeamLaunch(TEAM, WORLD, view=ViewOptions(name="view")))
    assert [name for name, job in plan.jobs.items() if job.restarts] == ["view"]


def test_nodes_are_jobs_that_stop_with_the_robots() -> None:
    """Each with its folder and its restart; `python` is this interpreter. Lock-step waits for those with `expect`."""
    nodes = [
        NodeEntry("planner", ("python", "planner.py", "2"), "/t", expect=True),
        NodeEntry("camera", ("/bin/camera",), "/u", restart="no"),
    ]
    team = Team([RobotEntry(id=0)], TeamSection(restart="on-failure"), nodes=nodes)
    plan = plan_team(TeamLaunch(team, WORLD, pace=Pace(lockstep=True)))
    assert plan.nodes == {
        "planner": Job([sys.executable, "planner.py", "2"], folder=Path("/t"), restarts=True, may_end=True),
        "camera": Job(["/bin/camera"], folder=Path("/u"), may_end=True),
    }
    assert plan.unawaited == {"camera"}
    lockstep = told(plan, "sim", SimOptions).lockstep
    assert lockstep is not None
    assert lockstep.expected == ("tf", "robot_0", "planner")
    order = stop_order([*plan.jobs, "router"])
    assert order == [["robot_0", "planner", "camera"], ["tf", "monitor"], ["sim"], ["router"]]


def test_the_word_of_the_team_holds_for_all_processes() -> None:
    """Robots may say otherwise; a run with an end is over without its simulator, because another one begins anew."""
    team = Team([RobotEntry(id=0), RobotEntry(id=1, restart="no")], TeamSection(restart="on-failure", map="hall.yaml"))

    def restarting(**of_the_run: Any) -> set[str]:
        plan = plan_team(TeamLaunch(team, WORLD, view=ViewOptions(name="view"), **of_the_run))
        return {name for name, job in plan.jobs.items() if job.restarts}

    assert restarting() == {"sim", "map", "tf", "monitor", "view", "robot_0"}
    assert restarting(run_for=1.0) == restarting(until=10) == restarting() - {"sim"}


def test_only_a_robot_that_says_so_is_started_again() -> None:
    """What a robot says holds for no other process."""
    plan = plan_team(TeamLaunch(Team([RobotEntry(id=0, restart="on-failure"), RobotEntry(id=1)]), WORLD))
    assert [name for name, job in plan.jobs.items() if job.restarts] == ["robot_0"]


def test_a_view_that_is_started_again_is_where_it_was() -> None:
    """With the port and the token of its first page, and without a further page in the user's browser."""
    job = plan_team(TeamLaunch(TEAM, WORLD, view=ViewOptions(host="::1", name="view"))).jobs["view"]
    assert job.learn(job, Report(listening="tcp/[::1]:8766")) is None
    again = job.learn(job, Report(page=Page(8766, "a b/c")))
    assert again is not None
    _, options = from_line(again.words)
    assert options == ViewOptions(host="::1", port=8766, token="a b/c", browser=False, name="view")
    assert msgspec.structs.replace(again, words=job.words) == job


def test_a_users_behaviour_is_imported_from_beside_the_team_file() -> None:
    """And from the current folder, after that."""
    team = Team(robots=[RobotEntry(id=0, behavior="mine:Spin")])
    plan = plan_team(TeamLaunch(team, WORLD, team_file=Path("/t/team.toml")))
    assert told(plan, "robot_0", RobotOptions).folders == ("/t", "")


def test_the_simulator_is_told_its_options() -> None:
    """Seed, time limit, additions and gaps arrive unchanged, negative numbers included."""
    options = told(plan_team(TeamLaunch(TEAM, WORLD, run_for=2.5)), "sim", SimOptions)
    assert (options.world, options.seed, options.run_for) == (WORLD, 11, 2.5)
    assert options.follows == {3: 0, 7: 3}
    assert options.added == ((7, "erratic", Pose2(-1.5, 3.25, -1e-7)), (8, "my-robot", Pose2(0.0, -0.0, 3.0)))


def test_the_simulator_gets_the_same_of_a_command_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a user types makes the same options as a team file."""
    words = ["/w/office.world", "--seed", "11", "--for", "2.5", "--gap", "3:0", "--gap", "7:3"]
    args = zteam_sim.build_parser().parse_args(
        [*words, "--add", "7:erratic:-1.5:3.25:-1e-7", "--add", "8:my-robot:0.0:-0.0:3.0"]
    )
    monkeypatch.setattr(zteam_sim, "find_world", Path)
    assert zteam_sim._read(args)[1]() == told(plan_team(TeamLaunch(TEAM, WORLD, run_for=2.5)), "sim", SimOptions)


def test_without_a_limit_the_simulator_runs_on() -> None:
    """The simulator gets no time limit if the user gave none."""
    assert told(plan_team(TeamLaunch(TEAM, WORLD)), "sim", SimOptions).run_for is None


def test_a_team_of_real_robots_has_no_simulator() -> None:
    """The other processes are the same, and the simulator's group of the stop order is empty."""
    plan = plan_team(TeamLaunch(TEAM, None))
    assert list(plan.own) == ["tf", "monitor", "robot_0", "robot_3", "robot_7", "robot_8"]
    assert stop_order([*plan.jobs, "router"])[2] == []


def test_the_monitor_waits_for_the_robots_of_the_file() -> None:
    """Exactly these ids, so that GO does not come before one of them is ready."""
    options = told(plan_team(TeamLaunch(TEAM, WORLD)), "monitor", MonitorOptions)
    assert (options.team_size, options.ids) == (4, (0, 3, 7, 8))


def test_robots_get_the_same_of_a_command_line() -> None:
    """Leader, behaviour, parameters and seed arrive unchanged, and are those that a user would type."""
    plan = plan_team(TeamLaunch(TEAM, WORLD))
    leader = ["--id", "0", "--behavior", "wander", "--param", "speed=0.4", "--param", "turns=[1,-2]", "--seed", "11"]
    for name, words in {
        "robot_0": [*leader, "--param", "name=a b"],
        "robot_3": ["--id", "3", "--follow", "0", "--seed", "11"],
    }.items():
        typed = zteam_robot._read(zteam_robot.build_parser().parse_args(words))[1]()
        assert typed == msgspec.structs.replace(told(plan, name, RobotOptions), folders=("",))


def test_the_aggregator_gets_the_files_static_transforms() -> None:
    """And the descriptions beside the file; a team without a file has none."""
    entry = StaticTransform("robot_0/base_link", "robot_0/camera", x=0.1)
    robots = [RobotEntry(id=0, description="arm.urdf"), RobotEntry(id=1)]
    team = Team(robots, static_transforms=[entry])
    options = told(plan_team(TeamLaunch(team, WORLD, team_file=Path("/t/team.toml"))), "tf", AggregatorOptions)
    assert options == AggregatorOptions((static_transform(entry),), {0: Path("/t/arm.urdf")})
    assert told(plan_team(TeamLaunch(TEAM, WORLD)), "tf", AggregatorOptions) == AggregatorOptions()


@pytest.mark.parametrize("seed", [0, 5, 2**62, -3])
def test_a_seed_on_the_command_line_wins(seed: int) -> None:
    """Simulator and robots get the same seed, 0 included."""
    plan = plan_team(TeamLaunch(TEAM, WORLD, given_seed=seed))
    assert told(plan, "sim", SimOptions).seed == seed
    assert {told(plan, name, RobotOptions).seed for name in plan.own if name.startswith("robot_")} == {seed}


@pytest.mark.parametrize("name", ["line", "arena", "willow", "chain"])
def test_shipped_teams_make_a_plan(name: str) -> None:
    """Each process reads what a shipped team file tells it."""
    path = shipped_team(name)
    assert path is not None
    launch = TeamLaunch(load_team(path), WORLD, team_file=path, run_for=1.0)
    plan = plan_team(launch)
    for kind in KINDS:
        for each, options in options_of(kind, launch).items():
            assert told(plan, each, type(options)) == options
