"""What has come of the inputs that the behaviour declares. It knows no bus."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from zteam import names
from zteam.behaviors.inputs import DeclaredInput
from zteam.nodes.robot.newest import Newest


class DeclaredInputs:
    """The newest message of each declared input. The caller holds a lock."""

    def __init__(self, declared: list[DeclaredInput]) -> None:
        self.declared = declared
        self._slots: dict[str, dict[int | None, Newest]] = {}
        """By the input's name, then by robot; None where it is one key."""
        self._waiting: dict[int, tuple[Newest, Any]] = {}
        """Those in which a message has come that may not have counted yet, by `id`; and what `_view` has of each."""
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
        self._waiting.setdefault(id(found), (found, found.message))
        return found

    def view(self, now: int) -> Mapping[str, Any]:
        """What counts in a step at time `now` (ns), by the input's name."""
        if self._waiting:
            waiting = self._waiting.values()
            for newest, _ in waiting:
                newest.settle(now)
            if any(newest.message is not before for newest, before in waiting):
                self._view = self._look()
            self._waiting = {id(newest): (newest, newest.message) for newest, _ in waiting if newest.is_coming}
        return self._view

    def _look(self) -> Mapping[str, Any]:
        return MappingProxyType({declared.name: self._look_at(declared) for declared in self.declared})

    def _look_at(self, declared: DeclaredInput) -> Any:
        slots = self._slots[declared.name]
        if not declared.of_all_robots:
            return slots[None].message if slots else None
        heard = [(i, newest.message) for i, newest in slots.items() if i is not None and newest.message is not None]
        return MappingProxyType(dict(sorted(heard, key=lambda pair: pair[0])))

    def forget(self) -> None:
        """Time jumped back."""
        self._slots = {declared.name: {} for declared in self.declared}
        self._waiting = {}
        self._view = self._look()
