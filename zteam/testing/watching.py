"""The watch on a team under test: which of its processes has ended or hangs though the test did not ask for that."""

from functools import partial

from zteam import names
from zteam.clock import monotonic
from zteam.errors import UsageError
from zteam.in_process.user_calls import UserCall, user_calls
from zteam.launch.kinds import ROUTER, TeamLaunch
from zteam.launch.plan import plan_team
from zteam.process_options import LOCKSTEP_TIMEOUT
from zteam.services.simulator import SimStatus, SimulatorClient
from zteam.testing.processes import START_LIMIT, TeamFailure, TeamProcesses

_SILENT_AFTER = 1.5
"""Host seconds without a status (they come at 1 Hz) after which a robot is waited for."""


class WatchedTeam(TeamProcesses):
    """Processes of which none ends or hangs unnoticed."""

    def __init__(self) -> None:
        super().__init__()
        self._interval = 0
        """Simulated ns of a tick in lock-step; 0 while the team is not in lock-step."""
        self._patience = LOCKSTEP_TIMEOUT
        """Host seconds that a living process may be silent."""
        self._has_team = False
        self._restarts: set[str] = set()
        """Processes that are started again when they have failed."""
        self._participants: set[str] = set()
        """Those that are expected, then those of the newest tick that the test has let the world take."""

    def _expect(self, launch: TeamLaunch) -> None:
        """Watch this team from here on. Raises UsageError for a second one."""
        if self._has_team:
            text = "a test has one team, and this one has started: use team.restart, team.sim or a second test"
            raise UsageError(text)
        self._has_team, self._patience, self._participants = True, launch.pace.timeout, {*launch.participants}
        plan = plan_team(launch)
        self._restarts = {name for name, job in plan.jobs.items() if job.restarts}
        self.expect_end(*plan.beside)

    @property
    def sim(self) -> SimulatorClient:
        """The simulator's queries as calls: pause, resume, speed, reset, spawn, remove, move."""
        return SimulatorClient(self.bus, START_LIMIT)

    @property
    def sim_status(self) -> SimStatus:
        """The simulator's status: pace, participants, and the one that it waits for."""
        return self.sim.status()

    def _take_status(self, status: SimStatus) -> None:
        """Notice the processes that were left behind, and wait for the end of those that left.

        They are gone in the world's time; the end of their processes takes the host's.
        """
        # A router is lost only on purpose: its end is seen at once.
        for name in {*status.hung} - {ROUTER}:
            self._note_hang(name, f"lock-step left it behind, without an answer for {self._patience:g} s or cut off")
        left = self._participants.difference(status.participants, status.joining)
        self._participants = {*status.participants}
        for name in left.intersection(self._processes) - self._may_end - self._restarts:
            if not self._wait(partial(self._has_ended_or_joined, name), self._patience):
                self._note_hang(name, "it lives and has left the bus")
        self._check()

    def _has_ended_or_joined(self, name: str) -> bool:
        process, status = self._process(name), self.sim_status
        if process.exit_code is not None:
            process.join(START_LIMIT)
        return process.exit_code is not None or name in status.participants or name in status.joining

    def _note_hang(self, name: str, how: str) -> None:
        self._hangs.setdefault(name, f"{name} hangs: {how}; its last lines:\n{self._words(name)}")

    def _silent(self) -> list[str]:
        """The robots that live and whose last status is long ago."""
        now, robots = monotonic(), {i: name for name in self._present if (i := names.robot_id_of(name)) is not None}
        return [
            name
            for i, name in robots.items()
            if name not in self._may_end and self.alive(name) and 0.0 < self._view.robot(i).spoke < now - _SILENT_AFTER
        ]

    def _wait_for_silent(self) -> None:
        """Real time: wait for the next status of robots whose last one is long ago. One that sends none hangs."""
        if self._interval:
            return
        if self._in_process is not None:
            # The watch on the calls says which one hangs.
            open_now = [call.frames[0] for call in user_calls() if call.owner in self._present]
            self._wait(lambda: not any(call.frames[0] in open_now for call in user_calls()), START_LIMIT)
        elif not self._wait(lambda: not self._silent(), self._patience):
            for name in self._silent():
                self._note_hang(name, f"it gives no sign of life for {self._patience:g} s")
        self._check()

    def _take_hang(self, call: UserCall) -> bool:
        """A call of a node's own code in this process lasts too long. Before `run` it may be slow work of a start."""
        if call.owner not in self._present:
            return False
        self._hangs.setdefault(call.owner, f"{call.owner} hangs: after {self._patience:g} s {call.describe()}")
        return True

    def check_at_end(self) -> None:
        """Raise TeamFailure for a process that has ended or hangs unasked, and does not come back."""
        self._check()
        if self._bus is None or (self._in_process is None and not self._process(ROUTER).running):
            # Without its router a team sees nothing of itself.
            return
        self._wait_for_silent()
        ended = self._supervisor.ended
        gone = [n for n in self._present - self._may_end if n not in ended and not self.alive(n)]
        self._wait(lambda: all(n in ended or self.alive(n) for n in gone), START_LIMIT)
        for name in gone:
            if name in ended:
                self._process(name).join(START_LIMIT)
            elif not self.alive(name):
                raise TeamFailure(f"{name} is gone and did not come back within {START_LIMIT:g} s: {self._words(name)}")
        self._check()
