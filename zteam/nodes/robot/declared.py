"""What has come of the inputs that the behaviour declares. It knows no bus."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from zteam import names
from zteam.behaviors.inputs import DeclaredInput
from zteam.nodes.robot.newest import Newest


class _Waiting(NamedTuple):
    """Where a message has come that may not have counted yet."""

    newest: Newest
    before: Any
    """What the view has of it."""
    name: str
    """Of the input."""
    robot_id: int | None
    """None where the input is one key."""


class DeclaredInputs:
    """The newest message of each declared input. The caller holds a lock."""

    def __init__(self, declared: list[DeclaredInput]) -> None:
        self.declared = declared
        self._slots: dict[str, dict[int | None, Newest]] = {}
        """By the input's name, then by robot; None where it is one key."""
        self._waiting: dict[int, _Waiting] = {}
        """By the `id` of the slot."""
        self._view: Mapping[str, Any] = {}
        """What counts; it is replaced, not changed: a behaviour may look at it meanwhile."""
        self.forget()
        self.nothing = self._view
        """The view when nothing counts."""

    def slot(self, declared: DeclaredInput, key: str) -> Newest:
        """Where a message of this input goes that has come on `key`, and is looked at in the next step."""
        target = names.split_robot_key(key) if declared.of_all_robots else None
        slots = self._slots[declared.name]
        robot_id = None if target is None else target[0]
        found = slots.get(robot_id)
        if found is None:
            found = slots[robot_id] = Newest()
        if id(found) not in self._waiting:
            self._waiting[id(found)] = _Waiting(found, found.message, declared.name, robot_id)
        return found

    def view(self, now: int) -> Mapping[str, Any]:
        """What counts in a step at time `now` (ns), by the input's name."""
        if self._waiting:
            changed: dict[str, dict[int | None, Any]] = {}
            waiting, self._waiting = self._waiting, {}
            for number, (newest, before, name, robot_id) in waiting.items():
                newest.settle(now)
                if newest.message is not before:
                    changed.setdefault(name, {})[robot_id] = newest.message
                if newest.is_coming:
                    self._waiting[number] = _Waiting(newest, newest.message, name, robot_id)
            if changed:
                self._view = MappingProxyType(
                    {**self._view, **{name: self._merge(name, changed[name]) for name in changed}}
                )
        return self._view

    def _merge(self, name: str, changed: Mapping[int | None, Any]) -> Any:
        """What the view has of an input, with these messages that count now, by robot."""
        if None in changed:
            return changed[None]
        before = self._view[name]
        merged = {**before, **changed}
        # Where each of them was heard before, the order is still that of the ids.
        return MappingProxyType(merged if len(merged) == len(before) else dict(sorted(merged.items())))

    def forget(self) -> None:
        """Time jumped back."""
        self._slots = {declared.name: {} for declared in self.declared}
        self._waiting = {}
        self._view = MappingProxyType(
            {declared.name: MappingProxyType({}) if declared.of_all_robots else None for declared in self.declared}
        )
