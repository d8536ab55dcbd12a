"""Which robots are alive in real time, by their presence tokens."""

from zteam import names
from zteam.runtime.process_node import ProcessNode
from zteam.runtime.tokens import TokenSet


class AliveRobots:
    """Watches the tokens from the first question on: in lock-step, each token would wake every robot for nothing."""

    def __init__(self, node: ProcessNode) -> None:
        self._node = node
        self._holders = TokenSet()
        self._watches = False
        self._ids: tuple[int, ...] = ()

    def ids(self) -> tuple[int, ...]:
        """The robots that are alive, ascending, as far as known (under `node.changed`)."""
        if not self._watches:
            self._watches = True
            self._node.watch_tokens(names.tokens_key(names.ALL_ROBOTS), self._on_token)
        return self._ids

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is not None and self._holders.take(*token, alive):
            found = (names.robot_id_of(name) for name in self._holders)
            self._ids = tuple(sorted(robot_id for robot_id in found if robot_id is not None))
