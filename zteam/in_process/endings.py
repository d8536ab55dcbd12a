"""What becomes of a node that has ended in this process: a failure, a restart, or an end that was asked for."""

from collections.abc import Callable

from zteam.in_process.member import Member
from zteam.launch.restarts import Again, Restarts, log_failure


class Endings:
    """The nodes that have ended for good."""

    def __init__(self, restarts: Restarts, on_failure: Callable[[Member], None]) -> None:
        """`on_failure(member)` is called when a node has ended for good without being asked to."""
        self._restarts = restarts
        self._on_failure = on_failure
        self._names: set[str] = set()
        self.failures: list[Member] = []
        """Nodes that ended without being asked to."""

    def __contains__(self, name: str) -> bool:
        return name in self._names

    def note_start(self, name: str) -> None:
        """The node starts, perhaps once more."""
        self._names.discard(name)
        self._restarts.note_start(name)

    def take(self, member: Member) -> None:
        """The node has ended: say so if it was not asked to, and have it started again if that is allowed."""
        failed = not member.stopping
        again = self._restarts.take_failure(member.name) if failed and member.exit_code else Again()
        if failed:
            log_failure(member.name, member.exit_code, again)
        if again.delay is not None:
            return
        self._names.add(member.name)
        if failed:
            self.failures.append(member)
            self._on_failure(member)
