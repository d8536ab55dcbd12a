"""Planners and controllers by name: zteam's own, those of installed packages, and Nav2's names for them.

A package offers one in the entry-point group `zteam.planners` or `zteam.controllers`: what it names is called with the
plug-in's parameters, a mapping, and returns a Planner or a Controller. So a controller that samples, such as MPPI, or a
planner that knows the ways of teammates needs no change here.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from zteam.entry_points import load_offered, offered
from zteam.errors import UsageError
from zteam.planning.controller import Controller, PursuitOptions, RegulatedPurePursuit
from zteam.planning.options import read_options
from zteam.planning.planner import AStarOptions, AStarPlanner, Planner

PLANNERS_GROUP, CONTROLLERS_GROUP = "zteam.planners", "zteam.controllers"
"""Entry points."""
Parameters = Mapping[str, Any]


def _make_astar(parameters: Parameters) -> AStarPlanner:
    return AStarPlanner(read_options(AStarOptions, parameters)[0])


def _make_pursuit(parameters: Parameters) -> RegulatedPurePursuit:
    return RegulatedPurePursuit(read_options(PursuitOptions, parameters)[0])


class Plugin(NamedTuple):
    """A planner or a controller of a robot."""

    name: str
    """zteam's own, or that of an installed package's."""
    parameters: Mapping[str, Any] = MappingProxyType({})
    """What is set of it, by the plug-in's own names."""


class _Kind(NamedTuple):
    """Planners, or controllers."""

    own: Mapping[str, Callable[[Parameters], Any]]
    group: str
    """Of entry points."""


ASTAR, PURSUIT = "astar", "regulated_pure_pursuit"
_KINDS = {
    "planner": _Kind({ASTAR: _make_astar}, PLANNERS_GROUP),
    "controller": _Kind({PURSUIT: _make_pursuit}, CONTROLLERS_GROUP),
}
NAV2_NAMES = {
    "nav2_navfn_planner::NavfnPlanner": ASTAR,
    "nav2_smac_planner::SmacPlanner2D": ASTAR,
    "nav2_theta_star_planner::ThetaStarPlanner": ASTAR,
    "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController": PURSUIT,
}
"""Plug-ins of Nav2, and what does their work here; Nav2 writes them with `/` too."""


def make_planner(name: str, parameters: Parameters) -> Planner:
    """The planner of this name. Raises UsageError."""
    planner: Planner = _find("planner", name)(parameters)
    return planner


def make_controller(name: str, parameters: Parameters) -> Controller:
    """The controller of this name. Raises UsageError."""
    controller: Controller = _find("controller", name)(parameters)
    return controller


def plugin_name(kind: str, name: str, where: str = "") -> str:
    """zteam's own name of a planner or a controller, or that of an installed package's, which is not imported.

    `kind` is "planner" or "controller". Raises UsageError for a name that is neither; the text begins with `where`.
    """
    own, group = _KINDS[kind]
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


def _find(kind: str, name: str) -> Callable[[Parameters], Any]:
    found = plugin_name(kind, name)
    own, group = _KINDS[kind]
    return own.get(found) or load_offered(group, found)
