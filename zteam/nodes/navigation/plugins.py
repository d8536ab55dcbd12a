"""The planner and the controller of one robot, as its parameters name them."""

from zteam.base import Base
from zteam.planning import plugins
from zteam.planning.controller import Controller, RegulatedPurePursuit
from zteam.planning.parameters import Parameters
from zteam.planning.planner import AStarPlanner, Planner


def make_controller(parameters: Parameters, base: Base) -> Controller:
    """The controller that the parameters name; zteam's own keeps within the limits of a base. Raises UsageError."""
    name, given = parameters.controller_plugin
    if name != plugins.PURSUIT:
        return plugins.make_controller(name, given)
    options = parameters.pursuit
    return RegulatedPurePursuit(
        options._replace(
            desired_linear_vel=min(options.desired_linear_vel, base.max_vel_x),
            rotate_to_heading_angular_vel=min(options.rotate_to_heading_angular_vel, base.max_vel_theta),
            max_angular_accel=min(options.max_angular_accel, base.acc_lim_theta),
            xy_goal_tolerance=parameters.goal.xy_goal_tolerance,
        )
    )


def make_planner(parameters: Parameters) -> Planner:
    """The planner that the parameters name. Raises UsageError, and ValueError for its parameters."""
    name, given = parameters.planner_plugin
    return AStarPlanner(parameters.planner) if name == plugins.ASTAR else plugins.make_planner(name, given)
