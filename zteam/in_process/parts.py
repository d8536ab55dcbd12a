"""What each process of a team does, as a part for one node in this process: one function per kind of process.

The same structs of options as from the command line, made of the team without the detour over arguments.
"""

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

from zteam import names
from zteam.behaviors.registry import find_behavior, load_behavior, look_in
from zteam.in_process.member import Part
from zteam.launch.arguments import Pace, TeamLaunch, module_folders, navigated_robots, team_map
from zteam.nodes.map_server.node import run_map_server
from zteam.nodes.monitor.display import Lines, MonitorOptions
from zteam.nodes.monitor.node import run_monitor
from zteam.nodes.navigation.node import NavigatedRobot, NavigationOptions, run_navigation
from zteam.nodes.robot.node import RobotOptions, run_robot
from zteam.nodes.simulator.lockstep import LockStepOptions
from zteam.nodes.simulator.node import SimOptions, run_simulator
from zteam.nodes.transforms.node import run_aggregator
from zteam.planning.map_files import read_map
from zteam.planning.parameters import navigation_of_robot
from zteam.runtime.node import Node
from zteam.runtime.step_node import StepNode
from zteam.team_file import RobotEntry, behavior_of, navigation_of, static_transform
from zteam.tf.urdf import read_description
from zteam.world import Robot, World, add_robot, load_world

Say = Callable[[str], None]
"""Prints a line of a node."""


def _speed(pace: Pace) -> float | None:
    text = pace.speed or ("max" if pace.lockstep else "1")
    return None if text == "max" else float(text)


def _robots(launch: TeamLaunch, world: World) -> dict[int, Robot]:
    robots = dict(enumerate(world.robots)) if launch.team.team.world_robots else {}
    for entry in launch.team.robots:
        if entry.pose is not None:
            robots[entry.id] = add_robot(world, entry.model or "erratic", entry.pose, names.robot_name(entry.id))
    return robots


def simulator_part(launch: TeamLaunch) -> Part:
    """The simulator."""
    assert launch.world is not None
    pace = launch.pace
    options = SimOptions(
        world=launch.world,
        seed=launch.seed,
        has_map=launch.team.team.map is None,
        follows={robot.id: robot.follow for robot in launch.team.robots if robot.follow is not None},
        run_for=launch.run_for,
        until=launch.until,
        engine=launch.team.simulation,
        speed=_speed(pace),
        paused=pace.paused,
        lockstep=LockStepOptions(launch.participants, pace.timeout) if pace.lockstep else None,
    )
    world = load_world(launch.world)
    robots = _robots(launch, world)

    return Part(lambda node: run_simulator(node, world, robots, options))


def map_parts(launch: TeamLaunch) -> dict[str, Part]:
    """The map server, if the team file names a map."""
    found = team_map(launch)
    if found is None:
        return {}
    grid = read_map(found)
    return {names.MAP_SERVER: Part(lambda node: run_map_server(node, grid, found.name))}


def aggregator_part(launch: TeamLaunch) -> Part:
    """The aggregator."""
    team, folder = launch.team, launch.team_file.parent if launch.team_file else Path()
    configured = [static_transform(entry) for entry in team.static_transforms]
    descriptions = {r.id: read_description(folder / r.description) for r in team.robots if r.description}
    return Part(lambda node: run_aggregator(node, configured, descriptions, None))


def monitor_part(launch: TeamLaunch, say: Say) -> Part:
    """The monitor, which gives GO when all robots are ready."""
    ids = tuple(robot.id for robot in launch.team.robots)
    options = MonitorOptions(len(ids), ids)
    return Part(lambda node: run_monitor(node, options, lambda _: nullcontext(Lines(say))))


def robot_part(launch: TeamLaunch, entry: RobotEntry) -> Part:
    """One robot."""
    spec, params = behavior_of(entry)
    options = RobotOptions(entry.id, spec, params, seed=launch.seed, base=entry.base, safety=entry.safety)

    def body(node: Node) -> None:
        if ":" in spec:
            look_in([*module_folders(launch), ""])
        load_behavior(spec, params, entry.id)
        run_robot(node, find_behavior(spec), options)

    return Part(body)


def navigation_parts(launch: TeamLaunch) -> dict[str, Part]:
    """The navigation of all robots that have one, as one node."""
    ids = navigated_robots(launch)
    if not ids:
        return {}
    folder = launch.team_file.parent if launch.team_file else Path()
    robots = {}
    for entry in launch.team.robots:
        table = navigation_of(entry)
        if table is not None:
            read = navigation_of_robot(table, entry.id, folder, f"robot {entry.id}, navigation")
            robots[entry.id] = NavigatedRobot(read.parameters, entry.base)
    options = NavigationOptions({i: robots[i] for i in ids}, launch.seed)
    return {names.navigation_name(ids[0]): Part(lambda node: run_navigation(node, options), StepNode)}


def parts_of(launch: TeamLaunch, say: Callable[[str, str], None]) -> dict[str, Part]:
    """The parts of a simulated team, by the names of the nodes; `say(name, line)` prints a line of a node."""
    return {
        names.SIMULATOR: simulator_part(launch),
        **map_parts(launch),
        names.AGGREGATOR: aggregator_part(launch),
        names.MONITOR: monitor_part(launch, lambda line: say(names.MONITOR, line)),
        **navigation_parts(launch),
        **{names.robot_name(entry.id): robot_part(launch, entry) for entry in launch.team.robots},
    }
