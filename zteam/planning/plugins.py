"""Planners and controllers by name: zteam's own, those of installed packages, and Nav2's names for them.

A package offers one in the entry-point group `zteam.planners` or `zteam.controllers`: what it names is called with the
plug-in's parameters, a mapping, and returns a Planner or a Controller. So a controller that samples, such as MPPI, or a
planner that knows the ways of teammates needs no change here.
"""

from collections.abc import Callable, Mapping
from typing import Any

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


PLANNERS: dict[str, Callable[[Parameters], Planner]] = {"astar": _make_astar}
CONTROLLERS: dict[str, Callable[[Parameters], Controller]] = {"regulated_pure_pursuit": _make_pursuit}
NAV2_NAMES = {
    "nav2_navfn_planner::NavfnPlanner": "astar",
    "nav2_smac_planner::SmacPlanner2D": "astar",
    "nav2_theta_star_planner::ThetaStarPlanner": "astar",
    "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController": "regulated_pure_pursuit",
}
"""Plug-ins of Nav2, and what does their work here; Nav2 writes them with `/` too."""


def make_planner(name: str, parameters: Parameters) -> Planner:
    """The planner of this name. Raises UsageError."""
    planner: Planner = _find("planner", name, PLANNERS, PLANNERS_GROUP)(parameters)
    return planner


def make_controller(name: str, parameters: Parameters) -> Controller:
    """The controller of this name. Raises UsageError."""
    controller: Controller = _find("controller", name, CONTROLLERS, CONTROLLERS_GROUP)(parameters)
    return controller


def _find(kind: str, name: str, own: Mapping[str, Callable[[Parameters], Any]], group: str) -> Callable[..., Any]:
    own_name = NAV2_NAMES.get(name.replace("/", "::"), name)
    found: Callable[..., Any] | None = own.get(own_name) or load_offered(group, name)
    if found is None:
        there = ", ".join(sorted({*own, *offered(group)}))
        raise UsageError(f"there is no {kind} {name!r}: there are {there}, and packages may offer more ({group})")
    return found
