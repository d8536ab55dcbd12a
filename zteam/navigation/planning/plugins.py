"""Options from mappings; planners and controllers by name: zteam's own, those of packages, and Nav2's names for them.

A package offers one in the entry-point group `zteam.planners` or `zteam.controllers`: what it names is called with the
plug-in's parameters, a mapping, and returns a Planner or a Controller. So a controller that samples, such as MPPI, or a
planner that knows the ways of teammates needs no change here.
"""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import msgspec

from zteam.config.entry_points import load_offered, offered
from zteam.config.problems import Problem, problems_of
from zteam.errors import UsageError
from zteam.navigation.planning.controller import Controller, PursuitOptions, RegulatedPurePursuit
from zteam.navigation.planning.planner import AStarOptions, AStarPlanner, Planner

T = TypeVar("T", bound=msgspec.Struct)


def set_options(options: T, values: Mapping[str, Any]) -> tuple[T, list[Problem]]:
    """Options with other values, and what is wrong with these; with problems the options are as they were."""
    table, kind = {**msgspec.to_builtins(options), **values}, type(options)
    problems = problems_of(table, kind) or [
        Problem((name,), f"a finite number is expected, not {value}")
        for name, value in values.items()
        if isinstance(value, float) and not math.isfinite(value)
    ]
    return options if problems else msgspec.convert(table, kind), problems


def read_options(kind: type[T], parameters: Mapping[str, Any]) -> tuple[T, list[str]]:
    """Options of a class such as AmclOptions from `parameters`, and the names that it does not know.

    Raises UsageError for values that cannot be.
    """
    known = {name: value for name, value in parameters.items() if name in kind.__struct_encode_fields__}
    options, problems = set_options(kind(), known)
    if problems:
        raise UsageError("\n".join(map(str, problems)))
    return options, sorted(parameters.keys() - known.keys())


class Plugin(NamedTuple):
    """A planner or a controller of a robot."""

    name: str
    """zteam's own, or that of an installed package's."""
    parameters: Mapping[str, Any] = MappingProxyType({})
    """What is set of it, by the plug-in's own names."""


ASTAR, PURSUIT = "astar", "regulated_pure_pursuit"
_OWN: Mapping[str, Mapping[str, Callable[[Mapping[str, Any]], Any]]] = {
    "planner": {ASTAR: lambda given: AStarPlanner(read_options(AStarOptions, given)[0])},
    "controller": {PURSUIT: lambda given: RegulatedPurePursuit(read_options(PursuitOptions, given)[0])},
}
_GROUPS = {"planner": "zteam.planners", "controller": "zteam.controllers"}
"""Of entry points."""
NAV2_NAMES = {
    "nav2_navfn_planner::NavfnPlanner": ASTAR,
    "nav2_smac_planner::SmacPlanner2D": ASTAR,
    "nav2_theta_star_planner::ThetaStarPlanner": ASTAR,
    "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController": PURSUIT,
}
"""Plug-ins of Nav2, and what does their work here; Nav2 writes them with `/` too."""


def make_planner(name: str, parameters: Mapping[str, Any]) -> Planner:
    planner: Planner = _find("planner", name)(parameters)
    return planner


def make_controller(name: str, parameters: Mapping[str, Any]) -> Controller:
    controller: Controller = _find("controller", name)(parameters)
    return controller


def plugin_name(kind: str, name: str, where: str = "") -> str:
    """zteam's own name of a planner or a controller, or that of an installed package's, which is not imported.

    `kind` is "planner" or "controller". Raises UsageError for a name that is neither; the text begins with `where`.
    """
    own, group = _OWN[kind], _GROUPS[kind]
    own_name = NAV2_NAMES.get(name.replace("/", "::"), name)
    if own_name in own:
        return own_name
    there = offered(group)
    if name not in there:
        known = ", ".join(sorted({*own, *there}))
        raise UsageError(
            f"{where}there is no {kind} {name!r}: there are {known}, and packages may offer more ({group})"
        )
    return name


def _find(kind: str, name: str) -> Callable[[Mapping[str, Any]], Any]:
    found = plugin_name(kind, name)
    return _OWN[kind].get(found) or load_offered(_GROUPS[kind], found)
