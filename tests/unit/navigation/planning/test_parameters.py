"""Parameters of navigation: Nav2's files and names, tables of team files, what is refused and what is listed."""

from pathlib import Path

import pytest

from support.installed_packages import install
from zteam.errors import UsageError
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


def read(folder: Path, text: str, robot_id: int = 1, **table: object) -> Parameters:
    """The parameters of a file with this text."""
    (folder / "nav2_params.yaml").write_text(text)
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


def test_names_that_are_not_known_are_listed(tmp_path: Path) -> None:
    """Sorted, with their nodes; the plugins that are here, and the lists of plugins, are known."""
    (tmp_path / "nav2_params.yaml").write_text(NAV2)
    table = {"params": "nav2_params.yaml", "amcl": {"beams": 3}}
    unknown = navigation_of_robot(table, 1, tmp_path, "navigation")[1]
    assert [name for name in unknown if not name.endswith(("alpha1", "alpha2"))] == [
        "amcl.beams", "amcl.use_sim_time", "controller_server.precise.plugin",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("amcl: {ros__parameters: {alpha1: fast}}", 'nav2_params.yaml: amcl.alpha1: a number is expected, not "fast"'),
        (
            "controller_server: {ros__parameters: {FollowPath: {use_rotate_to_heading: 3}}}",
            "nav2_params.yaml: controller_server.FollowPath.use_rotate_to_heading: true or false is expected, not 3",
        ),
        ("navigation: {ros__parameters: {localizer: gps}}", "nav2_params.yaml: localizer: 'gps' is none of amcl, fake"),
        ("controller_server: {ros__parameters: {controller_frequency: 0.0}}", "controller_frequency: a number above 0"),
        ("amcl: {ros__parameters: {min_particles: 9000}}", "min_particles 9000 is above max_particles 2000"),
        ("behavior_server: {ros__parameters: {behaviors: [dance]}}", "behavior_server.behaviors: "),
        ("amcl: {ros__parameters: {alpha1: .nan}}", "amcl.alpha1: a finite number is expected"),
        (
            'local_costmap: {local_costmap: {ros__parameters: {footprint: "round"}}}',
            "local_costmap: footprint 'round': give corners in metres",
        ),
        (
            "controller_server: {ros__parameters: {FollowPath: {plugin: dwb}}}",
            "yaml: controller_server.FollowPath.plugin: there is no controller 'dwb': there are regulated_pure_pursuit",
        ),
        (
            "planner_server: {ros__parameters: {planner_plugins: [Far], Far: {plugin: a::B, tolerance: 1.0}}}",
            "nav2_params.yaml: planner_server.Far.plugin: there is no planner 'a::B': there are astar, and",
        ),
        ("[1, 2]", "has no parameters"),
        ("a: [", "nav2_params.yaml: not YAML: "),
        ("amcl: {alpha1: 0.3}", "has no parameters"),
    ],
)
def test_a_wrong_value_is_refused_with_file_and_key(tmp_path: Path, text: str, told: str) -> None:
    """One line for each."""
    with pytest.raises(UsageError) as error:
        read(tmp_path, text)
    assert told in str(error.value)
    assert "\n" not in str(error.value)


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
