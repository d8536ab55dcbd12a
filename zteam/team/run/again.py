"""A run is run again: the members that ended in it end in the same ticks, and those that came back come back."""

import threading
from collections.abc import Mapping
from queue import SimpleQueue

from zteam import names
from zteam.errors import log
from zteam.messages import Tick
from zteam.simulator.recorded_ticks import RecordedTick
from zteam.team.run.team_run import TeamRun


def end_again(run: TeamRun, ticks: Mapping[int, RecordedTick]) -> None:
    """End members as the recorded `ticks` say, from now on. The simulator holds each tick until they have ended, and
    the one that they join until they have come."""
    ends = {number: each.leaving for number, each in ticks.items() if each.leaving}
    if not ends:
        return
    came, bus, members = SimpleQueue[Tick](), run.members.bus, run.supervisor
    assert bus is not None

    def work() -> None:
        left, ended = dict(ends), set[str]()
        while left or ended:
            tick = came.get()
            for name in sorted(left.pop(tick.tick, ())):
                log.info("%s ends in tick %d, as it did", name, tick.tick)
                members.stop([name], lambda: True)
                if any(name in each.members for later, each in ticks.items() if later > tick.tick):
                    ended.add(name)
            # One that comes before the end of the other is certain would take its place in this very tick.
            for name in ended.difference(tick.participants):
                ended.remove(name)
                members.restart(name)

        subscription.close()

    subscription = bus.subscribe(names.TICK, Tick, lambda _, tick: came.put(tick))
    # A process of the team that is started takes its time.
    threading.Thread(target=work, name="again", daemon=True).start()
