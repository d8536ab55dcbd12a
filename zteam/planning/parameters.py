"""The parameters of one robot's navigation: those of Nav2's nodes and of amcl, with their names and defaults."""

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args, get_type_hints

import msgspec

from zteam.errors import UsageError
from zteam.planning.amcl import AmclOptions, check_options
from zteam.planning.controller import GoalOptions, ProgressOptions, PursuitOptions
from zteam.planning.costmap import CostmapOptions, Footprint, make_circle, make_footprint
from zteam.planning.parameter_tables import OWN, Tables, read_parameter_file, tables_of_file, tables_of_team
from zteam.planning.planner import AStarOptions
from zteam.planning.plugins import ASTAR, PURSUIT, Plugin, plugin_name
from zteam.planning.recovery import Recovery, RecoveryOptions
from zteam.problems import problems_of

Localizer = Literal["amcl", "fake", "none"]


class InitialPose(NamedTuple):
    """Where a robot is at first, in amcl's own parameters."""

    set_initial_pose: bool = False
    """Without it, a robot begins where the transforms say that it is."""
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0


class FakeOptions(NamedTuple):
    """Parameters of the localiser that takes the simulator's word (fake_localization), and errors of one's choice."""

    delta_x: float = 0.0
    """Metres that are added to each pose; so is the next."""
    delta_y: float = 0.0
    delta_yaw: float = 0.0
    """Radians."""
    noise_xy: float = 0.0
    """Standard deviation of each pose's error in x and in y, metres."""
    noise_yaw: float = 0.0
    """Radians."""


class ControllerOptions(NamedTuple):
    """Parameters of controller_server itself."""

    controller_frequency: float = 20.0
    failure_tolerance: float = 0.3
    """Seconds that the controller may find no command before a recovery begins."""


class PlannerServerOptions(NamedTuple):
    """Parameters of planner_server itself."""

    expected_planner_frequency: float = 1.0
    """Plans a second while the robot drives."""


class WindowOptions(NamedTuple):
    """Parameters of a costmap's node besides its layers."""

    update_frequency: float = 5.0
    publish_frequency: float = 1.0
    """At most 2 Hz."""
    width: int = 3
    """Metres; so is the next. The local costmap's alone."""
    height: int = 3
    resolution: float = 0.05
    robot_radius: float = math.nan
    """Metres; without it, and without `footprint`, the outline is that of `base_info`."""
    footprint: str = ""
    """As in Nav2: a text such as "[[0.2, 0.2], [0.2, -0.2], [-0.2, 0.0]]"."""
    footprint_padding: float = 0.03
    """Metres; more than Nav2's 0.01. The safety layer keeps 0.025 free: closer to a wall it lets a robot move in no
    direction."""


class Parameters(NamedTuple):
    """All of them."""

    localizer: Localizer = "amcl"
    amcl: AmclOptions = AmclOptions()
    initial_pose: InitialPose = InitialPose()
    fake: FakeOptions = FakeOptions()
    controller: ControllerOptions = ControllerOptions()
    controller_plugin: Plugin = Plugin(PURSUIT)
    pursuit: PursuitOptions = PursuitOptions()
    goal: GoalOptions = GoalOptions()
    progress: ProgressOptions = ProgressOptions()
    planner_server: PlannerServerOptions = PlannerServerOptions()
    planner_plugin: Plugin = Plugin(ASTAR)
    planner: AStarOptions = AStarOptions()
    recovery: RecoveryOptions = RecoveryOptions()
    global_window: WindowOptions = WindowOptions(update_frequency=1.0)
    global_layers: CostmapOptions = CostmapOptions()
    local_window: WindowOptions = WindowOptions()
    local_layers: CostmapOptions = CostmapOptions()


class _Section(NamedTuple):
    """Where Nav2 has the parameters of some options."""

    field: str
    """Of Parameters."""
    node: str
    plugins: str = ""
    """Parameter that lists the names of plugins, the first of which is meant; empty: the node's own parameters."""
    usual: str = ""
    """The plugin's name where none is listed."""
    anywhere: bool = False
    """Whether the layer that a name belongs to does not matter, as in `obstacle_layer.scan.obstacle_max_range`."""


_SECTIONS = (
    _Section("amcl", "amcl"),
    _Section("initial_pose", "amcl"),
    _Section("fake", "fake_localization"),
    _Section("controller", "controller_server"),
    _Section("pursuit", "controller_server", "controller_plugins", "FollowPath"),
    _Section("goal", "controller_server", "goal_checker_plugins", "general_goal_checker"),
    _Section("progress", "controller_server", "progress_checker_plugins", "progress_checker"),
    _Section("planner_server", "planner_server"),
    _Section("planner", "planner_server", "planner_plugins", "GridBased"),
    _Section("recovery", "behavior_server"),
    _Section("global_window", "global_costmap"),
    _Section("global_layers", "global_costmap", anywhere=True),
    _Section("local_window", "local_costmap"),
    _Section("local_layers", "local_costmap", anywhere=True),
)
_PLUGINS = {"pursuit": "controller", "planner": "planner"}
"""Sections of plug-ins that packages may offer too, and their kinds."""
NODES = (OWN, *dict.fromkeys(section.node for section in _SECTIONS))
"""Names of the nodes whose parameters are taken."""
_RENAMED = {"initial_pose.x": "x", "initial_pose.y": "y", "initial_pose.yaw": "yaw"}
_ABOVE_ZERO = frozenset(
    {
        "controller_frequency",
        "expected_planner_frequency",
        "update_frequency",
        "publish_frequency",
        "width",
        "height",
        "resolution",
        "desired_linear_vel",
        "rotate_to_heading_angular_vel",
        "max_angular_accel",
        "lookahead_dist",
    }
)
_LISTS = frozenset(section.plugins for section in _SECTIONS if section.plugins)


class Reading(NamedTuple):
    """Parameters, and what was not understood."""

    parameters: Parameters
    unknown: tuple[str, ...]
    """Names that have no effect, `node.name` each, sorted."""


def read_parameters(tables: Tables, source: str) -> Reading:
    """The parameters in tables of Nav2's nodes. Raises UsageError, with `source` and key, for values of wrong types."""
    found: dict[str, Any] = {}
    taken: set[tuple[str, str]] = set()
    problems: list[str] = []
    for section in _SECTIONS:
        table = tables.get(section.node, {})
        default = Parameters._field_defaults[section.field]
        if kind := _PLUGINS.get(section.field):
            try:
                plugin, known = _read_plugin(kind, section, table)
            except UsageError as error:
                problems.append(str(error))
                continue
            found[f"{kind}_plugin"] = plugin
            taken |= {(section.node, name) for name in known}
            if plugin.name not in (ASTAR, PURSUIT):
                continue
        given = _own_names(section, table, type(default))
        taken |= {(section.node, name) for name in given.values()}
        values = {key: table[name] for key, name in given.items()}
        for problem in problems_of(values, _checked_type(type(default))):
            field = str(problem.path[0]) if problem.path else ""
            problems.append(f"{section.node}.{given.get(field, field)}: {problem.text}")
        if not problems:
            found[section.field] = default._replace(**_converted(type(default), values))
    localizer = tables.get(OWN, {}).get("localizer", "amcl")
    if localizer not in get_args(Localizer):
        problems.append(f"localizer: {localizer!r} is none of {', '.join(get_args(Localizer))}")
    if problems:
        raise UsageError("\n".join(f"{source}: {problem}" for problem in problems))
    taken.add((OWN, "localizer"))
    every = [(node, name) for node, table in tables.items() for name in table if name not in _LISTS]
    unknown = sorted(f"{node}.{name}" for node, name in every if (node, name) not in taken)
    parameters = Parameters(**found, localizer=localizer)
    try:
        _check(parameters)
    except ValueError as error:
        raise UsageError(f"{source}: {error}") from None
    return Reading(parameters, tuple(unknown))


def read_outline(window: WindowOptions) -> Footprint | None:
    """The outline that the parameters of a costmap give, if they do. Raises ValueError."""
    if window.footprint:
        try:
            corners = json.loads(window.footprint)
        except ValueError:
            raise ValueError("give corners in metres, such as [[0.2, 0.2], [0.2, -0.2], [-0.2, 0.0]]") from None
        return make_footprint(corners, window.footprint_padding)
    return None if math.isnan(window.robot_radius) else make_circle(window.robot_radius)


def _check(parameters: Parameters) -> None:
    """Raise ValueError for numbers that cannot be."""
    for section in _SECTIONS:
        for name, value in getattr(parameters, section.field)._asdict().items():
            place = f"{section.node}.{name}"
            if isinstance(value, float) and not math.isfinite(value) and name != "robot_radius":
                raise ValueError(f"{place}: a finite number is expected")
            if name in _ABOVE_ZERO and not value > 0:
                raise ValueError(f"{place}: a number above 0 is expected, not {value}")
    check_options(parameters.amcl)
    for node, window in ("global_costmap", parameters.global_window), ("local_costmap", parameters.local_window):
        try:
            read_outline(window)
        except ValueError as error:
            raise ValueError(f"{node}: footprint {window.footprint!r}: {error}") from None
    Recovery(parameters.recovery)


def _own_names(section: _Section, table: Mapping[str, Any], kind: type[Any]) -> dict[str, str]:
    """Fields of the options that the table sets, and the names it has for them."""
    prefix = _prefix(section, table)
    found = {}
    for name in table:
        if not section.anywhere and not name.startswith(prefix):
            continue
        own = name.rpartition(".")[2] if section.anywhere else name.removeprefix(prefix)
        own = _RENAMED.get(own, own) if kind is InitialPose else own
        if own in kind._fields and (kind is not InitialPose or own == "set_initial_pose" or name in _RENAMED):
            found[own] = name
    return found


def _read_plugin(kind: str, section: _Section, table: Mapping[str, Any]) -> tuple[Plugin, Iterable[str]]:
    """The plug-in that is named, and the names that this explains: all of a package's plug-in. Raises UsageError."""
    prefix = _prefix(section, table)
    own = {name: value for name, value in table.items() if name.startswith(prefix)}
    usual: Plugin = Parameters._field_defaults[f"{kind}_plugin"]
    place = f"{prefix}plugin"
    name = plugin_name(kind, str(own.get(place, usual.name)), f"{section.node}.{place}: ")
    given = {name.removeprefix(prefix): value for name, value in own.items() if name != place}
    return Plugin(name, given), [place] if name == usual.name else own


def _prefix(section: _Section, table: Mapping[str, Any]) -> str:
    """What the names of the section's parameters begin with."""
    if not section.plugins:
        return ""
    listed = table.get(section.plugins)
    named = listed[0] if isinstance(listed, list) and listed and isinstance(listed[0], str) else section.usual
    return f"{named}."


def _checked_type(kind: type[Any]) -> type[msgspec.Struct]:
    """A struct with the fields of some options, for `problems_of`."""
    hints = get_type_hints(kind)
    fields = [(name, hints[name], default) for name, default in kind._field_defaults.items()]
    return msgspec.defstruct(kind.__name__, fields)


def _converted(kind: type[Any], values: Mapping[str, Any]) -> dict[str, Any]:
    checked = msgspec.convert(values, _checked_type(kind))
    return {name: getattr(checked, name) for name in values}


def navigation_of_robot(table: Mapping[str, Any], robot_id: int, folder: Path, source: str) -> Reading:
    """The parameters of robot `robot_id` from the table `navigation` of a team file in `folder`.

    Its key `params` names a parameter file, whose values the table replaces. Raises UsageError; `source` is what the
    table is called there.
    """
    file = table.get("params")
    if file is None:
        given: Tables = {}
    elif not isinstance(file, str):
        raise UsageError(f"{source}: params: a file is expected, not {file!r}")
    else:
        given = tables_of_file(read_parameter_file(folder / file), robot_id, NODES)
        # A mistake in the file is told with the file's name.
        read_parameters(given, file)
    own = tables_of_team({key: value for key, value in table.items() if key != "params"})
    return read_parameters({node: {**given.get(node, {}), **own.get(node, {})} for node in {**given, **own}}, source)
