"""A team as processes: what each is told, which of them start again, and the order in which they stop."""

import sys
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import pytest

from zteam import names
from zteam.cli import main, processes
from zteam.config.resources import shipped_team
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.names import is_view, view_name
from zteam.node import kinds
from zteam.node.kinds import KINDS, Kind, kind_of
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
from zteam.team.launch import plan as planning
from zteam.team.launch.fork_server import PRELOADS
from zteam.team.launch.plan import MEMBER, LaunchPlan, Pace, TeamLaunch, options_of, plan_team, robot_job, stop_order
from zteam.team.launch.process import Job, zteam_command
from zteam.team.security.access import rights_of

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
ROBOTS = ["robot_0", "robot_3", "robot_7", "robot_8"]


SWARM = NodeEntry(name="swarm", command=("python", "swarm.py"))


@pytest.mark.parametrize(
    ("robots", "processes"),
    [
        ([], []),
        ([RobotEntry(id=i, behavior="none") for i in range(3)], []),
        ([RobotEntry(id=0, behavior="none"), RobotEntry(id=4, follow=0)], [4]),
    ],
    ids=["the world's", "by the user's program", "with a follower"],
)
def test_robots_without_a_behaviour_have_no_process(robots: list[RobotEntry], processes: list[int]) -> None:
    """GO waits for the others alone; the program that drives them is a node, whose certificate may do so."""
    team = Team(robots=robots, nodes=[SWARM])
    plan = plan_of(team)
    found = [name for name in plan.jobs if names.robot_id_of(name) is not None]
    assert found == [names.robot_name(i) for i in processes]
    monitor = told(plan, names.MONITOR, MonitorOptions)
    assert (monitor.team_size, monitor.ids) == (len(processes), tuple(processes))
    free = {names.robot_key(robot.id, names.CMD_VEL) for robot in robots} - {"robot_4/cmd_vel"}
    assert {key for key in rights_of(team)["swarm"].publishes if key.endswith(names.CMD_VEL)} == free


def plan_of(team: Team = TEAM, **of_the_run: Any) -> LaunchPlan:
    """The plan of a team in WORLD, unless the run says otherwise."""
    return plan_team(TeamLaunch(team, **{"world": WORLD, **of_the_run}))


def told(plan: LaunchPlan, name: str, kind: type[T]) -> T:
    """What a process of the plan reads from its standard input."""
    found, options = from_line(plan.jobs[name].words)
    assert found == name
    assert isinstance(options, kind)
    return options


def order_of(plan: LaunchPlan) -> list[list[str]]:
    """The order in which a plan's processes and the router stop."""
    return stop_order([*plan.jobs, "router"])


def test_processes_start_and_stop_in_order() -> None:
    """The simulator starts first, because it is slowest. Robots stop first, with the user's own processes, which may
    command robots: their zero velocity reaches the wheels through the router and the simulator."""
    plan = plan_of()
    assert list(plan.jobs) == ["sim", "tf", "monitor", *ROBOTS]
    assert {job.command for job in plan.jobs.values()} == {MEMBER}
    plan.jobs["robot #7"] = Job(["robot"])
    assert order_of(plan) == [[*ROBOTS, "robot #7"], ["tf", "monitor"], ["sim"], ["router"]]


def test_a_team_of_real_robots_has_no_simulator() -> None:
    """The other processes are the same, and stop in the same order."""
    plan = plan_of(world=None)
    assert list(plan.jobs) == ["tf", "monitor", *ROBOTS]
    assert order_of(plan) == [ROBOTS, ["tf", "monitor"], ["router"]]


def test_nodes_are_jobs_that_stop_with_the_robots() -> None:
    """Each with its folder and its restart; `python` is this interpreter, and zteam this zteam. Lock-step waits for
    those with `expect`."""
    nodes = [
        NodeEntry("planner", ("python", "planner.py", "2"), "/t", expect=True),
        NodeEntry("camera", ("/bin/camera",), "/u", restart="no"),
        NodeEntry("goals", ("zteam", "goals", "tour.yaml"), "/t"),
        NodeEntry("map", ("zteam-map", "office.yaml"), "/t"),
    ]
    team = Team([RobotEntry(id=0)], TeamSection(restart="on-failure"), nodes=nodes)
    plan = plan_of(team, pace=Pace(lockstep=True, expect=("mine",)))
    folder = Path("/t")
    assert {name: job for name, job in plan.jobs.items() if job.command != MEMBER} == {
        "planner": Job([sys.executable, "planner.py", "2"], folder=folder, restarts=True, may_end=True),
        "camera": Job(["/bin/camera"], folder=Path("/u"), may_end=True),
        "goals": Job(zteam_command("zteam", "goals", "tour.yaml"), folder=folder, restarts=True, may_end=True),
        "map": Job(zteam_command("zteam-map", "office.yaml"), folder=folder, restarts=True, may_end=True),
    }
    assert plan.unawaited == {"camera", "goals", "map"}
    lockstep = told(plan, "sim", SimOptions).lockstep
    assert lockstep is not None
    assert lockstep.expected == ("tf", "robot_0", "planner", "mine")
    assert order_of(plan)[0] == ["robot_0", "planner", "camera", "goals"]


def test_a_map_takes_the_place_of_the_simulators_own() -> None:
    """The map server gets the file beside the team file, and the simulator is told to publish none."""
    plan = plan_of(Team([RobotEntry(id=0)], TeamSection(map="maps/hall.yaml")), team_file=Path("/t/team.toml"))
    assert told(plan, "map", MapOptions) == MapOptions(Path("/t/maps/hall.yaml"))
    assert not told(plan, "sim", SimOptions).has_map
    assert order_of(plan)[1] == ["map", "tf", "monitor"]
    assert "map" not in plan_of().jobs


def test_the_word_of_the_team_holds_for_all_processes() -> None:
    """Robots may say otherwise; a run with an end is over without its simulator, because another one begins anew. A
    view comes back whatever the file says."""
    view = ViewOptions(name="view")

    def restarting(team: Team, **of_the_run: Any) -> set[str]:
        return {name for name, job in plan_of(team, view=view, **of_the_run).jobs.items() if job.restarts}

    robots = [RobotEntry(id=0), RobotEntry(id=1, restart="no")]
    team = Team(robots, TeamSection(restart="on-failure", map="hall.yaml"))
    assert restarting(team) == {"sim", "map", "tf", "monitor", "view", "robot_0"}
    assert restarting(team, run_for=1.0) == restarting(team, until=10) == restarting(team) - {"sim"}
    assert restarting(Team([RobotEntry(id=0, restart="on-failure"), RobotEntry(id=1)])) == {"view", "robot_0"}


def test_a_run_needs_no_view() -> None:
    """One is started only if it is asked for, imports while the router starts, and may end at any time."""
    plain, viewed = plan_of(), plan_of(view=ViewOptions(browser=False, name="view"))
    assert plain.jobs == {name: job for name, job in viewed.jobs.items() if name != "view"}
    assert (plain.optional, viewed.optional) == (frozenset(), {"view"})
    assert [*viewed.jobs][-1] == "view" and viewed.jobs["view"].may_end
    assert "view" in viewed.unawaited and "view" in order_of(viewed)[0]
    assert not [module for module in PRELOADS if module.startswith("zteam.view")]


def test_a_view_that_is_started_again_is_where_it_was() -> None:
    """With the port and the token of its first page, and without a further page in the user's browser."""
    job = plan_of(view=ViewOptions(host="::1", name="view")).jobs["view"]
    assert job.learn is not None
    assert job.learn(job, Report(listening="tcp/[::1]:8766")) is None
    again = job.learn(job, Report(page=Page(8766, "a b/c")))
    assert again is not None
    _, options = from_line(again.words)
    assert options == ViewOptions(host="::1", port=8766, token="a b/c", browser=False, name="view")
    assert msgspec.structs.replace(again, words=job.words) == job


def test_several_views_have_different_names() -> None:
    """All are of the kind `view`, and no name of another process is."""
    found = {view_name() for _ in range(20)}
    assert len(found) == 20
    assert all(is_view(name) and kind_of(name) is kind_of("view") for name in (*found, "view"))
    assert not any(map(is_view, ("viewer", "robot_0", "sim")))


def test_a_users_behaviour_is_imported_from_beside_the_team_file() -> None:
    """And from the current folder, after that."""
    plan = plan_of(Team(robots=[RobotEntry(id=0, behavior="mine:Spin")], folders=("/t",)))
    assert told(plan, "robot_0", RobotOptions).folders == ("/t", "")


def test_the_simulator_gets_the_same_of_a_command_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Seed, time limit, additions and gaps arrive unchanged, and what a user types makes the same options."""
    options = told(plan_of(run_for=2.5), "sim", SimOptions)
    assert (options.world, options.seed, options.run_for) == (WORLD, 11, 2.5)
    assert options.follows == {3: 0, 7: 3}
    assert options.added == ((7, "erratic", Pose2(-1.5, 3.25, -1e-7)), (8, "my-robot", Pose2(0.0, -0.0, 3.0)))
    words = ["/w/office.world", "--seed", "11", "--for", "2.5", "--gap", "3:0", "--gap", "7:3"]
    args = processes.build_parser("zteam-sim").parse_args(
        [*words, "--add", "7:erratic:-1.5:3.25:-1e-7", "--add", "8:my-robot:0.0:-0.0:3.0"]
    )
    monkeypatch.setattr(processes, "find_world", Path)
    assert processes.read("zteam-sim", args)[1]() == options


def test_robots_get_the_same_of_a_command_line() -> None:
    """Leader, behaviour, parameters and seed arrive unchanged, and are those that a user would type."""
    leader = ["--id", "0", "--behavior", "wander", "--param", "speed=0.4", "--param", "turns=[1,-2]", "--seed", "11"]
    for name, words in {
        "robot_0": [*leader, "--param", "name=a b"],
        "robot_3": ["--id", "3", "--follow", "0", "--seed", "11"],
    }.items():
        args = processes.build_parser("zteam-robot").parse_args(words)
        typed = processes.read("zteam-robot", args)[1]()
        assert typed == msgspec.structs.replace(told(plan_of(), name, RobotOptions), folders=("",))


def test_the_monitor_waits_for_the_robots_of_the_file() -> None:
    """Exactly these ids, so that GO does not come before one of them is ready."""
    options = told(plan_of(), "monitor", MonitorOptions)
    assert (options.team_size, options.ids) == (4, (0, 3, 7, 8))


def test_the_aggregator_gets_the_files_static_transforms() -> None:
    """And the descriptions beside the file; a team without a file has none."""
    entry = StaticTransform("robot_0/base_link", "robot_0/camera", x=0.1)
    robots = [RobotEntry(id=0, description="arm.urdf"), RobotEntry(id=1)]
    options = told(
        plan_of(Team(robots, static_transforms=[entry]), team_file=Path("/t/team.toml")), "tf", AggregatorOptions
    )
    assert options == AggregatorOptions((static_transform(entry),), {0: Path("/t/arm.urdf")})
    assert told(plan_of(), "tf", AggregatorOptions) == AggregatorOptions()


@pytest.mark.parametrize("seed", [0, -3])
def test_a_seed_on_the_command_line_wins(seed: int) -> None:
    """Simulator and robots get the same seed, 0 included."""
    plan = plan_of(given_seed=seed)
    assert told(plan, "sim", SimOptions).seed == seed
    assert {told(plan, name, RobotOptions).seed for name in ROBOTS} == {seed}


@pytest.mark.parametrize("name", ["line", "arena", "willow", "chain"])
def test_shipped_teams_make_a_plan(name: str) -> None:
    """Each process reads what a shipped team file tells it."""
    path = shipped_team(name)
    assert path is not None
    launch = TeamLaunch(load_team(path), WORLD, team_file=path, run_for=1.0)
    plan = plan_team(launch)
    for each, options in options_of(launch).items():
        assert told(plan, each, type(options)) == options


def test_a_new_robot_gets_what_the_team_has_in_common() -> None:
    """A robot that is started on request has the team's seed; one of the team file keeps all but its behaviour."""
    launch = TeamLaunch(Team([RobotEntry(2, follow=1, safety=False)]), None, given_seed=7)
    name, options = from_line(robot_job(launch, 5, "wander").words)
    assert (name, options) == ("robot_5", RobotOptions(5, "wander", {}, seed=7))
    _, options = from_line(robot_job(launch, 2, "avoid").words)
    assert options == RobotOptions(2, "avoid", {}, seed=7, safety=False)


@pytest.mark.parametrize("behavior", ["os:system", "follow", "path"])
def test_what_cannot_be_started_on_request_is_refused(behavior: str) -> None:
    """No module of the asker's choice is imported, and no behaviour starts that lacks a parameter."""
    with pytest.raises(UsageError):
        robot_job(TeamLaunch(TEAM, None), 5, behavior)


def test_a_further_kind_needs_its_row_and_its_options(monkeypatch: pytest.MonkeyPatch) -> None:
    """It starts after the others with its options, stops with its rank, and lock-step waits for it."""
    row = Kind(title="planner", name="planner", command="zteam-monitor", stop_rank=2, in_lockstep=True)
    monkeypatch.setattr(kinds, "KINDS", (*KINDS, row))
    others = planning._told_beside_simulator
    monkeypatch.setattr(planning, others.__name__, lambda launch: {**others(launch), "planner": MonitorOptions(4)})
    plan = plan_of(pace=Pace(lockstep=True))
    assert list(plan.jobs)[-1] == "planner"
    assert told(plan, "planner", MonitorOptions) == MonitorOptions(4)
    assert order_of(plan)[2] == ["sim", "planner"]
    lockstep = told(plan, names.SIMULATOR, SimOptions).lockstep
    assert lockstep is not None and lockstep.expected == ("tf", *ROBOTS, "planner")


KIND_NAMES = {
    "router": "router", "sim": "simulator", "tf": "transforms", "monitor": "monitor", "robot_0": "robots",
    "robot_9999": "robots", "robot_N": None, "robot_01": None, "zteam-robot #3": None, "up": None,
}  # fmt: skip


@pytest.mark.parametrize(("name", "title"), KIND_NAMES.items())
def test_a_kind_is_found_by_its_processes_names(name: str, title: str | None) -> None:
    """Single processes by their name, robots by the pattern of theirs, a user's own process not at all."""
    kind = kind_of(name)
    assert (kind and kind.title) == title


def test_every_command_of_the_table_is_a_command() -> None:
    """Each row's command is installed under that name. A run with an end needs its router and its simulator."""
    installed = {entry.name for entry in entry_points(group="console_scripts") if entry.value.startswith(main.__name__)}
    assert {kind.command for kind in KINDS} == installed - {"zteam"}
    assert [kind.name for kind in KINDS if kind.required_to_finish] == ["router", "sim"]
