"""Which processes hold their names, as their presence tokens tell."""

from collections.abc import Iterator


class TokenSet:
    """Instances (sessions) alive, by process name. Pure: fed with presence tokens; the caller holds a lock."""

    def __init__(self) -> None:
        self._instances: dict[str, set[str]] = {}

    def take(self, name: str, instance: str, alive: bool) -> bool:
        """A token came or went; True if with it the name got its first holder or lost its last one.

        A token that comes twice changes nothing, nor does the loss of an unknown one.
        """
        held = self._instances.get(name)
        if alive:
            if held is not None:
                held.add(instance)
                return False
            self._instances[name] = {instance}
            return True
        if held is None:
            return False
        held.discard(instance)
        if held:
            return False
        del self._instances[name]
        return True

    def __contains__(self, name: object) -> bool:
        """Whether a process holds this name."""
        return name in self._instances

    def __iter__(self) -> Iterator[str]:
        """The names that are held."""
        return iter(self._instances)

    def __len__(self) -> int:
        """How many names are held."""
        return len(self._instances)

    def instances(self, name: str) -> frozenset[str]:
        """The sessions that hold this name."""
        return frozenset(self._instances.get(name, ()))

    def name_of(self, instance: str) -> str | None:
        """A name that this session holds; None if it holds none."""
        return next((name for name, held in self._instances.items() if instance in held), None)
