"""Leases of robots, and the dead man."""

from zteam.nodes.web.driving import DEAD_MAN, STOP, Leases, Velocity

AHEAD = Velocity(0.5, 0.1)


def test_one_viewer_drives_a_robot() -> None:
    """A second viewer is told which one drives; it gets the lease when that one gives it back."""
    leases = Leases()
    assert leases.take(0, viewer=1) == ""
    assert leases.take(0, viewer=1) == ""
    assert leases.take(0, viewer=2) == "viewer 1 drives this robot"
    assert leases.release(0, viewer=2) == "this page does not drive this robot"
    assert leases.release(0, viewer=1) == ""
    assert (leases.take(0, viewer=2), leases.holder(0)) == ("", 2)


def test_only_the_holder_commands() -> None:
    """What another viewer says changes nothing."""
    leases = Leases()
    leases.take(0, viewer=1)
    assert not leases.drive(0, 2, AHEAD, now=10.0)
    assert not leases.drive(5, 1, AHEAD, now=10.0)
    assert dict(leases.commands(10.0)) == {0: STOP}


def test_a_silent_page_stops_its_robot() -> None:
    """What a page says counts for half a second; then the robot is commanded to stand, and stays leased."""
    leases = Leases()
    leases.take(0, viewer=1)
    leases.drive(0, 1, AHEAD, now=10.0)
    assert dict(leases.commands(10.0 + DEAD_MAN - 0.01)) == {0: AHEAD}
    assert dict(leases.commands(10.0 + DEAD_MAN)) == {0: STOP}
    assert leases.holder(0) == 1


def test_the_robots_of_a_page_are_known() -> None:
    """When the page goes, these are released."""
    leases = Leases()
    for robot_id, viewer in ((0, 1), (1, 2), (2, 1)):
        leases.take(robot_id, viewer)
    assert leases.of(1) == [0, 2]
