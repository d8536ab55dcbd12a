"""Lock-step without a bus: who takes part, and who has not answered the tick yet.

The simulator feeds it with presence tokens and answers. A process joins by answering any tick and is waited for from
the next tick that is opened; it leaves with its last token, or when it is dropped as hung.
"""

from collections.abc import Iterable

from zteam.messages import Done


class Barrier:
    """The participants of one simulator. Names are process names: `robot_1`, `tf`, …"""

    def __init__(self, expected: Iterable[str] = ()) -> None:
        self.expected = frozenset(expected)
        """Without these the first tick is held."""
        self.members: list[str] = []
        """Participants of the open tick, sorted."""
        self.joining: set[str] = set()
        """They answered, and will be participants of the next tick."""
        self.answers: dict[str, Done] = {}
        """By participant, for the open tick."""
        self._key = (0, 0)
        self._instances: dict[str, set[str]] = {}

    def take_token(self, name: str, instance: str, alive: bool) -> None:
        """A process took or lost its name."""
        instances = self._instances.setdefault(name, set())
        if alive:
            instances.add(instance)
            return
        instances.discard(instance)
        if not instances:
            del self._instances[name]
            self.drop(name)

    def is_alive(self, name: str) -> bool:
        """Whether a process holds this name."""
        return name in self._instances

    def take_done(self, name: str, done: Done) -> bool:
        """An answer; False if it is nobody's: a participant has to hold its name by a token."""
        if name not in self._instances:
            return False
        if name not in self.members:
            self.joining.add(name)
        elif (done.epoch, done.tick) == self._key:
            self.answers[name] = done
        return True

    def open(self, epoch: int, tick: int, *, admit: bool = True) -> list[str]:
        """Open a tick, with all who joined; opened again, it keeps the answers it has. Its participants."""
        if (epoch, tick) != self._key:
            self._key = (epoch, tick)
            self.answers = {}
        if admit:
            self.members = sorted({*self.members, *self.joining})
            self.joining.clear()
        return self.members

    def missing(self) -> list[str]:
        """Participants that have not answered the open tick."""
        return [name for name in self.members if name not in self.answers]

    @property
    def complete(self) -> bool:
        """Whether everybody has answered."""
        return len(self.answers) >= len(self.members) and not self.missing()

    @property
    def absent(self) -> list[str]:
        """Expected, and neither a participant nor about to become one."""
        return sorted(self.expected.difference(self.members, self.joining))

    def drop(self, name: str) -> None:
        """Do not wait for this one any more; an answer that it gave for the open tick stays."""
        self.members = [member for member in self.members if member != name]
        self.joining.discard(name)
