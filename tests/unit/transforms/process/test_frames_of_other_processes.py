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
    """A frame beside robot 0, published on `robot_0/tf` in every tick, with the tick's stamp or `ahead` ns later."""

    def __init__(self, bus: Bus, ahead: int = 0) -> None:
        self._ahead = ahead
        self._tf = bus.publisher("robot_0/tf", TFMessage)
        bus.subscribe(names.TICK, Tick, self._on_tick)

    def _on_tick(self, _key: str, tick: Tick) -> None:
        stamp = ns_from_time(tick.stamp) + self._ahead
        self._tf.put(TFMessage([stamped("robot_0/base_link", "robot_0/carrot", stamp, 1.0)]))


@pytest.mark.few(1)
@pytest.mark.parametrize("first", ["carrot", "aggregator"])
def test_it_travels_in_the_bundle_of_the_next_tick(first: str) -> None:
    """Each tick has one bundle, which holds the frame as of the tick before, whichever process hears the tick first."""
    team = InProcessTeam()
    if first == "aggregator":
        Carrot(team.hub.bus())
    bundles: list[dict[str, int]] = []
    team.bus.subscribe(
        names.TF,
        TFMessage,
        lambda _, message: bundles.append({t.child_frame_id: ns_from_time(t.header.stamp) for t in message.transforms}),
    )
    if first == "carrot":
        team.end("tf")
        Carrot(team.hub.bus())
        team.bring(["tf"])
    with team:
        team.finish()
    # Before its first tick the aggregator does not know of lock-step. A tick that comes again brings its bundle again.
    later = [bundle for bundle, _ in groupby(bundles) if max(bundle.values()) > 2 * INTERVAL]
    assert [max(bundle.values()) // INTERVAL for bundle in later] == [*range(3, 102)]
    assert all(bundle["robot_0/base_footprint"] - bundle["robot_0/carrot"] == INTERVAL for bundle in later)


def test_it_does_not_stand_in_for_a_base() -> None:
    """With a stamp of the future, as localisers give, the bundles hold every base of their tick."""
    team = InProcessTeam(TeamOptions(run_for=2.0))
    Carrot(team.hub.bus(), 5 * INTERVAL // 2)
    bundles: list[list[tuple[str, int]]] = []
    team.bus.subscribe(
        names.TF,
        TFMessage,
        lambda _, message: bundles.append(
            [
                (t.child_frame_id, ns_from_time(t.header.stamp))
                for t in message.transforms
                if t.child_frame_id.endswith("/base_footprint")
            ]
        ),
    )
    with team:
        team.finish(5.0)
    bases = [f"robot_{i}/base_footprint" for i in range(ROBOTS)]
    later = [bundle for bundle, _ in groupby(bundles) if bundle and bundle[0][1] > 2 * INTERVAL]
    assert later == [[(base, tick * INTERVAL) for base in bases] for tick in range(3, 22)]
