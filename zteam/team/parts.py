"""What each kind of process does, made of its options: one function a kind, whether it is a process or a thread.

Each reads the files that its options name, so that a mistake is told before a bus is opened. Imports are inside the
functions: a process pays for its own kind alone.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from zteam import names
from zteam.config.numbers import counted
from zteam.errors import UsageError, log
from zteam.node import process_options
from zteam.node.process_node import ClockMode, ProcessNode


class Part(NamedTuple):
    """What a node does."""

    body: Callable[[Any], None]
    """`body(node)` returns when the node is asked to stop."""
    make: type[ProcessNode] = ProcessNode
    clock: ClockMode = "auto"
    small: bool = False
    """As in BusOptions."""
    large: bool = False
    """The same."""
    name: str = ""
    """Its name on the bus, if that is not the one of its log."""


def _simulator(options: process_options.SimOptions) -> Part:
    from zteam.simulator.process.node import run_simulator
    from zteam.simulator.world import add_robot, load_world

    world = load_world(options.world)
    if (options.engine.physics or world.physics) == "dynamic":
        # Not in the thread of a simulator in one process (`run/threads.py`).
        import zteam.simulator.core.dynamic  # noqa: F401
    robots = dict(enumerate(world.robots)) if options.world_robots else {}
    for robot_id, model, pose in options.added:
        if robot_id in robots:
            raise UsageError(f"--add {robot_id}: the world already has a robot {robot_id}")
        robots[robot_id] = add_robot(world, model, pose, names.robot_name(robot_id))
    return Part(lambda node: run_simulator(node, world, robots, options))


def _map_server(options: process_options.MapOptions) -> Part:
    from zteam.navigation.map_server import run_map_server
    from zteam.navigation.planning.maps import read_map
    from zteam.node.node import Node

    grid = read_map(options.file)
    return Part(lambda node: run_map_server(node, grid, str(options.file)), Node)


def _aggregator(options: process_options.AggregatorOptions) -> Part:
    from zteam.node.node import Node
    from zteam.transforms.process.node import run_aggregator
    from zteam.transforms.urdf import read_description

    descriptions = {robot_id: read_description(file) for robot_id, file in options.descriptions.items()}
    return Part(lambda node: run_aggregator(node, options, descriptions), Node, small=True)


def monitor_part(options: process_options.MonitorOptions, say: Callable[[str], None] | None = None) -> Part:
    """A monitor; `say(line)` prints its events where several nodes share a standard output."""
    from zteam.monitor.process.display import Lines
    from zteam.monitor.process.node import run_monitor

    return Part(lambda node: run_monitor(node, options, say and Lines(say)), small=True)


def robot_part(options: process_options.RobotOptions, transforms: Any = None) -> Part:
    """A robot. The robots of one process share `transforms` (`zteam.robot.process.inputs.TransformInputs`)."""
    from zteam.node.node import Node
    from zteam.robot.behaviors.registry import find_behavior, load_behavior, look_in
    from zteam.robot.process.node import run_robot

    if ":" in options.behavior:
        look_in(options.folders)
    load_behavior(options.behavior, options.params, options.robot_id)
    kind = find_behavior(options.behavior)
    return Part(lambda node: run_robot(node, kind, options, transforms), Node, small=True)


def _navigation(options: process_options.NavigationOptions) -> Part:
    from zteam.navigation.planning.parameters import navigation_of_robot
    from zteam.navigation.process.node import NavigationNode
    from zteam.node.node import Node

    parameters, unknown, notes = {}, dict[str, None](), dict[str, None]()
    for i, robot in options.robots.items():
        parameters[i], ignored = navigation_of_robot(robot.parameters, i, robot.folder, robot.source)
        unknown.update(dict.fromkeys(ignored))
        notes.update(dict.fromkeys(parameters[i].notes))
    for note in notes:
        log.warning("%s", note)
    if unknown:
        log.warning("%s without effect: %s", counted(len(unknown), "unknown parameter"), ", ".join(unknown))
    bases = {i: robot.base for i, robot in options.robots.items()}
    return Part(lambda node: NavigationNode(node, parameters, bases, options.seed).run(), Node)


def _view(options: process_options.ViewOptions) -> Part:
    from zteam.view.node import run_view

    if options.foxglove_port is not None:
        from zteam.view.foxglove import require_sdk

        require_sdk()
    say, name = partial(print, flush=True), options.name or names.view_name()
    return Part(lambda node: run_view(node, options, say), small=True, name=name)


def _own_node(options: process_options.NodeOptions) -> Part:
    from zteam.node.node import Node, stepping
    from zteam.robot.behaviors.registry import look_in
    from zteam.team.launch.own_behaviors import find_body

    look_in(options.folders)
    return Part(stepping(find_body(options.name, options.body)), Node)


def _recorder(options: process_options.RecorderOptions) -> Part:
    from zteam.node.node import Node
    from zteam.record.process import run_recorder
    from zteam.team.launch.recorded import contents_of

    contents = contents_of(options)
    return Part(lambda node: run_recorder(node, options, contents), Node)


def _replay(options: process_options.ReplayOptions) -> Part:
    from zteam.record.recording import Recording
    from zteam.record.replaying import run_replay
    from zteam.record.timeline import Timeline
    from zteam.team.launch.recorded import world_of

    recording = Recording(options.file)
    timeline = Timeline(recording)
    return Part(lambda node: run_replay(node, timeline, options, world_of(recording.contents)), large=True)


_MAKERS: dict[type, Callable[[Any], Part]] = {
    process_options.SimOptions: _simulator,
    process_options.MapOptions: _map_server,
    process_options.AggregatorOptions: _aggregator,
    process_options.MonitorOptions: monitor_part,
    process_options.RobotOptions: robot_part,
    process_options.NavigationOptions: _navigation,
    process_options.ViewOptions: _view,
    process_options.NodeOptions: _own_node,
    process_options.RecorderOptions: _recorder,
    process_options.ReplayOptions: _replay,
}


def part_of(options: process_options.ProcessOptions) -> Part:
    """What a process with these options does. Raises ZteamError, and what the code of a user's behaviour raises."""
    return _MAKERS[type(options)](options)
