"""A follower that misses a share of what others tell."""

from msgspec.structs import replace

from studies.study.losses import SHARE, Losses
from zteam.robot.view import View
from zteam.testing import make_view

TICKS = 4000


def moving(tick: int) -> View:
    """Robots 0 and 2 drive along x, robot 1 looks; each tells the number of the tick."""
    now = 0.1 * (tick + 1)
    view = make_view(robot_id=1, poses={0: (now, 0.0, 0.0), 1: (now, 1.0, 0.0), 2: (now, 2.0, 0.0)}, now=now)
    return replace(view, inputs={"statuses": {0: tick, 1: tick, 2: tick}, "goal": tick})


def test_a_share_of_the_poses_is_that_of_before() -> None:
    """5 % of the ticks show a mate where it was a tick before, with that stamp, each mate by itself; the own is new."""
    losses, late = Losses(SHARE), {0: 0, 2: 0}
    both = 0
    for tick in range(TICKS):
        view = losses.lose(moving(tick))
        own = view.map_from_base()
        assert own is not None and own[1] == view.now
        old = []
        for mate in late:
            seen = view.lookup("map", f"robot_{mate}/base_footprint")
            assert seen is not None and abs(seen[0].x - seen[1] / 1e9) < 1e-6
            old.append(seen[1] < view.now)
            late[mate] += old[-1]
        both += all(old)
    assert all(0.8 * SHARE < count / TICKS < 1.2 * SHARE for count in late.values())
    assert both < 0.5 * SHARE * TICKS


def test_statuses_are_lost_too() -> None:
    """A status that is lost leaves the one before in its place; the own ones and those of no robot come all."""
    losses, lost = Losses(SHARE), 0
    for tick in range(TICKS):
        inputs = losses.lose(moving(tick)).inputs
        assert inputs["goal"] == inputs["statuses"][1] == tick
        assert 0 <= tick - inputs["statuses"][0] <= 4
        lost += inputs["statuses"][0] != tick
    assert 0.8 * SHARE < lost / TICKS < 1.2 * SHARE


def test_what_is_gone_is_gone() -> None:
    """A mate without a pose has none, whatever came before."""
    losses = Losses(SHARE)
    assert losses.lose(moving(0)).base_from_robot(0) is not None
    assert losses.lose(make_view(robot_id=1, now=0.2)).base_from_robot(0) is None
