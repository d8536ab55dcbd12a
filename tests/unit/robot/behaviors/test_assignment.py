"""Who keeps which slot."""

from zteam.robot.behaviors.slots import Assignment

SLOTS = [(0.0, 0.0), (1.0, 0.0)]
SECOND = 1_000_000_000


def look(assignment: Assignment, now: int, *xs: float) -> list[int | None]:
    """The slots of robots 1, 2, … that stand at these places on a line."""
    members = {robot: (x, 0.0) for robot, x in enumerate(xs, 1)}
    if assignment.is_due(now, members):
        assignment.look(now, members, SLOTS)
    return [assignment.slots.get(robot) for robot in members]


def test_slots_change_hands_only_where_that_helps_much() -> None:
    """Two robots that stand nearly as well do not swap, and robots that have passed each other do."""
    assignment = Assignment()
    assert look(assignment, 0, 0.0, 1.0) == [0, 1]
    assert look(assignment, SECOND, 0.55, 0.5) == [0, 1]
    assert look(assignment, 2 * SECOND, 1.0, 0.0) == [1, 0]


def test_it_looks_at_the_same_times_in_all_robots() -> None:
    """Twice a second by the clock, whenever it has looked last, and at once when members come or go."""
    assignment = Assignment()
    members = {1: (0.0, 0.0)}
    assert assignment.is_due(0, members)
    assignment.look(400_000_000, members, SLOTS[:1])
    assert not assignment.is_due(499_999_999, members)
    assert assignment.is_due(500_000_000, members)
    assert assignment.is_due(400_000_000, {**members, 2: (1.0, 0.0)})
    assert assignment.slots.get(2) is None
