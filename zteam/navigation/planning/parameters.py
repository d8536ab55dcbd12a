"""The parameters of one robot's navigation: those of Nav2's nodes and of amcl, with their names and defaults.

A package offers a planner or a controller in the entry-point group `zteam.planners` or `zteam.controllers`: what it
names is called with the plug-in's parameters, a mapping, and returns a Planner or a Controller.
"""

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, cast, get_args, get_type_hints

import msgspec

from zteam import names
from zteam.config.entry_points import load_offered, offered
from zteam.config.foreign_files import YAML_FILE, name_foreign
from zteam.config.numbers import Coordinate, NotNegative, Positive, Signed
from zteam.config.problems import CheckedOptions, KeyValueError, Problem, plain, problems_of
from zteam.config.resources import read_yaml
from zteam.errors import UsageError
from zteam.kernels.navigation import MAX_CELLS
from zteam.messages.base import DEFAULT_BASE, MAX_EXTENT, Base, BaseOverride
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

_Node = tuple[str, Mapping[str, Any]]
"""The name of a node of a parameter file, or a pattern of names, and its parameters."""
OWN = "navigation"
"""The node with parameters of zteam's own."""
_PARAMETERS = "ros__parameters"
_SHIMMED = "primary_controller."
MAX_BYTES = 2**20


class Plugin(NamedTuple):
    """A planner or a controller of a robot."""

    name: str
    """zteam's own, or that of an installed package's."""
    parameters: Mapping[str, Any] = MappingProxyType({})
    """What is set of it, by the plug-in's own names."""


ASTAR, PURSUIT = "astar", "regulated_pure_pursuit"


class FirstPose(CheckedOptions, frozen=True):
    """Where a robot is at first, in amcl's own parameters."""

    set_initial_pose: bool = False
    """Without it, a robot begins where the transforms say that it is."""
    x: Coordinate = msgspec.field(default=0.0, name="initial_pose.x")
    y: Coordinate = msgspec.field(default=0.0, name="initial_pose.y")
    yaw: Signed = msgspec.field(default=0.0, name="initial_pose.yaw")


class FakeOptions(CheckedOptions, frozen=True):
    """Parameters of the localiser that takes the simulator's word (fake_localization), and errors of one's choice."""

    delta_x: Coordinate = 0.0
    delta_y: Coordinate = 0.0
    delta_yaw: Signed = 0.0
    """Metres and radians that are added to each pose."""
    noise_xy: NotNegative = 0.0
    noise_yaw: NotNegative = 0.0
    """Standard deviations of each pose's errors in x and in y (m), and in yaw (rad)."""


_Names = tuple[Annotated[str, msgspec.Meta(min_length=1)], ...]


class ControllerOptions(CheckedOptions, frozen=True):
    """Parameters of controller_server itself."""

    controller_plugins: _Names = ()
    progress_checker_plugins: _Names = ()
    goal_checker_plugins: _Names = ()
    controller_plugin: str = "FollowPath"
    progress_checker_plugin: str = "progress_checker"
    goal_checker_plugin: str = "general_goal_checker"
    """Where no list is given; until Humble, files had names of checkers in the place of lists."""
    controller_frequency: Positive = 20.0
    failure_tolerance: Signed = 0.3
    """Seconds that the controller may find no command before a recovery begins; below 0: without end."""


_SPEEDS = {
    "max_vel_x": ("max_vel_x", "max_speed_xy", "vx_max", "v_linear_max", "max_linear_vel"),
    "max_vel_theta": ("max_vel_theta", "wz_max", "v_angular_max", "max_angular_vel"),
    "acc_lim_x": ("acc_lim_x", "ax_max"),
    "acc_lim_theta": ("acc_lim_theta", "az_max"),
}
"""By limit of a Base: what DWB, MPPI, graceful and regulated pure pursuit controllers call it."""
_UNLIMITED = 1000.0
"""The largest limit that can be given."""
_BACKWARDS = "min_vel_x", "vx_min"
"""Only what is below 0 of these limits a robot: with 0, its controller does not reverse, but its recoveries do."""
_NAMES = [(name, Positive, _UNLIMITED) for row in _SPEEDS.values() for name in row]
_NAMES += [(name, Signed, 0.0) for name in _BACKWARDS]
SpeedOptions = msgspec.defstruct("SpeedOptions", _NAMES, bases=(CheckedOptions,), frozen=True)


_Vector = tuple[Positive, Signed, Positive]
_Backwards = Annotated[float, msgspec.Meta(ge=-_UNLIMITED, le=0.0)]
_Clockwise = Annotated[float, msgspec.Meta(ge=-_UNLIMITED, le=-1e-3)]


class SmootherOptions(CheckedOptions, frozen=True):
    """Limits of Nav2's velocity_smoother: along x and y, and about z."""

    max_velocity: _Vector = (_UNLIMITED, 0.0, _UNLIMITED)
    min_velocity: tuple[_Backwards, Signed, _Clockwise] = (-_UNLIMITED, 0.0, -_UNLIMITED)
    max_accel: _Vector = (_UNLIMITED, 0.0, _UNLIMITED)


class PlannerServerOptions(CheckedOptions, frozen=True):
    """Parameters of planner_server itself."""

    planner_plugins: _Names = ()
    planner_plugin: str = "GridBased"
    expected_planner_frequency: NotNegative = 1.0
    """Plans a second while the robot drives, one at most by a parameter file; 0, which expects none in Nav2, is 1."""


_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_Size = Annotated[int, msgspec.Meta(ge=1, le=10_000)]


class WindowOptions(CheckedOptions, frozen=True):
    """Parameters of a costmap's node besides its layers. Raises ValueError for an outline that cannot be."""

    update_frequency: Positive = 5.0
    publish_frequency: NotNegative = 1.0
    """At most 2 Hz; 0: once for each subscriber."""
    width: _Size = 3
    height: _Size = 3
    resolution: Annotated[float, msgspec.Meta(ge=1e-3, le=10.0)] = 0.05
    """Metres, of the local costmap alone."""
    robot_radius: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_EXTENT)] | None = None
    """Metres; with neither it nor `footprint`, the outline is that of `base_info`."""
    footprint: Any = ""
    """As in Nav2: a text such as "[[0.2, 0.2], [0.2, -0.2], [-0.2, 0.0]]"; "[]" is none. `outline` reads it."""
    footprint_padding: NotNegative = 0.03
    """Metres; more than Nav2's 0.01: the safety layer lets no robot move that is closer than 0.025 to a wall."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.outline(DEFAULT_BASE)

    def outline(self, base: Base) -> Footprint:
        """The outline that is given, or else that of the base. Raises ValueError."""
        try:
            # JSON has no `.21`, `1.` and `+0.2`.
            corners = json.loads(_NUMBER.sub(lambda found: repr(float(found[0])), self.footprint or "[]"))
        except (TypeError, ValueError, RecursionError):
            corners = ""
        if corners == [] and self.robot_radius:
            return make_circle(self.robot_radius, self.footprint_padding)
        if corners != [] and problems_of({"footprint": corners}, BaseOverride):
            example = """in quotes, such as "[[0.2, 0.2], [0.2, -0.2], [-0.2, 0.0]]\""""
            raise KeyValueError("footprint", f"{self.footprint!r:.60}: give corners in metres, {example}")
        return make_footprint(corners or base.footprint, self.footprint_padding)


class _Place(NamedTuple):
    """Where Nav2 has the parameters of some options."""

    node: str
    kind: str = ""
    """Of plug-in, of which the first one that the parameter `<kind>_plugins` lists is meant, or else that of
    `<kind>_plugin`; empty: the node's own."""
    anywhere: bool = False
    """Whether the layer that a name belongs to does not matter, as in `obstacle_layer.scan.obstacle_max_range`."""


class Parameters(NamedTuple):
    localizer: Localizer = "amcl"
    amcl: Annotated[AmclOptions, _Place("amcl")] = AmclOptions()
    initial_pose: Annotated[FirstPose, _Place("amcl")] = FirstPose()
    fake: Annotated[FakeOptions, _Place("fake_localization")] = FakeOptions()
    controller: Annotated[ControllerOptions, _Place("controller_server")] = ControllerOptions()
    controller_plugin: Plugin = Plugin(PURSUIT)
    speed: Annotated[msgspec.Struct, _Place("controller_server", "controller")] = SpeedOptions()
    pursuit: Annotated[PursuitOptions, _Place("controller_server", "controller")] = PursuitOptions()
    smoother: Annotated[SmootherOptions, _Place("velocity_smoother")] = SmootherOptions()
    goal: Annotated[GoalOptions, _Place("controller_server", "goal_checker")] = GoalOptions()
    progress: Annotated[ProgressOptions, _Place("controller_server", "progress_checker")] = ProgressOptions()
    planner_server: Annotated[PlannerServerOptions, _Place("planner_server")] = PlannerServerOptions()
    planner_plugin: Plugin = Plugin(ASTAR)
    planner: Annotated[AStarOptions, _Place("planner_server", "planner")] = AStarOptions()
    recovery: Annotated[RecoveryOptions, _Place("behavior_server")] = RecoveryOptions()
    global_window: Annotated[WindowOptions, _Place("global_costmap")] = WindowOptions(update_frequency=1.0)
    global_layers: Annotated[CostmapOptions, _Place("global_costmap", anywhere=True)] = CostmapOptions()
    local_window: Annotated[WindowOptions, _Place("local_costmap")] = WindowOptions()
    local_layers: Annotated[CostmapOptions, _Place("local_costmap", anywhere=True)] = CostmapOptions()
    notes: tuple[str, ...] = ()
    """What a user should know of them, such as a plug-in of Nav2's that zteam's own replaces."""

    @property
    def limits(self) -> Base:
        """A base whose limits all commands keep within."""
        (x, _, turn), (gain, _, turn_gain) = self.smoother.max_velocity, self.smoother.max_accel
        back, _, clockwise = self.smoother.min_velocity
        found = {"max_vel_x": x, "max_vel_theta": min(turn, -clockwise), "acc_lim_x": gain, "acc_lim_theta": turn_gain}
        least = {key: min(found[key], *(getattr(self.speed, name) for name in row)) for key, row in _SPEEDS.items()}
        lower = (getattr(self.speed, name) for name in _BACKWARDS)
        return Base(min_vel_x=max(back, -least["max_vel_x"], *(speed for speed in lower if speed < 0.0)), **least)

    def make_controller(self, base: Base) -> Controller:
        """The controller that is named; zteam's own keeps within the limits of a base. Raises UsageError."""
        if self.controller_plugin.name != PURSUIT:
            return make_controller(*self.controller_plugin)
        own, limits = self.pursuit, self.limits
        turn = min(own.rotate_to_heading_angular_vel, base.max_vel_theta, limits.max_vel_theta)
        options = msgspec.structs.replace(
            own,
            desired_linear_vel=min(own.desired_linear_vel, base.max_vel_x, limits.max_vel_x),
            rotate_to_heading_angular_vel=turn,
            max_angular_accel=min(own.max_angular_accel, base.acc_lim_theta, limits.acc_lim_theta),
            xy_goal_tolerance=self.goal.xy_goal_tolerance,
        )
        return RegulatedPurePursuit(options)

    def make_planner(self) -> Planner:
        """The planner that is named. Raises UsageError."""
        is_own = self.planner_plugin.name == ASTAR
        return AStarPlanner(self.planner) if is_own else make_planner(*self.planner_plugin)


_PLACES: dict[str, _Place] = {
    field: place
    for field, hint in get_type_hints(Parameters, include_extras=True).items()
    for place in getattr(hint, "__metadata__", ())
}
"""By field of Parameters."""
NODES = (OWN, *dict.fromkeys(place.node for place in _PLACES.values()))
"""Names of the nodes whose parameters are taken."""


def navigation_of_robot(
    table: Mapping[str, Any], robot_id: int, folder: Path, source: str, cell: float = math.inf
) -> tuple[Parameters, list[str]]:
    """The parameters of robot `robot_id` from the table `navigation` of a team file in `folder`; and the names of those
    that have no effect, sorted: `node.name`, or `name` if several nodes have it.

    Its key `params` names a parameter file, whose values the table replaces; the other keys are Nav2's nodes, without
    `ros__parameters`. Raises UsageError; `source` is what the table is called there. `cell`: metres a cell of the map.
    """
    file, notes = table.get("params"), []
    given: Tables = {}
    if file is not None:
        if not isinstance(file, str):
            raise UsageError(f"{source}: params: a file is expected, not {file!r}")
        nodes = _read_parameter_file(folder / file)
        given = _tables_of_file(nodes, robot_id)
        if not given:
            there = ", ".join(dict.fromkeys(name for name, _ in nodes)) or "none"
            notes.append(f"{file}: nothing in it applies to {names.robot_name(robot_id)}: its nodes are {there:.200}")
        server = given.get("planner_server", {})
        if isinstance(hertz := server.get("expected_planner_frequency"), int | float) and hertz > 1.0:
            # In Nav2 only a slower planner is warned of: its default tree asks for a path once a second.
            server["expected_planner_frequency"] = 1.0
    own: Tables = {OWN: {}}
    for key, value in table.items():
        if isinstance(value, Mapping):
            own[key] = _flatten(value)
        elif key != "params":
            own[OWN][key] = value
    tables = {node: {**given.get(node, {}), **own.get(node, {})} for node in {**given, **own}}

    def place(node: str, name: str) -> str:
        """Where a key stands; one that is made of several: in the table, if that sets any of the node's."""
        there = own.get(node, {})
        key = name if node == OWN else f"{node}.{name}".rstrip(".")
        return f"{source if name in there or (name not in tables.get(node, {}) and there) else file or source}: {key}"

    return _read_parameters(tables, place, notes, cell)


def _read_parameters(
    tables: Tables, place_of: Callable[[str, str], str], notes: list[str], cell: float
) -> tuple[Parameters, list[str]]:
    """The parameters in tables of Nav2's nodes. Raises UsageError, with the place of each key, for wrong values."""
    found, servers = dict[str, Any](), dict[str, msgspec.Struct]()
    taken, problems = {(OWN, "localizer")}, list[str]()
    for field, place in _PLACES.items():
        table, prefix = tables.get(place.node, {}), ""
        if place.kind:
            server = servers[place.node]
            listed = getattr(server, f"{place.kind}_plugins")
            prefix = f"{listed[0] if listed else getattr(server, f'{place.kind}_plugin')}."
        if place.kind in _OWN:
            try:
                plugin, known, note = _read_plugin(place, table, prefix, place_of)
            except UsageError as error:
                problems.append(str(error))
                continue
            found[f"{place.kind}_plugin"] = plugin
            notes += note
            taken |= {(place.node, name) for name in known}
            if plugin.name not in (ASTAR, PURSUIT):
                continue
        default = Parameters._field_defaults[field]
        if field == "pursuit" and (most := Parameters(speed=found["speed"]).limits.max_vel_x) < _UNLIMITED:
            # Nav2's other controllers drive as fast as they may.
            default = msgspec.structs.replace(default, desired_linear_vel=most)
        given = _own_names(place, table, prefix, type(default))
        taken |= {(place.node, name) for name in given.values()}
        found[field], wrong = set_options(default, {key: table[name] for key, name in given.items()})
        servers.setdefault(place.node, found[field])
        for path, text in wrong:
            name = given.get(str(path[0]), str(path[0])) if path else ""
            problems.append(f"{place_of(place.node, name)}: {text}")
    localizer = tables.get(OWN, {}).get("localizer", "amcl")
    if localizer not in get_args(Localizer):
        problems.append(f"{place_of(OWN, 'localizer')}: {localizer!r} is none of {', '.join(get_args(Localizer))}")
    parameters = Parameters(**found, localizer=localizer, notes=tuple(dict.fromkeys(notes)))
    if not problems:
        problems = [
            f"{place_of(node, '')}: {what} is {value:.3g}: at most {most:g}, or {why}"
            for node, what, value, most, why in _products(parameters, cell)
            if value > most
        ]
    if problems:
        raise UsageError("\n".join(dict.fromkeys(problems)))
    ignored: dict[str, list[str]] = {}
    for node, name in sorted({(node, name) for node, table in tables.items() for name in table} - taken):
        ignored.setdefault(name, []).append(node)
    # What a wildcard gives to all nodes is for the one that knows it.
    for _, name in taken:
        if all(name in tables.get(node, {}) for node in NODES):
            ignored.pop(name, None)
    return parameters, sorted(name if len(nodes) > 1 else f"{nodes[0]}.{name}" for name, nodes in ignored.items())


def _products(parameters: Parameters, cell: float) -> Iterator[tuple[str, str, float, float, str]]:
    """What parameters and the map's cells (m) make together: node, what it is, its value, the most, and why."""
    amcl, window, pursuit, recovery = parameters.amcl, parameters.local_window, parameters.pursuit, parameters.recovery
    cells, radius = 1.0 / window.resolution, window.outline(DEFAULT_BASE).circumscribed_radius
    ahead = (pursuit.desired_linear_vel + pursuit.rotate_to_heading_angular_vel * radius) * cells
    ahead *= pursuit.max_allowed_time_to_collision_up_to_carrot
    aside = (recovery.backup_speed + recovery.rotational_vel * radius) * recovery.simulate_ahead_time * cells
    reach = math.ceil(parameters.local_layers.inflation_radius * cells)
    far = math.ceil(parameters.global_layers.inflation_radius / cell)
    guesses = amcl.max_beams * max(amcl.max_particles, amcl.global_particles)
    slow, late = "an update takes longer than half a second", "a command is not checked in time"
    yield "local_costmap", "width × height / resolution²", window.width * window.height * cells**2, 4e6, slow
    yield "local_costmap", "outline / resolution", radius * cells, 1e4, "it is wider than any costmap"
    yield "local_costmap", "inflation_radius / resolution", reach, MAX_CELLS, "the squares of distances overflow"
    yield "global_costmap", f"inflation_radius / {cell:g} m a cell", far, MAX_CELLS, "the squares of distances overflow"
    yield "amcl", "max_beams × the larger of max_particles and global_particles", guesses, 1e8, slow
    yield "controller_server", "speed × max_allowed_time_to_collision_up_to_carrot / resolution", ahead, 1e5, late
    yield "behavior_server", "speed × simulate_ahead_time / resolution", aside, 1e5, late


T = TypeVar("T", bound=msgspec.Struct)


def set_options(options: T, values: Mapping[str, Any]) -> tuple[T, list[Problem]]:
    """Options with other values; or as they were, and what is wrong with the values."""
    table, kind = plain({**msgspec.to_builtins(options), **values}), type(options)
    problems = problems_of(table, kind)
    return options if problems else msgspec.convert(table, kind), problems


def read_options(kind: type[T], parameters: Mapping[str, Any]) -> tuple[T, list[str]]:
    """Options of a class such as AmclOptions, and the names that it does not know. Raises UsageError."""
    known = {name: value for name, value in parameters.items() if name in kind.__struct_encode_fields__}
    options, problems = set_options(kind(), known)
    if problems:
        raise UsageError("\n".join(map(str, problems)))
    return options, sorted(parameters.keys() - known.keys())


_OWN: dict[str, tuple[str, Any, type[msgspec.Struct], str]] = {
    "planner": (ASTAR, AStarPlanner, AStarOptions, r"smac_planner|nav2_\w+_planner"),
    "controller": (PURSUIT, RegulatedPurePursuit, PursuitOptions, r"dwb_core|nav2_\w+_controller"),
}
"""Of each kind of plug-in: zteam's own, its class, its options, and the packages of Nav2's, whose work it does here."""


def make_planner(name: str, parameters: Mapping[str, Any]) -> Planner:
    """A planner by its name. Raises UsageError."""
    return cast(Planner, _make("planner", name, parameters))


def make_controller(name: str, parameters: Mapping[str, Any]) -> Controller:
    """A controller by its name. Raises UsageError."""
    return cast(Controller, _make("controller", name, parameters))


def _make(kind: str, name: str, parameters: Mapping[str, Any]) -> Any:
    own, make, options, _ = _OWN[kind]
    if (found := plugin_name(kind, name)) != own:
        return load_offered(f"zteam.{kind}s", found)(parameters)
    return make(read_options(options, parameters)[0])


def plugin_name(kind: str, name: str, where: str = "") -> str:
    """zteam's own name of a "planner" or "controller", or a package's, which is not imported. Raises UsageError."""
    (own, _, _, packages), group = _OWN[kind], f"zteam.{kind}s"
    if name == own or name in (there := offered(group)):
        return name
    # Files separate the parts by `::` or `/`.
    if re.fullmatch(rf"(?:{packages})(?:::|[/:.])\w+", name.strip()):
        return own
    known = f"there are {', '.join(sorted({own, *there}))}, and packages may offer more ({group})"
    raise UsageError(f"{where}there is no {kind} {name!r}: {known}")


def _own_names(place: _Place, table: Mapping[str, Any], prefix: str, kind: type[msgspec.Struct]) -> dict[str, str]:
    """Fields of the options that the table sets, and the names it has for them, which begin with `prefix`."""
    found = {}
    # A rotation shim has the parameters of its controller below its own since Kilted; its own count before them.
    for name in sorted(table, key=lambda name: _SHIMMED not in name):
        own = name.rpartition(".")[2] if place.anywhere else name.removeprefix(prefix).removeprefix(_SHIMMED)
        if own in kind.__struct_encode_fields__ and (place.anywhere or name.startswith(prefix)):
            found[own] = name
    return found


def _read_plugin(
    place: _Place, table: Mapping[str, Any], prefix: str, place_of: Callable[[str, str], str]
) -> tuple[Plugin, Iterable[str], list[str]]:
    """The plug-in that is named; the names that this explains: all of a plug-in that is not zteam's own; and a note if
    zteam's own replaces it. Raises UsageError."""
    kind = place.kind
    own = {name: value for name, value in table.items() if name.startswith(prefix)}
    key = f"{prefix}plugin"
    where, given = place_of(place.node, key), own.get(key, _OWN[kind][0])
    if not isinstance(given, str):
        raise UsageError(f"{where}: the name of a {kind} is expected, not {given!r:.100}")
    name = plugin_name(kind, given, f"{where}: ")
    for shimmed in (f"{prefix}primary_controller", f"{prefix}{_SHIMMED}plugin"):
        if name != given and shimmed in own:
            plugin_name(kind, str(own[shimmed]), f"{place_of(place.node, shimmed)}: ")
    if name != _OWN[kind][0]:
        return Plugin(name, {name.removeprefix(prefix): value for name, value in own.items() if name != key}), own, []
    if given == name:
        return Plugin(name), [key], []
    return Plugin(name), own, [f"{where}: {given} is replaced by zteam's own {name}"]


def _read_parameter_file(path: Path) -> list[_Node]:
    """The nodes of a YAML file of parameters, as ROS 2 has them. Raises UsageError."""
    with name_foreign(path, "parameter file", YAML_FILE):
        table = read_yaml(path, "parameter file", MAX_BYTES, UsageError)
        nodes = list(_find_nodes(table, ())) if isinstance(table, Mapping) else []
        if not nodes and table is not None:
            needed = f"it needs a node's name and below it {_PARAMETERS}, as Nav2's file"
            raise UsageError(f"{path} has no parameters: {needed}")
    return nodes


def _tables_of_file(nodes: list[_Node], robot_id: int) -> Tables:
    """What the nodes of a parameter file say to those of robot `robot_id`.

    A node's name may have namespaces before it (`robot_1/amcl`, or nested), and wildcards: `*` for one part, `**` for
    any. What names a node by itself counts before what names it by a wildcard, and a longer name before a shorter one.
    """
    tables: Tables = {}
    for pattern, parameters in sorted(nodes, key=lambda node: ("*" not in node[0], len(node[0].replace("*", "")))):
        # Its name until Galactic, and in files since then.
        pattern = pattern.replace("recoveries_server", "behavior_server")
        words = re.escape(pattern).replace(r"\*\*/", "(?:.*/)?").replace(r"\*\*", ".*").replace(r"\*", "[^/]*")
        for node in NODES:
            # The costmaps are nodes in namespaces of their own.
            full = f"{names.robot_name(robot_id)}/{node}" + (f"/{node}" if node.endswith("_costmap") else "")
            parts = full.split("/")
            if pattern and any(re.fullmatch(words, "/".join(parts[i:])) for i in range(len(parts))):
                tables.setdefault(node, {}).update(_flatten(parameters))
    return tables


def _find_nodes(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[_Node]:
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
