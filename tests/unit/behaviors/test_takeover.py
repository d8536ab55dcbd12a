"""takeover: a robot leads in the place of the head of its chain."""

import math

import pytest

from support.flat_floor import Floor, Segment
from zteam.behaviors import Behavior, View, load_behavior
from zteam.behaviors.polyline import Polyline
from zteam.behaviors.takeover import SUCCESSORS, Takeover
from zteam.geometry import Pose2
from zteam.messages import Twist

HEAD = Pose2(3.0, 2.0, 0.5 * math.pi)
TRAIL = [(-1.0, 0.0), (3.0, 0.0), (3.0, 2.0)]
"""Along the x axis, and left to the head."""
FAR: Segment = (50.0, 50.0, 51.0, 50.0)


class Leading(Behavior):
    """Takes over from robot 0."""

    def __init__(self, takeover: Takeover) -> None:
        super().__init__(None)
        self.takeover = takeover

    def step(self, view: View) -> Twist:
        """The velocity of the takeover."""
        command, self.reason = self.takeover.step(view, [0], 0.7, 3.14)
        return command


def lead(takeover: Takeover, seconds: float, walls: list[Segment] | None = None) -> tuple[Floor, list[Pose2]]:
    """The floor after robot 1 has taken over from robot 0, which stands; and where robot 1 was."""
    floor = Floor([HEAD, Pose2(1.0, 0.0, 0.0)], walls or [FAR])
    idle, leading = load_behavior("idle", {}), Leading(takeover)
    places = [floor.poses[1]]
    for _ in range(round(10 * seconds)):
        floor.step([idle, leading])
        places.append(floor.poses[1])
    return floor, places


def test_it_drives_along_the_trail_past_the_head_and_goes_on() -> None:
    """Round the corner and not across it, beside the head and back, then on with the behaviour from there."""
    floor, places = lead(Takeover(Polyline(TRAIL), HEAD, "forward"), 30.0)
    corner = min(math.hypot(x - 3.0, y) for x, y, _yaw in places)
    assert corner < 0.2
    assert min(math.hypot(x - HEAD.x, y - HEAD.y) for x, y, _yaw in places) > 0.5
    assert floor.poses[1].y > HEAD.y + 2.5
    assert floor.poses[1].x == pytest.approx(3.0, abs=0.1)
    assert floor.commands[1][0].linear.x == pytest.approx(0.2)


def test_without_a_trail_it_drives_straight_to_the_head() -> None:
    """The direct law knows none; `idle` stands past the head."""
    floor, _ = lead(Takeover(Polyline(), HEAD, "idle"), 30.0)
    assert math.hypot(floor.poses[1].x - 3.0, floor.poses[1].y - HEAD.y - 1.9) < 0.2
    assert floor.commands[1][0] == Twist()


def test_it_does_not_press_on_at_a_wall() -> None:
    """The head stands before a wall, so no robot can pass it. After a while the behaviour drives and turns away."""
    walls: list[Segment] = [(2.0, 2.6, 4.0, 2.6), (2.0, 1.0, 2.0, 2.6), (4.0, 1.0, 4.0, 2.6), (-3.0, -3.0, 6.0, -3.0)]
    _, places = lead(Takeover(Polyline(TRAIL), HEAD, "wander"), 40.0, walls)
    inside = [i for i, place in enumerate(places) if place.y > 1.0]
    assert inside
    assert places[-1].y < 1.0


def test_without_a_place_of_the_head_it_goes_on_at_once() -> None:
    """It does not drive to a place that it does not know."""
    _, places = lead(Takeover(Polyline(TRAIL), None, "forward"), 1.0)
    assert places[-1].x == pytest.approx(1.2, abs=0.03)


@pytest.mark.parametrize("then", ["", "path", "my_robot:Class"])
def test_what_it_cannot_do_becomes_avoid(then: str) -> None:
    """A behaviour that needs parameters, or a class of the user's own, is not made without them."""
    _, places = lead(Takeover(Polyline(TRAIL), None, then), 1.0)
    assert then not in SUCCESSORS
    assert places[-1].x == pytest.approx(1.2, abs=0.03)


@pytest.mark.parametrize("then", SUCCESSORS)
def test_successors_need_nothing(then: str) -> None:
    """They have no required parameters and no further inputs, and they do not look transforms up."""
    kind = SUCCESSORS[then]
    assert not kind.inputs
    assert not kind.uses_tf
    kind(kind.Params())


def test_it_stands_where_its_own_place_is_not_known() -> None:
    """A place is needed to drive anywhere."""
    view = Floor([HEAD, HEAD], [FAR]).view(1)
    unknown = View(**{name: getattr(view, name) for name in view.__struct_fields__} | {"lookup": lambda _a, _b: None})
    command, reason = Takeover(Polyline(TRAIL), HEAD, "avoid").step(unknown, [0], 0.7, 3.14)
    assert (command, reason) == (Twist(), "its own pose in map is not known")
