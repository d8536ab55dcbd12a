"""The participants of a tick and their answers. Pure: presence tokens and answers go in.

A process joins when it answers any tick. The simulator waits for it from the next tick that is opened. A process leaves
with its last presence token, or when it is dropped because it does not answer.
"""

from collections.abc import Iterable

from zteam.messages import Done
from zteam.runtime.tokens import TokenSet


class Barrier:
    """The participants of one simulator. Names are process names: `robot_1`, `tf`, …"""

    def __init__(self, expected: Iterable[str] = ()) -> None:
        self.expected = frozenset(expected)
        """The first tick is held until all of these take part."""
        self.members: list[str] = []
        """Participants of the open tick, sorted. The list is replaced, not changed: ticks that were sent hold it."""
        self.joining: set[str] = set()
        """Processes that have answered and become participants with the next tick."""
        self.answers: dict[str, Done] = {}
        """Answers to the open tick, by participant."""
        self.left: set[str] = set()
        """Participants that have ended since the tick was opened. What they answered does not count: whether their
        answer or their end comes first is chance."""
        self._gone: set[tuple[str, str]] = set()
        """Names and sessions of participants that have left with their last token."""
        self._owing: set[str] = set()
        """Participants that have not answered the open tick."""
        self._key = (0, 0)
        self._holders = TokenSet()

    def take_token(self, name: str, instance: str, alive: bool) -> None:
        """The presence token of session `instance` for `name` came (`alive`) or went."""
        self._holders.take(name, instance, alive)
        if name in self._holders:
            return
        if name in self.members:
            self.left.add(name)
            self.answers.pop(name, None)
            self._gone.add((name, instance))
        self.drop(name)

    def was_cut_off(self, name: str, session: str) -> bool:
        """Whether the token that comes is that of a participant that left: it was frozen or without a link meanwhile.

        A process that has ended comes back with another session. True once.
        """
        gone = (name, session) in self._gone
        self._gone.discard((name, session))
        return gone

    def holds(self, name: str, session: str) -> bool:
        """Whether this session holds this name."""
        return session in self._holders.instances(name)

    def name_of(self, session: str) -> str | None:
        """A name that this session holds; None if it holds none."""
        return self._holders.name_of(session)

    def take_done(self, name: str, session: str, done: Done) -> bool:
        """Take an answer. False if its session does not hold `name`: the answer is ignored."""
        if not self.holds(name, session):
            return False
        counts = (done.epoch, done.tick) == self._key
        if not (counts and name in self._owing) and name not in self.members:
            self.joining.add(name)
        elif counts:
            self.answers[name] = done
            self._owing.discard(name)
            self.left.discard(name)
        return True

    def open(self, epoch: int, tick: int, *, admit: bool = True) -> list[str]:
        """Open a tick and return its participants; `admit` lets in the processes that joined.

        A tick that is opened again keeps its answers.
        """
        if (epoch, tick) != self._key:
            self._key = (epoch, tick)
            self.answers = {}
            self.left = set()
        if admit and self.joining:
            self.members = sorted({*self.members, *self.joining})
            self.joining.clear()
        self._owing = {name for name in self.members if name not in self.answers}
        return self.members

    def missing(self) -> list[str]:
        """Participants that have not answered the open tick."""
        return [name for name in self.members if name in self._owing]

    @property
    def complete(self) -> bool:
        """Whether every participant has answered."""
        return not self._owing

    @property
    def absent(self) -> list[str]:
        """Expected processes that neither take part nor join."""
        return sorted(self.expected.difference(self.members, self.joining))

    def drop(self, name: str) -> None:
        """Stop waiting for this participant. An answer that it gave for the open tick stays."""
        self.members = [member for member in self.members if member != name]
        self._owing.discard(name)
        self.joining.discard(name)
