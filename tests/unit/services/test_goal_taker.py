"""What takes a robot's goals."""

from zteam.services.goal_taker import GO_TO, GONE, NAVIGATION, SETTLE, GoalTaker

NAV, ROBOT = "nav_1/alive/a", "robot_1/alive/b"


def test_navigation_wins_over_the_behaviour() -> None:
    """Whichever speaks first; a presence token of navigation counts before its first word."""
    taker = GoalTaker(1, 0.0)
    taker.take_token(NAV, True, 0.0)
    taker.take_behavior(GO_TO, 10.0)
    assert taker.kind == ""
    taker.take_navigation()
    taker.take_behavior(GO_TO, 11.0)
    assert (taker.kind, taker.process) == (NAVIGATION, "nav_1")


def test_the_behaviour_takes_goals_once_it_is_clear_that_there_is_no_navigation() -> None:
    """The token of a navigation may come a little later than a robot's status."""
    taker = GoalTaker(1, 0.0)
    taker.take_behavior(GO_TO, SETTLE / 2)
    assert taker.kind == ""
    taker.take_behavior(GO_TO, SETTLE)
    assert (taker.kind, taker.process, taker.lack) == (GO_TO, "robot_1", "")


def test_what_is_missing_is_said_with_the_way_out() -> None:
    """A behaviour that takes no goals is named."""
    taker = GoalTaker(1, 0.0)
    assert taker.lack == "the navigation of robot_1: start 'zteam-nav --id 1'"
    taker.take_behavior("wander", 5.0)
    assert taker.lack.endswith("; it runs the behaviour wander, which takes no goals")
    assert taker.kind == ""


def test_a_navigation_that_runs_need_not_be_started() -> None:
    """It holds its name, but says nothing: there is no simulator, or simulated time stands still."""
    taker = GoalTaker(1, 0.0)
    taker.take_token(NAV, True, 0.0)
    assert taker.lack.startswith("the first status of nav_1: it runs, but no tick of a simulator")
    taker.take_token(NAV, False, 1.0)
    assert taker.lack == "the navigation of robot_1: start 'zteam-nav --id 1'"


def test_a_process_that_stays_away_is_gone() -> None:
    """A token that comes back in time, as after a router's end, is no loss; later the loss is told once."""
    taker = GoalTaker(1, 0.0)
    taker.take_token(NAV, True, 0.0)
    taker.take_navigation()
    taker.take_token(NAV, False, 10.0)
    assert taker.take_loss(10.0 + GONE / 2) == ""
    taker.take_token("nav_1/alive/c", True, 11.0)
    assert taker.take_loss(10.0 + 2 * GONE) == ""
    taker.take_token("nav_1/alive/c", False, 20.0)
    assert taker.take_loss(20.0 + GONE) == "nav_1"
    assert (taker.kind, taker.take_loss(30.0)) == ("", "")


def test_the_end_of_a_process_that_takes_no_goals_is_no_loss() -> None:
    """A robot's own process may be started again while its navigation works."""
    taker = GoalTaker(1, 0.0)
    taker.take_token(NAV, True, 0.0)
    taker.take_token(ROBOT, True, 0.0)
    taker.take_navigation()
    taker.take_token(ROBOT, False, 1.0)
    assert taker.take_loss(100.0) == ""
