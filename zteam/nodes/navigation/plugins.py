"""Planners and controllers by the names that Nav2 gives them."""

from collections.abc import Callable

from zteam.base import Base
from zteam.planning.controller import Controller, RegulatedPurePursuit
from zteam.planning.parameters import Parameters
from zteam.planning.planner import AStarPlanner, Planner


def _pursuit(parameters: Parameters, base: Base) -> Controller:
    options = parameters.pursuit
    return RegulatedPurePursuit(
        options._replace(
            desired_linear_vel=min(options.desired_linear_vel, base.max_vel_x),
            rotate_to_heading_angular_vel=min(options.rotate_to_heading_angular_vel, base.max_vel_theta),
            max_angular_accel=min(options.max_angular_accel, base.acc_lim_theta),
            xy_goal_tolerance=parameters.goal.xy_goal_tolerance,
        )
    )


def _a_star(parameters: Parameters) -> Planner:
    return AStarPlanner(parameters.planner)


CONTROLLERS: dict[str, Callable[[Parameters, Base], Controller]] = {
    "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController": _pursuit,
}
"""The first one is taken where the parameters name none, or one that is not here."""
PLANNERS: dict[str, Callable[[Parameters], Planner]] = {
    "nav2_navfn_planner::NavfnPlanner": _a_star,
    "nav2_navfn_planner/NavfnPlanner": _a_star,
}


def make_controller(parameters: Parameters, base: Base) -> Controller:
    """The controller that the parameters name, within the limits of a base."""
    return CONTROLLERS.get(parameters.controller_plugin, _pursuit)(parameters, base)


def make_planner(parameters: Parameters) -> Planner:
    """The planner that the parameters name. Raises ValueError for its parameters."""
    return PLANNERS.get(parameters.planner_plugin, _a_star)(parameters)
