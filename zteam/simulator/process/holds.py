"""Which robots' bodies the simulator holds: those that are stopped, whatever commands them.

A query counts at once for those that ask, and for the bodies from the next tick on.
"""

import logging
from collections.abc import Callable, Collection
from functools import partial

from zteam import names
from zteam.bus import Bus
from zteam.bus.transport import Closeable, Held
from zteam.config.robot_ids import format_robot_ids
from zteam.node.stopping import ask_stopped, serve_stop

log = logging.getLogger("zteam")


class Holds:
    """The bus's threads change it, the main loop reads it once a tick."""

    def __init__(self, bus: Bus, on_change: Callable[[], None]) -> None:
        """`on_change()` is called when a query has stopped or released a robot."""
        self._bus, self._on_change = bus, on_change
        self._served: dict[int, list[Held[Closeable]]] = {}
        """By robot in the world."""
        self._told: dict[int, bool] = {}
        """What the queries have said, by robot. A robot that comes back to the world is what it was."""
        self._before: dict[int, bool] = {}
        """What holds where no query has come: what others knew at the start, and the team for one that came later."""
        self._is_known = False
        """Whether the others have been asked."""
        bus.watch_tokens([names.tokens_key(names.ALL_ROBOTS)], self._on_robot)

    def _on_robot(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        robot_id = None if token is None else names.robot_id_of(token[0])
        for each in () if robot_id is None or alive else self._served.get(robot_id, ()):
            each.renew()

    def match_robots(self, robots: Collection[int]) -> None:
        """These are in the world now. One that comes while all others are stopped is stopped too."""
        for gone in self._served.keys() - robots:
            for each in self._served.pop(gone):
                each.close()
        known = sorted(self._served)
        is_team_stopped = bool(known) and all(map(self.is_stopped, known))
        for robot_id in sorted(robots - self._served.keys()):
            if is_team_stopped:
                self._told.pop(robot_id, None)
            self._before[robot_id] = is_team_stopped or self._before.get(robot_id, False)
            is_stopped, change = partial(self._known, robot_id), partial(self._change, robot_id)
            self._served[robot_id] = serve_stop(self._bus, robot_id, names.SIMULATOR, is_stopped, change)

    def is_stopped(self, robot_id: int) -> bool:
        """Whether the body of this robot is held."""
        return self._told.get(robot_id, self._before.get(robot_id, False))

    def _known(self, robot_id: int) -> bool | None:
        return self.is_stopped(robot_id) if self._is_known or robot_id in self._told else None

    @property
    def stopped(self) -> list[int]:
        """The robots in the world that are stopped."""
        return [robot_id for robot_id in sorted(self._served) if self.is_stopped(robot_id)]

    def _change(self, robot_id: int, stopped: bool) -> None:
        changed = stopped != self.is_stopped(robot_id)
        self._told[robot_id] = stopped
        if changed:
            self._on_change()

    def learn(self) -> None:
        """At the start, when this process answers already: find out from the robots' processes which are stopped.

        A robot without one is stopped if all that have one are. It waits.
        """
        found = [(robot_id, reply) for robot_id, reply in ask_stopped(self._bus, names.ALL_ROBOTS)]
        told = {robot_id: reply.is_stopped for robot_id, reply in found if reply.by != names.SIMULATOR}
        team = bool(told) and all(told.values())
        self._before |= {robot_id: told.get(robot_id, team) for robot_id in self._served}
        self._is_known = True
        if self.stopped:
            log.info("%s begin stopped, as they were: 'zteam stop --release'", format_robot_ids(self.stopped))
