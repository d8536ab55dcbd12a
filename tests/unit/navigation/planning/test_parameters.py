"""Parameters of navigation: Nav2's files and names, tables of team files, what is refused and what is listed."""

import math
from pathlib import Path

import msgspec
import pytest

from support.installed_packages import install
from zteam.config.problems import problems_of
from zteam.errors import UsageError
from zteam.messages.base import Base
from zteam.navigation.planning.amcl import AmclOptions
from zteam.navigation.planning.parameters import FirstPose, Parameters, navigation_of_robot

NAV2 = """
amcl:
  ros__parameters:
    use_sim_time: True
    alpha1: 0.3
    max_particles: 4000
    initial_pose: {x: 1.0, y: 2.0, yaw: 0.5}
    set_initial_pose: true
controller_server:
  ros__parameters:
    controller_frequency: 10.0
    controller_plugins: ["Follow"]
    progress_checker_plugins: ["slow"]
    slow: {movement_time_allowance: 20.0}
    goal_checker_plugins: ["precise"]
    precise:
      plugin: "nav2_controller::SimpleGoalChecker"
      xy_goal_tolerance: 0.1
    Follow:
      plugin: "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController"
      desired_linear_vel: 0.4
local_costmap:
  local_costmap:
    ros__parameters:
      width: 4
      footprint: "[[0.2, 0.2], [0.2, -0.2], [-0.2, 0.0]]"
      inflation_layer: {inflation_radius: 0.5}
      voxel_layer:
        scan: {obstacle_max_range: 2.0}
/**:
  ros__parameters:
    alpha1: 0.9
    alpha2: 0.4
robot_2:
  amcl:
    ros__parameters: {alpha3: 0.7}
"""

SHIM = (
    "controller_server: {{ros__parameters: {{FollowPath: "
    "{{plugin: 'nav2_rotation_shim_controller::RotationShimController', {}}}}}}}"
)


def read(folder: Path, text: str, robot_id: int = 1, **table: object) -> Parameters:
    """The parameters of a file with this text."""
    (folder / "nav2_params.yaml").write_text(text, "latin-1")
    return navigation_of_robot({"params": "nav2_params.yaml", **table}, robot_id, folder, "navigation")[0]


def alphas(parameters: Parameters) -> tuple[float, float, float]:
    return parameters.amcl.alpha1, parameters.amcl.alpha2, parameters.amcl.alpha3


def test_a_file_of_nav2_is_taken_as_it_is(tmp_path: Path) -> None:
    """Nodes in namespaces, plugins under names of the user's, layers: each value goes where Nav2 has it."""
    found = read(tmp_path, NAV2)
    assert (found.amcl.alpha1, found.amcl.max_particles, found.amcl.min_particles) == (0.3, 4000, 500)
    assert found.initial_pose == FirstPose(True, 1.0, 2.0, 0.5)
    assert (found.pursuit.desired_linear_vel, found.goal.xy_goal_tolerance) == (0.4, 0.1)
    assert found.progress.movement_time_allowance == 20.0
    assert (found.local_window.width, found.local_layers.inflation_radius) == (4, 0.5)
    assert found.local_layers.obstacle_max_range == 2.0
    assert found.global_layers.obstacle_max_range == 2.5
    assert found.controller.controller_frequency == 10.0


def test_what_names_a_node_itself_counts_before_a_wildcard(tmp_path: Path) -> None:
    """`/**` is for every node, in whatever order the file has it; `robot_2/amcl` for that robot alone."""
    assert alphas(read(tmp_path, NAV2)) == (0.3, 0.4, 0.2)
    assert alphas(read(tmp_path, NAV2, robot_id=2)) == (0.3, 0.4, 0.7)


def test_a_table_of_a_team_file_replaces_values_of_the_file(tmp_path: Path) -> None:
    """With the same names, nested or joined by dots."""
    found = read(
        tmp_path, NAV2, localizer="fake", amcl={"alpha1": 1}, controller_server={"Follow.desired_linear_vel": 1.0}
    )
    assert (found.localizer, found.amcl.alpha1, found.amcl.alpha2) == ("fake", 1.0, 0.4)
    assert found.pursuit.desired_linear_vel == 1.0


@pytest.mark.parametrize(("in_file", "own", "hertz"), [(20.0, None, 1.0), (0.5, None, 0.5), (20.0, 5.0, 5.0)])
def test_a_file_of_nav2_plans_once_a_second(tmp_path: Path, in_file: float, own: float | None, hertz: float) -> None:
    """At most: there the frequency is a threshold for a warning. The team's own table is taken as it is."""
    text = f"planner_server: {{ros__parameters: {{expected_planner_frequency: {in_file}}}}}"
    tables = {} if own is None else {"planner_server": {"expected_planner_frequency": own}}
    assert read(tmp_path, text, **tables).planner_server.expected_planner_frequency == hertz


def test_names_that_are_not_known_are_listed(tmp_path: Path) -> None:
    """Sorted, with their nodes; the plugins that are here, and the lists of plugins, are known."""
    (tmp_path / "nav2_params.yaml").write_text(NAV2)
    table = {"params": "nav2_params.yaml", "amcl": {"beams": 3}}
    unknown = ["amcl.beams", "amcl.use_sim_time", "controller_server.precise.plugin"]
    assert navigation_of_robot(table, 1, tmp_path, "navigation")[1] == unknown
    (tmp_path / "nav2_params.yaml").write_text(f"{NAV2}\n'*': {{ros__parameters: {{use_sim_time: true}}}}")
    unknown = ["amcl.beams", "controller_server.precise.plugin", "use_sim_time"]
    assert navigation_of_robot(table, 1, tmp_path, "navigation")[1] == unknown


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("amcl: {ros__parameters: {alpha1: fast}}", 'nav2_params.yaml: amcl.alpha1: a number is expected, not "fast"'),
        (
            "controller_server: {ros__parameters: {FollowPath: {use_rotate_to_heading: 3}}}",
            "nav2_params.yaml: controller_server.FollowPath.use_rotate_to_heading: true or false is expected, not 3",
        ),
        ("navigation: {ros__parameters: {localizer: gps}}", "nav2_params.yaml: localizer: 'gps' is none of amcl, fake"),
        (
            "controller_server: {ros__parameters: {controller_frequency: 0.0}}",
            "controller_frequency: a number of at least",
        ),
        ("amcl: {ros__parameters: {min_particles: 9000}}", "min_particles 9000 is above max_particles 2000"),
        ("behavior_server: {ros__parameters: {behaviors: [dance]}}", "behavior_server.behaviors: "),
        ("amcl: {ros__parameters: {alpha1: .nan}}", "amcl.alpha1: a number of at least 0 is expected, not NaN"),
        (
            'local_costmap: {local_costmap: {ros__parameters: {footprint: "round"}}}',
            "local_costmap.footprint: 'round': give corners in metres",
        ),
        (
            "local_costmap: {local_costmap: {ros__parameters: {footprint: [[0.2, 0.2], [0.2, -0.2], [-0.2, 0.0]]}}}",
            'give corners in metres, in quotes, such as "[[0.2, 0.2], ',
        ),
        (
            "planner_server: {ros__parameters: {expected_planner_frequency: fast}}",
            "planner_server.expected_planner_frequency: a number is expected",
        ),
        (
            "controller_server: {ros__parameters: {FollowPath: {plugin: dwb}}}",
            "yaml: controller_server.FollowPath.plugin: there is no controller 'dwb': there are regulated_pure_pursuit",
        ),
        (
            "controller_server: {ros__parameters: {FollowPath: {plugin: [dwb]}}}",
            "yaml: controller_server.FollowPath.plugin: the name of a controller is expected, not ['dwb']",
        ),
        (
            "planner_server: {ros__parameters: {planner_plugins: [Far], Far: {plugin: a::B, tolerance: 1.0}}}",
            "nav2_params.yaml: planner_server.Far.plugin: there is no planner 'a::B': there are astar, and",
        ),
        ("amcl: {ros__parameters: {max_particles: 2000000000}}", "amcl.max_particles: a whole number of at most"),
        ("amcl: {ros__parameters: {max_particles: 900000, max_beams: 900}}", "amcl: max_beams × the larger of"),
        (
            "local_costmap: {local_costmap: {ros__parameters: {width: 900, height: 900}}}",
            "local_costmap: width × height / resolution² is 3.24e+08: at most 4e+06",
        ),
        (
            "local_costmap: {local_costmap: {ros__parameters: {inflation_layer: {inflation_radius: 50}}}}",
            "local_costmap: inflation_radius / resolution is 1e+03: at most 180",
        ),
        (
            "local_costmap: {local_costmap: {ros__parameters: {footprint_padding: 900, resolution: 4e-2}}}",
            "local_costmap: outline / resolution is",
        ),
        (
            "controller_server: {ros__parameters: {FollowPath: {max_allowed_time_to_collision_up_to_carrot: 1e6}}}",
            "controller_server: speed × max_allowed_time_to_collision_up_to_carrot / resolution is",
        ),
        ("behavior_server: {ros__parameters: {simulate_ahead_time: 1e6}}", "behavior_server: speed × simulate_ahead"),
        (
            "controller_server: {ros__parameters: {controller_plugins: A}}",
            'controller_plugins: a list is expected, not "A"',
        ),
        (
            "planner_server: {ros__parameters: {planner_plugins: [1]}}",
            "planner_server.planner_plugins: a text is expected",
        ),
        ("velocity_smoother: {ros__parameters: {max_velocity: '[1, 0, 1]'}}", "max_velocity: a list is expected"),
        (
            "velocity_smoother: {ros__parameters: {max_velocity: [1, 0]}}",
            "max_velocity: a list of 3 values is expected",
        ),
        (
            "controller_server: {ros__parameters: {FollowPath: {plugin: 'dwb_core::DWBLocalPlanner', max_vel_x: 0.0}}}",
            "controller_server.FollowPath.max_vel_x: a number of at least 0.001",
        ),
        (
            "controller_server: {ros__parameters: {FollowPath: {plugin: 'nav2_navfn_planner::NavfnPlanner'}}}",
            "there is no controller 'nav2_navfn_planner::NavfnPlanner'",
        ),
        (
            "controller_server: {ros__parameters: {FollowPath: {plugin: 'nav2_controller::SimpleGoalChecker'}}}",
            "FollowPath.plugin: there is no controller 'nav2_controller::SimpleGoalChecker'",
        ),
        (SHIM.format("primary_controller: 'teb::Planner'"), "FollowPath.primary_controller: there is no controller"),
        (SHIM.format("primary_controller: {plugin: a::B}"), "FollowPath.primary_controller.plugin: there is no"),
        ("<?xml version='1.0'?>\n<sdf version='1.8'/>", "nav2_params.yaml: this is a file of Gazebo"),
        ("\x89PNG\r\n", "nav2_params.yaml: this is a picture"),
        ("[1, 2]", "has no parameters"),
        ("a: [", "nav2_params.yaml:1: not YAML: while parsing a flow node"),
        ("amcl: {alpha1: 0.3}", "has no parameters"),
    ],
)
def test_a_wrong_value_is_refused_with_file_and_key(tmp_path: Path, text: str, told: str) -> None:
    """One line for each."""
    with pytest.raises(UsageError) as error:
        read(tmp_path, text)
    assert told in str(error.value)
    assert "\n" not in str(error.value)


NUMBERS = [
    (type(options), name)
    for options in Parameters._field_defaults.values()
    if isinstance(options, msgspec.Struct)
    for name in options.__struct_encode_fields__
    if not all(problems_of({name: number}, type(options)) for number in (1, 0.5))
    and problems_of({name: True}, type(options))
]


def test_every_number_has_bounds() -> None:
    """Of every option of navigation: neither a huge one on either side, nor NaN, is taken."""
    assert len(NUMBERS) > 70
    for kind, name in NUMBERS:
        for number in (1e300, -1e300, 10**30, -(10**30), math.inf, math.nan):
            assert problems_of({name: number}, kind), (kind, name, number)


@pytest.mark.parametrize(
    ("plugin", "given", "speed", "turn"),
    [
        (
            "dwb_core::DWBLocalPlanner",
            "max_vel_x: 0.26, max_speed_xy: 0.3, max_vel_theta: 1.0, acc_lim_x: 2.5",
            0.26,
            1.0,
        ),
        ("dwb_core/DWBLocalPlanner", "max_vel_x: 0.9, max_speed_xy: 0.8, critics: [GoalDist]", 0.8, 1.8),
        ("nav2_mppi_controller::MPPIController", "vx_max: 0.4, vx_min: -0.35, wz_max: 1.5, time_steps: 56", 0.4, 1.5),
        ("nav2_graceful_controller::GracefulController", "v_linear_max: 0.3, v_angular_max: 5.0", 0.3, 1.8),
        (
            "nav2_regulated_pure_pursuit_controller/RegulatedPurePursuitController",
            "desired_linear_vel: 0.2, rotate_to_heading_angular_vel: 0.7",
            0.2,
            0.7,
        ),
        ("nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController", "max_linear_vel: 0.6", 0.6, 1.8),
        (
            "nav2_rotation_shim_controller::RotationShimController",
            "primary_controller: 'dwb_core::DWBLocalPlanner', rotate_to_heading_angular_vel: 0.9, max_vel_x: 0.22",
            0.22,
            0.9,
        ),
        (
            "nav2_rotation_shim_controller::RotationShimController",
            "primary_controller: {plugin: 'nav2_mppi_controller::MPPIController', vx_max: 0.3, wz_max: 1.1}",
            0.3,
            1.1,
        ),
        (
            "nav2_rotation_shim_controller::RotationShimController",
            "rotate_to_heading_angular_vel: 0.5, primary_controller: {vx_max: 0.4, rotate_to_heading_angular_vel: 2}",
            0.4,
            0.5,
        ),
    ],
)
def test_a_controller_of_nav2_is_replaced_and_its_limits_hold(
    tmp_path: Path, plugin: str, given: str, speed: float, turn: float
) -> None:
    """One note says so; the robot drives as fast as the file lets it, on a base that could go faster."""
    text = f"controller_server: {{ros__parameters: {{FollowPath: {{plugin: '{plugin}', {given}}}}}}}"
    found = read(tmp_path, text)
    assert len(found.notes) == 1
    assert plugin in found.notes[0]
    fast = Base(max_vel_x=5.0, max_vel_theta=9.0)
    options = found.make_controller(fast).options  # type: ignore[attr-defined]
    assert (options.desired_linear_vel, options.rotate_to_heading_angular_vel) == (speed, turn)
    slower = f"{text}\nvelocity_smoother: {{ros__parameters: {{max_velocity: [0.1, 0.0, 0.3]}}}}"
    options = read(tmp_path, slower).make_controller(fast).options  # type: ignore[attr-defined]
    assert (options.desired_linear_vel, options.rotate_to_heading_angular_vel) == (0.1, 0.3)


@pytest.mark.parametrize(
    ("controller", "smoother", "backwards", "turn"),
    [
        ("max_vel_x: 0.05, max_speed_xy: 0.05, min_vel_x: 0.0", "{}", -0.05, 1000.0),
        ("max_vel_x: 0.5, min_vel_x: -0.1", "{min_velocity: [-0.3, 0.0, -0.2]}", -0.1, 0.2),
        ("vx_max: 0.5, vx_min: -0.35", "{min_velocity: [-0.3, 0.0, -1.0], max_velocity: [1, 0, 0.7]}", -0.3, 0.7),
        ("vx_min: -0.2", "{}", -0.2, 1000.0),
    ],
)
def test_a_robot_reverses_and_turns_clockwise_no_faster_than_its_file_allows(
    tmp_path: Path, controller: str, smoother: str, backwards: float, turn: float
) -> None:
    """Nor backwards faster than forwards; with a lowest speed of 0 recoveries still reverse, as in Nav2."""
    text = f"controller_server: {{ros__parameters: {{FollowPath: {{{controller}}}}}}}"
    limits = read(tmp_path, f"{text}\nvelocity_smoother: {{ros__parameters: {smoother}}}").limits
    assert (limits.min_vel_x, limits.max_vel_theta) == (backwards, turn)


def test_special_values_are_those_of_nav2(tmp_path: Path) -> None:
    """However far below 0 they are."""
    text = """
amcl: {ros__parameters: {laser_max_range: -5.0}}
controller_server: {ros__parameters: {failure_tolerance: -2.0, FollowPath: {max_robot_pose_search_dist: -2.0}}}
"""
    found = read(tmp_path, text)
    assert (found.controller.failure_tolerance, found.pursuit.max_robot_pose_search_dist) == (-2.0, -2.0)
    assert found.amcl.farthest == AmclOptions(laser_max_range=0.0).farthest


@pytest.mark.parametrize(
    "plugin",
    ["nav2_navfn_planner/NavfnPlanner", "nav2_smac_planner::SmacPlannerHybrid", "smac_planner/SmacPlanner",
     "nav2_theta_star_planner::ThetaStarPlanner", " nav2_navfn_planner:Navfn", "nav2_navfn_planner.NavfnPlanner"],
)  # fmt: skip
def test_a_planner_of_nav2_is_replaced(tmp_path: Path, plugin: str) -> None:
    """With a note; what has the same name holds."""
    text = f"planner_server: {{ros__parameters: {{GridBased: {{plugin: '{plugin}', tolerance: 5e-2}}}}}}"
    found = read(tmp_path, text)
    assert (found.planner_plugin.name, found.planner.tolerance, len(found.notes)) == ("astar", 0.05, 1)


def test_the_table_is_laid_over_the_file_before_both_are_checked(tmp_path: Path) -> None:
    """What the table replaces may be wrong in the file; what is wrong then is told of the one that has the key."""
    text = """
amcl: {ros__parameters: {alpha1: -1, max_particles: 600}}
controller_server: {ros__parameters: {FollowPath: {plugin: "teb_local_planner::TebLocalPlannerROS"}}}
"""
    own = {"amcl": {"alpha1": 0.1}, "controller_server": {"FollowPath": {"plugin": "regulated_pure_pursuit"}}}
    assert read(tmp_path, text, **own).amcl.alpha1 == 0.1
    with pytest.raises(UsageError) as error:
        read(tmp_path, text, amcl={"alpha2": -1, "alpha1": 0.1})
    assert [line.rpartition(": a ")[0] or line.partition(": there")[0] for line in str(error.value).splitlines()] == [
        "navigation: amcl.alpha2",
        "nav2_params.yaml: controller_server.FollowPath.plugin",
    ]
    with pytest.raises(UsageError, match=r"^navigation: amcl: min_particles 700 is above"):
        read(tmp_path, "amcl: {ros__parameters: {max_particles: 600}}", amcl={"min_particles": 700})


@pytest.mark.parametrize(
    "key",
    ["/**", "/robot_1/**", "robot_1/**", "/robot_1/*/local_costmap", "'**/local_costmap'", "robot_1: {'**'",
     "/robot_1/local_costmap/local_costmap", "robot_1/local_costmap/local_costmap", "local_costmap/local_costmap",
     "local_costmap"],
)  # fmt: skip
def test_keys_name_nodes_in_namespaces(tmp_path: Path, key: str) -> None:
    """With wildcards for one part or any; those of another robot do not count."""
    end = "}" if "{" in key else ""
    text = f"{key}: {{ros__parameters: {{width: 7}}}}{end}\n/robot_2/**: {{ros__parameters: {{width: 9}}}}"
    assert read(tmp_path, text).local_window.width == 7
    # Of names that fit, one without wildcards counts, and else the longer one.
    other = 7 if "local_costmap" in key and "robot_1" not in key else 9
    assert read(tmp_path, text, robot_id=2).local_window.width == other


def test_a_file_of_which_nothing_applies_is_told(tmp_path: Path) -> None:
    """Its nodes are another robot's: a note names them, for other robots of the team may need them."""
    text = "robot_7: {amcl: {ros__parameters: {alpha1: 0.3}}}"
    assert [("robot_7/amcl" in note, "robot_1" in note) for note in read(tmp_path, text).notes] == [(True, True)]
    assert read(tmp_path, text, robot_id=7).notes == ()


def test_older_names_of_nav2_are_known(tmp_path: Path) -> None:
    """A checker's name in the place of a list, motion models by their short names, and the server of recoveries."""
    found = read(
        tmp_path,
        """
amcl: {ros__parameters: {robot_model_type: omnidirectional}}
controller_server:
  ros__parameters:
    goal_checker_plugin: near
    near: {xy_goal_tolerance: 0.1}
recoveries_server: {ros__parameters: {max_rotational_vel: 0.4}}
""",
    )
    assert found.recovery.max_rotational_vel == 0.4
    assert (found.goal.xy_goal_tolerance, found.amcl.robot_model_type) == (0.1, "omnidirectional")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    """With the reason of the system."""
    with pytest.raises(UsageError, match=r"none\.yaml: cannot read this parameter file: No such file"):
        navigation_of_robot({"params": "none.yaml"}, 0, tmp_path, "navigation")


def test_a_plugin_of_a_package_gets_its_own_parameters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By their own names and unchecked, also those that zteam's own plug-ins have; none of them is unknown."""
    install(tmp_path, "acme", "[zteam.controllers]\ncreep = acme:make\n", {"acme": "raise RuntimeError"})
    monkeypatch.syspath_prepend(tmp_path)
    table = {"controller_server": {"FollowPath": {"plugin": "creep", "desired_linear_vel": "slow", "size": {"x": 1}}}}
    parameters, unknown = navigation_of_robot(table, 1, tmp_path, "navigation")
    assert parameters.controller_plugin == ("creep", {"desired_linear_vel": "slow", "size.x": 1})
    assert unknown == []
