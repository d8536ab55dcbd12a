"""The inputs of a user's own node that `step` waits for in lock-step, and which of them have come. Without a bus."""

from collections.abc import Callable, Iterable
from typing import Any

from zteam import names
from zteam.bus.keys import matches
from zteam.errors import UsageError
from zteam.messages import Message, TFMessage, Tick, ns_from_time
from zteam.tf.bases import bases_stamp


def stamp_of_tick(message: Any) -> int:
    """The stamp (ns) of a message with a header, or of the bases in one of `tf`: in lock-step that of its tick."""
    return bases_stamp(message) if isinstance(message, TFMessage) else ns_from_time(message.header.stamp)


class TickInputs:
    """The keys that are declared with `every_tick`, and what else a node needs of each tick."""

    def __init__(self, robots: Callable[[], Iterable[int]]) -> None:
        """`robots()` are the ids in the world at the newest tick."""
        self._robots = robots
        self._keys: list[str] = []
        self._needs: list[Callable[[Tick], list[str]]] = []
        self._stamps: dict[str, int] = {}
        """Of the newest message, by key."""

    def declare(self, key_expr: str, message_type: type[Message]) -> None:
        """Each tick needs a message of this key. Raises UsageError for a type whose tick cannot be told."""
        if "header" not in message_type.__struct_fields__ and message_type is not TFMessage:
            raise UsageError(f"{key_expr}: {message_type.__name__} has no header, so its tick cannot be told")
        self._keys.append(key_expr)
        self.need(lambda tick: self._not_come(key_expr, tick))

    def need(self, lacks: Callable[[Tick], list[str]]) -> None:
        """Each tick needs what `lacks(tick)` names."""
        self._needs.append(lacks)

    def take(self, key: str, message: Any) -> int:
        """A message has come; its stamp in ns."""
        stamp = self._stamps[key] = stamp_of_tick(message)
        return stamp

    def forget(self) -> None:
        """Time jumped back."""
        self._stamps.clear()

    def lacking(self, tick: Tick) -> list[str]:
        """The keys whose message of the tick has not come."""
        return [key for lacks in self._needs for key in lacks(tick)]

    def never_came(self) -> list[str]:
        """The declared keys on which nothing has come."""
        return [key for key in self._keys if not any(matches(key, heard) for heard in self._stamps)]

    def _not_come(self, key_expr: str, tick: Tick) -> list[str]:
        """The key, or that key of each robot, whose message of the tick has not come."""
        if key_expr == names.TF and names.AGGREGATOR not in tick.participants:
            # Nothing sends the transforms of this tick.
            return []
        keys = [key_expr]
        if key_expr.startswith(names.all_robots_key("")):
            keys = [names.robot_key(robot_id, key_expr.partition("/")[2]) for robot_id in self._robots()]
        stamp = ns_from_time(tick.stamp)
        return [key for key in keys if self._stamps.get(key, -1) < stamp]
