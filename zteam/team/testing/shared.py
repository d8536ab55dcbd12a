"""One team for many tests: each test finds it as `start` or `launch` left it.

Router and simulator go on. The world is put back to its start, and all other processes are started anew.
"""

import copy
import inspect
import logging
import signal
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from typing import Any

from zteam import names
from zteam.errors import ZteamError
from zteam.node.kinds import ROUTER
from zteam.simulator.client import SimulatorClient
from zteam.team.launch.supervisor import Member
from zteam.team.testing.hangs import LOOK
from zteam.team.testing.team import TeamFixture
from zteam.team.testing.watch import TeamTimeout

log = logging.getLogger("zteam")

_KEPT = frozenset({ROUTER, names.SIMULATOR})


class SharedTeam(TeamFixture):
    """The `team_module` and `team_session` fixtures."""

    _call: tuple[Callable[..., None], Mapping[str, Any]] | None = None
    """What has started the team, `start` or `launch`, and its arguments."""
    _is_put_back = False
    """Whether this test may still start the team."""
    _ended: Collection[str] = ()
    """The processes that were ended after the last test."""

    def start(self, *args: Any, **kwargs: Any) -> None:
        """As `Team.start`. A later test may start the same team again, which is there already, or another one."""
        self._begin(super().start, args, kwargs)

    def launch(self, *args: Any, **kwargs: Any) -> None:
        """As `Team.launch`, and in a later test as `start`."""
        self._begin(super().launch, args, kwargs)

    def _begin(self, begin: Callable[..., None], args: Any, kwargs: Any) -> None:
        """Start the team. In a later test that is done already, unless another team is asked for."""
        call = begin, copy.deepcopy(inspect.signature(begin).bind(*args, **kwargs).arguments)
        if self._is_put_back:
            self._is_put_back = False
            if call == self._call:
                return
            self._end()
        self._call = None
        begin(*args, **kwargs)
        self._call, self._kept = call, self._kept_members()

    def _kept_members(self) -> dict[str, Member]:
        return {name: member for name, member in self._run.supervisor.members.items() if name in _KEPT}

    def _end(self) -> None:
        """End the team: as if nothing had been asked of the fixture yet."""
        self.close()
        TeamFixture.__init__(self, self._rootdir, live=self._live)

    def clear(self) -> None:
        """After a test: end all processes but router and simulator."""
        if self._call is None or self._watch.threads is not None:
            return
        others = [name for name in self._run.supervisor.members if name not in _KEPT]
        for name, process in self._run.supervisor.processes.items():
            if name in others:
                # One that is frozen would not stop.
                process.signal(signal.SIGCONT)
        self._run.supervisor.stop(others)
        self._ended = others

    def put_back(self) -> None:
        """Before a test: bring the team back to where it was when `start` or `launch` returned.

        A team in this process is made anew, and one whose router or simulator does not go on.
        """
        self._is_put_back = self._call is not None
        if self._goes_on():
            try:
                self._start_others_anew()
            except ZteamError as error:
                log.debug("the team is made anew: %s", error)
            else:
                return
        self._end()
        if self._call is not None:
            begin, arguments = self._call
            begin(**arguments)
            self._kept = self._kept_members()

    def _goes_on(self) -> bool:
        """Whether router and simulator are those of the start, have not been frozen, and are past the first tick."""
        kept = self._kept_members()
        # A team in this process starts as fast as it would be put back.
        if self._call is None or self._watch.threads is not None or names.SIMULATOR not in kept:
            return False
        if kept != self._kept or _KEPT & self._watch.may_end or not all(member.running for member in kept.values()):
            return False
        with suppress(ZteamError):
            # A first tick that is held takes no change.
            return not self._watch.interval or SimulatorClient(self._watch.bus, LOOK).report().ticks > 0
        return False

    def _start_others_anew(self) -> None:
        self._run.supervisor.forget(self._ended)
        self._watch.begin_test()
        self._chaos = None
        if self._processes.links is not None:
            self._processes.links.heal()
        self._run.reconnect()
        self._watch.observe()
        # What is known of the simulator is known of the others too.
        if not self._watch.wait(lambda: self.alive(names.SIMULATOR) and not any(map(self.alive, self._ended))):
            raise TeamTimeout(f"the simulator is gone, or a name of {self._ended} is still held")
        self.sim.begin_anew()
        self._watch.expect_members()
        self._processes.start_missing(self._run.plan.jobs)
        self._watch.wait_for_members()
