"""A localiser in lock-step: from which tick on its pose counts, for all robots at once."""

import pytest

from support.in_process_team import NAMES, InProcessTeam, TeamOptions
from support.transforms import stamped
from zteam import names
from zteam.bus import Bus
from zteam.messages import Done, RobotState, RobotStatus, TFMessage, Tick, ns_from_time
from zteam.simulator.core import to_messages

FIRST = 10
"""The tick in which the localiser begins."""


class Localiser:
    """Places robot 0 where it is, in each tick from FIRST on, as soon as it hears the tick."""

    def __init__(self, bus: Bus, team: InProcessTeam) -> None:
        self._pose = to_messages.static_transforms(0, team.robots[0], team.robots[0].pose).transforms[0].transform
        self._tf = bus.publisher("robot_0/tf", TFMessage)
        bus.subscribe(names.TICK, Tick, self._on_tick)

    def _on_tick(self, _key: str, tick: Tick) -> None:
        if tick.tick >= FIRST:
            # As AMCL: valid for some time to come.
            transform = stamped("map", "robot_0/odom", ns_from_time(tick.stamp) + 200_000_000)
            transform.transform = self._pose
            self._tf.put(TFMessage([transform]))


def run_with_localiser(first: str) -> tuple[str, set[tuple[str, int]], set[str]]:
    """The hash, the answers that had come when the start pose ended, and all that the robots said of themselves."""
    team = InProcessTeam(TeamOptions(run_for=3.0))
    answered: set[tuple[str, int]] = set()
    ends: list[set[tuple[str, int]]] = []
    texts: set[str] = set()

    def on_static(_key: str, message: TFMessage) -> None:
        if answered and all(t.child_frame_id != "robot_0/odom" for t in message.transforms):
            ends.append({*answered})

    def on_status(_key: str, status: RobotStatus) -> None:
        if status.state == RobotState.RUNNING:
            texts.add(status.text)

    team.bus.subscribe(names.done_key(), Done, lambda key, done: answered.add((key.split("/")[0], done.tick)))
    team.bus.subscribe(names.all_robots_key(names.STATUS), RobotStatus, on_status)
    bus = team.hub.bus()
    if first == "localiser":
        for name in team.options.order:
            team.end(name)
        Localiser(bus, team)
        team.bring(team.options.order)
    else:
        Localiser(bus, team)
    team.bus.subscribe(names.TF_STATIC, TFMessage, on_static, latched=True)
    with team:
        return team.finish().trajectory_sha256, ends[0], texts


@pytest.mark.gate
def test_it_takes_over_between_two_ticks() -> None:
    """The start pose ends after all have answered the tick in which the first pose comes, so no robot loses its pose,
    and the run does not depend on whether the localiser hears the tick before the others or after them."""
    runs = [run_with_localiser(first) for first in ("localiser", "robots")]
    assert runs[0][0] == runs[1][0]
    for _, answered, texts in runs:
        assert {(name, FIRST) for name in NAMES} <= answered
        assert FIRST + 1 not in {tick for _, tick in answered}
        assert not [text for text in texts if "pose" in text]
