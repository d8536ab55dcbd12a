"""Planner, controller, checkers and recovery on small maps."""

import math

import numpy as np
import pytest

from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.navigation.planning.costmap import (
    INSCRIBED_INFLATED_OBSTACLE,
    LETHAL_OBSTACLE,
    Costmap,
    CostmapOptions,
    make_circle,
    make_costmap,
    make_footprint,
)
from zteam.navigation.planning.grid import make_map
from zteam.navigation.planning.parameters import make_controller, make_planner
from zteam.navigation.planning.planner import AStarOptions, AStarPlanner, NoPathError
from zteam.navigation.planning.recovery import Recovery, RecoveryOptions
from zteam.navigation.planning.scans import Scan, Teammate
from zteam.planning import BlockedError, GoalChecker, ProgressChecker, PursuitOptions, RegulatedPurePursuit, Velocity

RESOLUTION = 0.05


def room(*walls: tuple[slice, slice], size: int = 100) -> Costmap:
    """A costmap of a square room of 5 m with these blocked cells, for a round robot of 0.2 m."""
    cells = np.zeros((size, size), np.int8)
    for wall in walls:
        cells[wall] = 100
    return make_costmap(make_map(cells, RESOLUTION), make_circle(0.2), CostmapOptions(inflation_radius=0.5))


def stands_free(costmap: Costmap, pose: Pose2) -> bool:
    """Whether a robot at `pose` touches no lethal cell."""
    return costmap.cost_at(pose.x, pose.y) < INSCRIBED_INFLATED_OBSTACLE


WALL = (slice(50, 53), slice(0, 80))
START, GOAL = Pose2(1.0, 1.0, 0.0), Pose2(1.0, 4.0, 1.5)


def test_a_plan_leads_round_a_wall_to_the_goal() -> None:
    """It begins at the start, ends at the goal with its heading, and stays clear of the wall."""
    costmap = room(WALL)
    plan = AStarPlanner().plan(costmap, START, GOAL)
    assert plan.path[0, :2] == pytest.approx(START[:2])
    assert plan.path[-1] == pytest.approx(GOAL)
    assert plan.short_of_goal == 0.0
    assert plan.length > 2.0 * math.dist((1.0, 1.0), (4.0, 2.5))
    assert all(stands_free(costmap, Pose2(*pose)) for pose in plan.path.tolist())
    assert np.hypot(*np.diff(plan.path[:, :2], axis=0).T).max() <= RESOLUTION + 1e-9


def test_a_plan_near_a_blocked_goal_says_how_far_it_is() -> None:
    """Within the tolerance; beyond it there is a reason."""
    costmap = room(WALL)
    plan = AStarPlanner(AStarOptions(tolerance=0.6)).plan(costmap, START, Pose2(1.0, 2.55, 0.0))
    assert 0.2 < plan.short_of_goal <= 0.6
    with pytest.raises(NoPathError, match="obstacle"):
        AStarPlanner(AStarOptions(tolerance=0.1)).plan(costmap, START, Pose2(1.0, 2.55, 0.0))
    with pytest.raises(NoPathError, match="no way"):
        AStarPlanner().plan(room((slice(50, 53), slice(0, 100))), START, GOAL)


@pytest.mark.parametrize(
    ("start", "goal", "why"),
    [
        (START, Pose2(9.0, 1.0, 0.0), "goal .* outside"),
        (Pose2(-1.0, 1.0, 0.0), GOAL, "start .* outside"),
        (START, Pose2(math.nan, 1.0, 0.0), "not finite"),
        (Pose2(1.0, 2.55, 0.0), GOAL, "start .* obstacle"),
    ],
)
def test_bad_ends_are_refused_with_a_reason(start: Pose2, goal: Pose2, why: str) -> None:
    """Outside, not finite, within an obstacle."""
    thick = room((slice(30, 73), slice(0, 80)))
    with pytest.raises(NoPathError, match=why):
        AStarPlanner().plan(thick, start, goal)


def drive(costmap: Costmap, pose: Pose2, goal: Pose2, seconds: float = 60.0) -> tuple[Pose2, bool]:
    """An ideal robot that follows a plan; where it ends, and whether the goal is reached."""
    controller, checker = RegulatedPurePursuit(), GoalChecker()
    controller.set_path(AStarPlanner().plan(costmap, pose, goal).path)
    velocity = Velocity()
    for _ in range(int(seconds / 0.1)):
        velocity = controller.command(costmap, pose, velocity, 0.1)
        turn = 0.1 * velocity.turn
        pose = pose.compose(Pose2(0.1 * velocity.x * math.cos(turn / 2), 0.1 * velocity.x * math.sin(turn / 2), turn))
        assert stands_free(costmap, pose)
        if checker.is_reached(pose, goal):
            return pose, True
    return pose, False


@pytest.mark.few(1)
@pytest.mark.parametrize("yaw", [0.0, 1.5, 3.0, -1.5])
def test_a_robot_reaches_a_goal_behind_a_wall(yaw: float) -> None:
    """With any heading at the start, and the heading of the goal at the end."""
    pose, reached = drive(room(WALL), START._replace(yaw=yaw), GOAL)
    assert reached, pose


def test_it_turns_first_and_slows_down_before_the_end() -> None:
    """A path that leads back is faced on the spot; near the end the speed falls."""
    costmap, controller = room(), RegulatedPurePursuit()
    line = np.column_stack((np.arange(1.0, 3.0, 0.05), np.full(40, 2.5), np.zeros(40)))
    controller.set_path(line)
    assert controller.command(costmap, Pose2(1.0, 2.5, 3.0), Velocity(), 0.1).x == 0.0
    assert controller.command(costmap, Pose2(1.0, 2.5, 0.0), Velocity(), 0.1).x == pytest.approx(0.5)
    assert controller.command(costmap, Pose2(1.0, 2.5, 0.0), Velocity(), 0.1).turn == pytest.approx(0.0)
    assert controller.remaining() == pytest.approx(1.95)
    assert 0.05 <= controller.command(costmap, Pose2(2.65, 2.5, 0.0), Velocity(), 0.1).x < 0.3
    for path in (np.empty((0, 3)), np.zeros((4, 2)), np.full((2, 3), np.nan)):
        with pytest.raises(ValueError, match="path"):
            controller.set_path(path)


@pytest.mark.parametrize("stateful", [True, False])
def test_at_the_end_it_goes_on_to_turn(stateful: bool) -> None:
    """A pose that is corrected by more than the tolerance does not make it drive again; another path does."""
    costmap, path = room(), np.array([[1.0, 1.0, 0.0], [2.0, 1.0, 1.5]])
    pursuit = RegulatedPurePursuit(PursuitOptions(stateful=stateful))
    pursuit.set_path(path)
    assert pursuit.command(costmap, Pose2(1.77, 1.0, 0.0), Velocity(), 0.1).x == 0.0
    corrected = Pose2(1.73, 1.0, 0.0)
    assert (pursuit.command(costmap, corrected, Velocity(), 0.1).x == 0.0) == stateful
    pursuit.set_path(path)
    assert pursuit.command(costmap, corrected, Velocity(), 0.1).x > 0.0


@pytest.mark.parametrize(("search", "left"), [(-1.0, 1.0), (0.0, 1.0), (0.5, 3.5)])
def test_its_place_is_looked_for_on_the_whole_path_or_a_part(search: float, left: float) -> None:
    """A `max_robot_pose_search_dist` of 0 or less is the whole path, as in Nav2."""
    pursuit = RegulatedPurePursuit(PursuitOptions(max_robot_pose_search_dist=search))
    pursuit.set_path(np.array([[0.5 + 0.5 * i, 2.5, 0.0] for i in range(9)]))
    pursuit.command(room(), Pose2(3.5, 2.5, 0.0), Velocity(), 0.1)
    assert pursuit.remaining() == left


def test_where_nothing_is_free_it_says_so() -> None:
    """A robot walled in gets no command."""
    cells = np.full((40, 40), 100, np.int8)
    cells[16:24, 16:24] = 0
    square = make_footprint([(0.19, 0.19), (-0.19, 0.19), (-0.19, -0.19), (0.19, -0.19)])
    costmap = make_costmap(make_map(cells, RESOLUTION), square)
    controller = RegulatedPurePursuit(PursuitOptions())
    controller.set_path(np.array([[1.0, 1.0, 0.0], [1.5, 1.0, 0.0], [2.0, 1.0, 0.0]]))
    with pytest.raises(BlockedError, match=r"\(1.00, 1.00\)"):
        controller.command(costmap, Pose2(1.0, 1.0, 0.0), Velocity(), 0.1)


def test_goals_and_progress_are_checked_as_in_nav2() -> None:
    """0.25 m and 0.25 rad; once there only the heading counts. 0.5 m in 10 s."""
    checker = GoalChecker()
    assert not checker.is_reached(Pose2(0.3, 0.0, 0.0), Pose2(0.0, 0.0, 0.0))
    assert not checker.is_reached(Pose2(0.2, 0.0, 0.5), Pose2(0.0, 0.0, 0.0))
    assert checker.is_reached(Pose2(0.3, 0.0, 0.1), Pose2(0.0, 0.0, 0.0))
    checker.reset()
    assert not checker.is_reached(Pose2(0.3, 0.0, 0.1), Pose2(0.0, 0.0, 0.0))
    assert checker.is_reached(Pose2(0.1, 0.0, 2.0), Pose2(0.0, 0.0, math.nan))
    progress = ProgressChecker()
    assert progress.makes_progress(0.0, Pose2(0.0, 0.0, 0.0))
    assert progress.makes_progress(9.0, Pose2(0.4, 0.0, 0.0))
    assert not progress.makes_progress(10.5, Pose2(0.4, 0.0, 0.0))
    assert progress.makes_progress(10.6, Pose2(0.6, 0.0, 0.0))


def test_recovery_goes_through_its_behaviours_and_gives_up() -> None:
    """Wait, clear, back up, spin; then the reason and what was tried."""
    costmap, recovery = room(), Recovery(RecoveryOptions(number_of_retries=4))
    pose, now = Pose2(2.5, 2.5, 0.0), 0.0
    for behavior in ("wait", "clear_costmap", "back_up", "spin"):
        assert recovery.begin(now, pose, "blocked") is None
        assert recovery.current == behavior
        while (velocity := recovery.step(now, pose, costmap)) is not None:
            now += 0.1
            pose = pose.compose(Pose2(0.1 * velocity.x, 0.0, 0.1 * velocity.turn))
        assert recovery.current is None
    assert now == pytest.approx(2.0 + 2.0 + 1.6, abs=0.3)
    assert pose.x == pytest.approx(2.2, abs=0.02)
    why = recovery.begin(now, pose, "blocked")
    assert why == "blocked: gave up after 4 recoveries (wait, clear_costmap, back_up, spin)"
    assert recovery.begin(now, Pose2(4.5, 2.5, 0.0), "blocked") is None


def test_a_recovery_waits_as_long_as_it_is_told() -> None:
    """The time that a motion is allowed does not end it."""
    recovery, pose = (
        Recovery(RecoveryOptions(behaviors=("wait",), wait_duration=15.0, time_allowance=3.0)),
        Pose2(1, 1, 0),
    )
    recovery.begin(0.0, pose, "blocked")
    assert recovery.step(14.9, pose, room()) == Velocity()
    assert recovery.step(15.0, pose, room()) is None


def test_a_motion_of_a_recovery_ends_in_time() -> None:
    """However far it came, and without another try."""
    recovery, pose = Recovery(RecoveryOptions(behaviors=("spin",), time_allowance=3.0)), Pose2(2.5, 2.5, 0.0)
    recovery.begin(0.0, pose, "blocked")
    assert recovery.step(0.5, pose, room()) == Velocity(turn=1.0)
    assert recovery.step(3.1, Pose2(2.5, 2.5, 0.5), room()) is None


def test_a_recovery_stops_before_an_obstacle() -> None:
    """Something behind, on whichever of the costmaps: it does not back up."""
    walled, pose = room((slice(0, 100), slice(0, 20))), Pose2(1.23, 2.5, 0.0)
    for costmaps in ([walled], [room(), walled]):
        recovery = Recovery(RecoveryOptions(behaviors=("back_up",)))
        recovery.begin(0.0, pose, "blocked")
        assert recovery.step(0.0, pose, *costmaps) is None


def test_options_that_cannot_work_are_refused() -> None:
    """A behaviour that does not exist, and a speed of 0, also where a program makes the options itself."""
    with pytest.raises(ValueError, match=r"behaviors\[1\]"):
        RecoveryOptions(behaviors=("wait", "dance"))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="desired_linear_vel: a number of at least"):
        PursuitOptions(desired_linear_vel=0.0)


def test_a_recovery_turns_no_faster_than_nav2_lets_it() -> None:
    """`max_rotational_vel` bounds `rotational_vel`."""
    recovery = Recovery(RecoveryOptions(behaviors=("spin",), max_rotational_vel=0.4))
    recovery.begin(0.0, Pose2(2.5, 2.5, 0.0), "blocked")
    assert recovery.step(0.0, Pose2(2.5, 2.5, 0.0), room()) == Velocity(turn=0.4)


@pytest.mark.parametrize("threshold", [253, 100, 90, 1])
def test_a_wall_of_the_map_is_an_obstacle_whatever_the_threshold(threshold: int) -> None:
    """As Nav2 does, more than 100 is 100."""
    cells = np.zeros((9, 9), np.int8)
    cells[4, 4] = 100
    options = CostmapOptions(lethal_cost_threshold=threshold)
    assert make_costmap(make_map(cells, 0.1), make_circle(0.2), options).costs[4, 4] == LETHAL_OBSTACLE


def test_a_recovery_tries_other_ways_where_the_robot_does_not_move() -> None:
    """Each for a second: it turns the other way round, and backs up on arcs; then the behaviour is over."""
    costmap, pose = room(), Pose2(2.5, 2.5, 0.0)
    for behavior, ways in (("spin", 2), ("back_up", 5)):
        recovery = Recovery(RecoveryOptions(behaviors=(behavior,)))  # type: ignore[arg-type]
        recovery.begin(0.0, pose, "blocked")
        tried: list[Velocity] = []
        for tick in range(100):
            velocity = recovery.step(0.1 * tick, pose, costmap)
            if velocity is None:
                break
            tried.append(velocity)
        assert len(set(tried)) == ways
        assert len(tried) == pytest.approx(ways * 10, abs=2 * ways)
        assert {math.copysign(1.0, velocity.turn) for velocity in tried} == {1.0, -1.0}
        assert all((velocity.x < 0.0) == (behavior == "back_up") for velocity in tried)


def test_a_scan_marks_and_clears_and_teammates_come_and_go() -> None:
    """What a laser meets is lethal until a beam goes through it; a teammate is lethal where it is now."""
    costmap = room()
    base = Pose2(2.5, 2.5, 0.0)
    near = Scan(np.array([1.0], np.float32), 0.0, 0.1, 0.0, 10.0, Pose2(0.1, 0.0, 0.0))
    costmap.observe(near, base)
    costmap.update()
    assert costmap.cost_at(3.61, 2.51) == 254
    assert costmap.cost_at(3.45, 2.51) == 253
    costmap.observe(near._replace(ranges=np.array([np.inf], np.float32)), base)
    window = costmap.update()
    assert costmap.cost_at(3.61, 2.51) == 0
    assert window is not None
    assert costmap.update() is None
    mate = Teammate(3.6, 2.5, 0.2)
    costmap.observe(near, base, [mate])
    costmap.set_teammates([mate])
    costmap.update()
    assert costmap.cost_at(3.75, 2.5) == 254
    costmap.set_teammates([])
    costmap.update()
    assert not costmap.costs.any()
    costmap.observe(near, base)
    costmap.update()
    costmap.clear_around(base, 2.0)
    costmap.update()
    assert not costmap.costs.any()
    assert costmap.cost_at(-1.0, 0.0) == 254


@pytest.mark.parametrize(
    ("of_costmap", "given", "meant"),
    [(3.0, None, 0.4), (10.0, None, 0.4), (0.0, None, None), (10.0, 3.0, 0.2 + 0.2 * 10.0 / 3.0), (10.0, 0.0, None)],
)
def test_beside_a_wall_it_is_slower(of_costmap: float, given: float | None, meant: float | None) -> None:
    """At 0.4 m it drives 0.4 / 0.6 of its speed, whatever the costmap's decay; a factor that is given is believed."""
    cells = np.zeros((100, 100), np.int8)
    cells[50, :] = 100
    options = CostmapOptions(inflation_radius=1.0, cost_scaling_factor=of_costmap)
    costmap = make_costmap(make_map(cells, 0.05), make_circle(0.2), options)
    controller = RegulatedPurePursuit(PursuitOptions(inflation_cost_scaling_factor=given))
    y = 50.5 * 0.05 - 0.4
    controller.set_path(np.array([[0.05 * x, y, 0.0] for x in range(10, 90)]))
    command = controller.command(costmap, Pose2(1.0, y, 0.0), Velocity(0.5), 0.1)
    expected = 0.5 * min(1.0, (meant or 1.0) / 0.6)
    assert command.x == pytest.approx(expected, rel=0.03)


def test_to_forget_what_lasers_have_seen_leaves_what_the_map_says() -> None:
    """Around the robot, unknown cells of the map stay unknown and its walls stay walls: only marks and clearings go."""
    cells = np.zeros((100, 100), np.int8)
    cells[:, 50:], cells[10, :] = -1, 100
    costmap = make_costmap(make_map(cells, 0.05), make_circle(0.2))
    before = costmap.costs.copy()
    base = Pose2(2.4, 2.5, 0.0)
    costmap.observe(Scan(np.array([1.0, 1.5], np.float32), 0.0, 0.3, 0.0, 10.0, Pose2(0.1, 0.0, 0.0)), base)
    costmap.update()
    assert (costmap.costs != before).any()
    costmap.clear_around(base, 3.0)
    costmap.update()
    assert (costmap.costs == before).all()


def test_plug_ins_are_found_by_name() -> None:
    """zteam's names and Nav2's; another one is refused with those that there are."""
    assert isinstance(make_planner("astar", {"tolerance": 0.3, "unknown": 1}), AStarPlanner)
    assert isinstance(make_planner("nav2_navfn_planner/NavfnPlanner", {}), AStarPlanner)
    controller = make_controller(
        "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController", {"desired_linear_vel": 1}
    )
    assert isinstance(controller, RegulatedPurePursuit)
    assert controller.options.desired_linear_vel == 1.0
    with pytest.raises(UsageError, match="no planner 'mppi': there are astar"):
        make_planner("mppi", {})
    for value in ("fast", True, math.nan, [1.0]):
        with pytest.raises(UsageError, match=r"desired_linear_vel: a (finite )?number"):
            make_controller("regulated_pure_pursuit", {"desired_linear_vel": value})
