"""The parameters of one robot's navigation: those of Nav2's nodes and of amcl, with their names and defaults.

A package offers a planner or a controller in the entry-point group `zteam.planners` or `zteam.controllers`: what it
names is called with the plug-in's parameters, a mapping, and returns a Planner or a Controller.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, get_args, get_type_hints

import msgspec

from zteam import names
from zteam.config.entry_points import load_offered, offered
from zteam.config.numbers import Count, Positive
from zteam.config.problems import Problem, problems_of
from zteam.config.resources import read_yaml
from zteam.errors import UsageError
from zteam.messages.base import DEFAULT_BASE, Base
from zteam.navigation.planning.amcl import AmclOptions
from zteam.navigation.planning.controller import (
    Controller,
    GoalOptions,
    ProgressOptions,
    PursuitOptions,
    RegulatedPurePursuit,
)
from zteam.navigation.planning.costmap import CostmapOptions, Footprint, make_circle, make_footprint
from zteam.navigation.planning.planner import AStarOptions, AStarPlanner, Planner
from zteam.navigation.planning.recovery import RecoveryOptions

Localizer = Literal["amcl", "fake", "none"]
Tables = dict[str, dict[str, Any]]
"""Parameters by the name of Nav2's node; the names of nested tables are joined with dots, as in `FollowPath.plugin`."""

OWN = "navigation"
"""The node with parameters of zteam's own."""
_PARAMETERS = "ros__parameters"
MAX_BYTES = 2**20


class Plugin(NamedTuple):
    """A planner or a controller of a robot."""

    name: str
    """zteam's own, or that of an installed package's."""
    parameters: Mapping[str, Any] = MappingProxyType({})
    """What is set of it, by the plug-in's own names."""


ASTAR, PURSUIT = "astar", "regulated_pure_pursuit"


class FirstPose(msgspec.Struct, frozen=True):
    """Where a robot is at first, in amcl's own parameters."""

    set_initial_pose: bool = False
    """Without it, a robot begins where the transforms say that it is."""
    x: float = msgspec.field(default=0.0, name="initial_pose.x")
    y: float = msgspec.field(default=0.0, name="initial_pose.y")
    yaw: float = msgspec.field(default=0.0, name="initial_pose.yaw")


class FakeOptions(msgspec.Struct, frozen=True):
    """Parameters of the localiser that takes the simulator's word (fake_localization), and errors of one's choice."""

    delta_x: float = 0.0
    delta_y: float = 0.0
    delta_yaw: float = 0.0
    """Metres and radians that are added to each pose."""
    noise_xy: float = 0.0
    noise_yaw: float = 0.0
    """Standard deviations of each pose's errors in x and in y (m), and in yaw (rad)."""


class ControllerOptions(msgspec.Struct, frozen=True):
    """Parameters of controller_server itself."""

    controller_frequency: Positive = 20.0
    failure_tolerance: float = 0.3
    """Seconds that the controller may find no command before a recovery begins."""


class PlannerServerOptions(msgspec.Struct, frozen=True):
    """Parameters of planner_server itself."""

    expected_planner_frequency: Positive = 1.0
    """Plans a second while the robot drives."""


class WindowOptions(msgspec.Struct, frozen=True):
    """Parameters of a costmap's node besides its layers. Raises ValueError for an outline that cannot be."""

    update_frequency: Positive = 5.0
    publish_frequency: Positive = 1.0
    """At most 2 Hz."""
    width: Count = 3
    height: Count = 3
    resolution: Positive = 0.05
    """Metres, of the local costmap alone."""
    robot_radius: float | None = None
    """Metres; without it, and without `footprint`, the outline is that of `base_info`."""
    footprint: str = ""
    """As in Nav2: a text such as "[[0.2, 0.2], [0.2, -0.2], [-0.2, 0.0]]"."""
    footprint_padding: float = 0.03
    """Metres; more than Nav2's 0.01. The safety layer keeps 0.025 free: closer to a wall it lets a robot move in no
    direction."""

    def __post_init__(self) -> None:
        self.outline(DEFAULT_BASE)

    def outline(self, base: Base) -> Footprint:
        """The outline that is given, or else that of the base. Raises ValueError."""
        if not self.footprint and self.robot_radius is not None:
            return make_circle(self.robot_radius)
        try:
            corners = json.loads(self.footprint) if self.footprint else base.footprint
            return make_footprint(corners, self.footprint_padding)
        except ValueError:
            example = "[[0.2, 0.2], [0.2, -0.2], [-0.2, 0.0]]"
            raise ValueError(f"footprint {self.footprint!r}: give corners in metres, such as {example}") from None


class _Place(NamedTuple):
    """Where Nav2 has the parameters of some options."""

    node: str
    kind: str = ""
    """Of plug-in, of which the first one that the parameter `<kind>_plugins` lists is meant; empty: the node's own."""
    usual: str = ""
    """The plug-in's name where none is listed."""
    anywhere: bool = False
    """Whether the layer that a name belongs to does not matter, as in `obstacle_layer.scan.obstacle_max_range`."""


class Parameters(NamedTuple):
    """All of them."""

    localizer: Localizer = "amcl"
    amcl: Annotated[AmclOptions, _Place("amcl")] = AmclOptions()
    initial_pose: Annotated[FirstPose, _Place("amcl")] = FirstPose()
    fake: Annotated[FakeOptions, _Place("fake_localization")] = FakeOptions()
    controller: Annotated[ControllerOptions, _Place("controller_server")] = ControllerOptions()
    controller_plugin: Plugin = Plugin(PURSUIT)
    pursuit: Annotated[PursuitOptions, _Place("controller_server", "controller", "FollowPath")] = PursuitOptions()
    goal: Annotated[GoalOptions, _Place("controller_server", "goal_checker", "general_goal_checker")] = GoalOptions()
    progress: Annotated[ProgressOptions, _Place("controller_server", "progress_checker", "progress_checker")] = (
        ProgressOptions()
    )
    planner_server: Annotated[PlannerServerOptions, _Place("planner_server")] = PlannerServerOptions()
    planner_plugin: Plugin = Plugin(ASTAR)
    planner: Annotated[AStarOptions, _Place("planner_server", "planner", "GridBased")] = AStarOptions()
    recovery: Annotated[RecoveryOptions, _Place("behavior_server")] = RecoveryOptions()
    global_window: Annotated[WindowOptions, _Place("global_costmap")] = WindowOptions(update_frequency=1.0)
    global_layers: Annotated[CostmapOptions, _Place("global_costmap", anywhere=True)] = CostmapOptions()
    local_window: Annotated[WindowOptions, _Place("local_costmap")] = WindowOptions()
    local_layers: Annotated[CostmapOptions, _Place("local_costmap", anywhere=True)] = CostmapOptions()

    def make_controller(self, base: Base) -> Controller:
        """The controller that is named; zteam's own keeps within the limits of a base. Raises UsageError."""
        name, given = self.controller_plugin
        if name != PURSUIT:
            return make_controller(name, given)
        options = self.pursuit
        return RegulatedPurePursuit(
            msgspec.structs.replace(
                options,
                desired_linear_vel=min(options.desired_linear_vel, base.max_vel_x),
                rotate_to_heading_angular_vel=min(options.rotate_to_heading_angular_vel, base.max_vel_theta),
                max_angular_accel=min(options.max_angular_accel, base.acc_lim_theta),
                xy_goal_tolerance=self.goal.xy_goal_tolerance,
            )
        )

    def make_planner(self) -> Planner:
        """The planner that is named. Raises UsageError."""
        name, given = self.planner_plugin
        return AStarPlanner(self.planner) if name == ASTAR else make_planner(name, given)


_PLACES: dict[str, _Place] = {
    field: place
    for field, hint in get_type_hints(Parameters, include_extras=True).items()
    for place in getattr(hint, "__metadata__", ())
}
"""By field of Parameters."""
NODES = (OWN, *dict.fromkeys(place.node for place in _PLACES.values()))
"""Names of the nodes whose parameters are taken."""
_LISTS = frozenset(f"{place.kind}_plugins" for place in _PLACES.values())


def navigation_of_robot(
    table: Mapping[str, Any], robot_id: int, folder: Path, source: str
) -> tuple[Parameters, list[str]]:
    """The parameters of robot `robot_id` from the table `navigation` of a team file in `folder`; and the names of those
    that have no effect, `node.name` each, sorted.

    Its key `params` names a parameter file, whose values the table replaces; the other keys are Nav2's nodes, without
    `ros__parameters`. Raises UsageError; `source` is what the table is called there.
    """
    file = table.get("params")
    given: Tables = {}
    if file is not None:
        if not isinstance(file, str):
            raise UsageError(f"{source}: params: a file is expected, not {file!r}")
        given = _tables_of_file(_read_parameter_file(folder / file), robot_id)
        # A mistake in the file is told with the file's name.
        _read_parameters(given, file)
    own: Tables = {OWN: {}}
    for key, value in table.items():
        if isinstance(value, Mapping):
            own[key] = _flatten(value)
        elif key != "params":
            own[OWN][key] = value
    return _read_parameters({node: {**given.get(node, {}), **own.get(node, {})} for node in {**given, **own}}, source)


def _read_parameters(tables: Tables, source: str) -> tuple[Parameters, list[str]]:
    """The parameters in tables of Nav2's nodes. Raises UsageError, with `source` and key, for values of wrong types."""
    found: dict[str, Any] = {}
    taken = {(OWN, "localizer")}
    problems: list[str] = []
    for field, place in _PLACES.items():
        table = tables.get(place.node, {})
        if place.kind in _OWN:
            try:
                plugin, known = _read_plugin(place, table)
            except UsageError as error:
                problems.append(str(error))
                continue
            found[f"{place.kind}_plugin"] = plugin
            taken |= {(place.node, name) for name in known}
            if plugin.name not in (ASTAR, PURSUIT):
                continue
        default = Parameters._field_defaults[field]
        given = _own_names(place, table, type(default))
        taken |= {(place.node, name) for name in given.values()}
        found[field], wrong = set_options(default, {key: table[name] for key, name in given.items()})
        for path, text in wrong:
            key = ".".join([place.node, *(given[str(key)] for key in path[:1])])
            problems.append(f"{key}: {text}")
    localizer = tables.get(OWN, {}).get("localizer", "amcl")
    if localizer not in get_args(Localizer):
        problems.append(f"localizer: {localizer!r} is none of {', '.join(get_args(Localizer))}")
    if problems:
        raise UsageError("\n".join(f"{source}: {problem}" for problem in problems))
    every = {(node, name) for node, table in tables.items() for name in table if name not in _LISTS}
    return Parameters(**found, localizer=localizer), sorted(f"{node}.{name}" for node, name in every - taken)


T = TypeVar("T", bound=msgspec.Struct)


def set_options(options: T, values: Mapping[str, Any]) -> tuple[T, list[Problem]]:
    """Options with other values; or as they were, and what is wrong with the values."""
    table, kind = {**msgspec.to_builtins(options), **values}, type(options)
    problems = problems_of(table, kind) or [
        Problem((name,), f"a finite number is expected, not {value}")
        for name, value in values.items()
        if isinstance(value, float) and not math.isfinite(value)
    ]
    return options if problems else msgspec.convert(table, kind), problems


def read_options(kind: type[T], parameters: Mapping[str, Any]) -> tuple[T, list[str]]:
    """Options of a class such as AmclOptions, and the names that it does not know. Raises UsageError."""
    known = {name: value for name, value in parameters.items() if name in kind.__struct_encode_fields__}
    options, problems = set_options(kind(), known)
    if problems:
        raise UsageError("\n".join(map(str, problems)))
    return options, sorted(parameters.keys() - known.keys())


_OWN: dict[str, tuple[str, Any, type[msgspec.Struct]]] = {
    "planner": (ASTAR, AStarPlanner, AStarOptions),
    "controller": (PURSUIT, RegulatedPurePursuit, PursuitOptions),
}
"""Of each kind of plug-in: zteam's own, its class and its options."""
NAV2_NAMES = {
    "nav2_navfn_planner::NavfnPlanner": ASTAR,
    "nav2_smac_planner::SmacPlanner2D": ASTAR,
    "nav2_theta_star_planner::ThetaStarPlanner": ASTAR,
    "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController": PURSUIT,
}
"""Plug-ins of Nav2, and what does their work here; Nav2 writes them with `/` too."""


def make_planner(name: str, parameters: Mapping[str, Any]) -> Planner:
    """A planner by its name. Raises UsageError."""
    planner: Planner = _make("planner", name, parameters)
    return planner


def make_controller(name: str, parameters: Mapping[str, Any]) -> Controller:
    """A controller by its name. Raises UsageError."""
    controller: Controller = _make("controller", name, parameters)
    return controller


def _make(kind: str, name: str, parameters: Mapping[str, Any]) -> Any:
    own, make, options = _OWN[kind]
    if (found := plugin_name(kind, name)) == own:
        return make(read_options(options, parameters)[0])
    return load_offered(f"zteam.{kind}s", found)(parameters)


def plugin_name(kind: str, name: str, where: str = "") -> str:
    """zteam's own name of a "planner" or "controller", or a package's, which is not imported. Raises UsageError."""
    own, group = _OWN[kind][0], f"zteam.{kind}s"
    if NAV2_NAMES.get(name.replace("/", "::"), name) == own:
        return own
    there = offered(group)
    if name not in there:
        known = f"there are {', '.join(sorted({own, *there}))}, and packages may offer more ({group})"
        raise UsageError(f"{where}there is no {kind} {name!r}: {known}")
    return name


def _own_names(place: _Place, table: Mapping[str, Any], kind: type[msgspec.Struct]) -> dict[str, str]:
    """Fields of the options that the table sets, and the names it has for them."""
    prefix = _prefix(place, table)
    found = {}
    for name in table:
        own = name.rpartition(".")[2] if place.anywhere else name.removeprefix(prefix)
        if own in kind.__struct_encode_fields__ and (place.anywhere or name.startswith(prefix)):
            found[own] = name
    return found


def _read_plugin(place: _Place, table: Mapping[str, Any]) -> tuple[Plugin, Iterable[str]]:
    """The plug-in that is named, and the names that this explains: all of a package's plug-in. Raises UsageError."""
    prefix, kind = _prefix(place, table), place.kind
    own = {name: value for name, value in table.items() if name.startswith(prefix)}
    key = f"{prefix}plugin"
    name = plugin_name(kind, str(own.get(key, _OWN[kind][0])), f"{place.node}.{key}: ")
    given = {name.removeprefix(prefix): value for name, value in own.items() if name != key}
    return Plugin(name, given), [key] if name == _OWN[kind][0] else own


def _prefix(place: _Place, table: Mapping[str, Any]) -> str:
    """What the names of the parameters begin with there."""
    if not place.kind:
        return ""
    listed = table.get(f"{place.kind}_plugins")
    named = listed[0] if isinstance(listed, list) and listed and isinstance(listed[0], str) else place.usual
    return f"{named}."


def _read_parameter_file(path: Path) -> Mapping[str, Any]:
    """The contents of a YAML file of parameters, as ROS 2 has them. Raises UsageError."""
    table = read_yaml(path, "parameter file", MAX_BYTES, UsageError)
    if table is None:
        return {}
    if not isinstance(table, Mapping) or not any(True for _ in _find_nodes(table, ())):
        raise UsageError(f"{path} has no parameters: it needs a node's name and below it {_PARAMETERS}, as Nav2's file")
    return table


def _tables_of_file(contents: Mapping[str, Any], robot_id: int) -> Tables:
    """What a parameter file says to the nodes of robot `robot_id`.

    A node's name may have namespaces before it (`robot_1/amcl`, or nested), and wildcards: `*` for one part, `**` for
    any. What names a node by itself counts before what names it by a wildcard.
    """
    tables: Tables = {}
    for pattern, parameters in sorted(_find_nodes(contents, ()), key=lambda item: "*" not in item[0]):
        for node in NODES:
            # The costmaps are nodes in namespaces of their own.
            full = f"{node}/{node}" if node.endswith("_costmap") else node
            if pattern and PurePosixPath(names.robot_name(robot_id), full).match(pattern):
                tables.setdefault(node, {}).update(_flatten(parameters))
    return tables


def _find_nodes(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The name, or pattern, of each node with parameters, and the parameters."""
    for key, value in table.items():
        if key == _PARAMETERS and isinstance(value, Mapping) and path:
            yield "/".join(part.strip("/") for part in path), value
        elif isinstance(value, Mapping):
            yield from _find_nodes(value, (*path, str(key)))


def _flatten(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested tables as one, with the names joined by dots."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        name = f"{prefix}{key}"
        flat.update(_flatten(value, f"{name}.") if isinstance(value, Mapping) else {name: value})
    return flat
