"""A frame that a process of the user's adds to a robot in lock-step: the bundle in which it travels."""

from itertools import groupby

import pytest

from support.in_process_team import ROBOTS, InProcessTeam, TeamOptions
from support.lockstep_doubles import INTERVAL
from support.transforms import stamped
from zteam import names
from zteam.bus import Bus
from zteam.messages import TFMessage, Tick, ns_from_time


class Carrot:
    """A frame beside robot 0, published on `robot_0/tf` in every tick, with the tick's stamp."""

    def __init__(self, bus: Bus) -> None:
        self._tf = bus.publisher("robot_0/tf", TFMessage)
        bus.subscribe(names.TICK, Tick, self._on_tick)

    def _on_tick(self, _key: str, tick: Tick) -> None:
        stamp = ns_from_time(tick.stamp)
        self._tf.put(TFMessage([stamped("robot_0/base_link", "robot_0/carrot", stamp, 1.0)]))


@pytest.mark.few(1)
@pytest.mark.parametrize("first", ["carrot", "aggregator"])
def test_it_travels_in_the_bundle_of_the_next_tick(first: str) -> None:
    """Each tick has one bundle, which holds the frame as of the tick before, whichever process hears the tick first. It
    does not stand in for a base.
    """
    # In a staggered team no process is there yet.
    team = InProcessTeam(TeamOptions(staggered=first == "carrot"))
    Carrot(team.hub.bus())
    bundles: list[dict[str, int]] = []
    team.bus.subscribe(
        names.TF,
        TFMessage,
        lambda _, message: bundles.append({t.child_frame_id: ns_from_time(t.header.stamp) for t in message.transforms}),
    )
    with team:
        team.finish()
    # Before its first tick the aggregator does not know of lock-step. A tick that comes again brings its bundle again.
    later = [bundle for bundle, _ in groupby(bundles) if max(bundle.values()) > 2 * INTERVAL]
    assert [max(bundle.values()) // INTERVAL for bundle in later] == [*range(3, 102)]
    assert {len(bundle) for bundle in later} == {ROBOTS + 1}
    assert all(bundle["robot_0/base_footprint"] - bundle["robot_0/carrot"] == INTERVAL for bundle in later)
