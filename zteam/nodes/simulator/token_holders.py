"""Which processes hold which names. Pure: the bus's threads tell it of every presence token."""


class TokenHolders:
    """The session ids of the processes that hold each name, such as `robot_1`."""

    def __init__(self) -> None:
        self._instances: dict[str, set[str]] = {}

    def take(self, name: str, instance: str, alive: bool) -> None:
        """The presence token of session `instance` for `name` came (`alive`) or went."""
        if alive:
            self._instances.setdefault(name, set()).add(instance)
            return
        instances = self._instances.get(name, set())
        instances.discard(instance)
        if not instances:
            self._instances.pop(name, None)

    def __contains__(self, name: str) -> bool:
        """Whether a process holds `name`. During a restart the old and the new process may both hold it."""
        return name in self._instances

    def instances(self, name: str) -> frozenset[str]:
        """The session ids of the processes that hold `name`."""
        return frozenset(self._instances.get(name, ()))

    def names(self) -> list[str]:
        """Every name that is held, sorted."""
        return sorted(self._instances)
