"""What has come of the inputs that the behaviour declares. It knows no bus."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from zteam import names
from zteam.behaviors.behavior import DeclaredInput
from zteam.nodes.robot.newest import Newest


class _Slot:
    """The newest message of one key."""

    __slots__ = ("before", "name", "newest", "robot_id", "waits")

    def __init__(self, name: str, robot_id: int | None) -> None:
        self.name = name
        """Of the input."""
        self.robot_id = robot_id
        """None where the input is one key."""
        self.newest = Newest()
        self.before: Any = None
        """What the view has of it."""
        self.waits = False
        """Whether a message has come that may not have counted yet."""


class DeclaredInputs:
    """The newest message of each declared input. The caller holds a lock."""

    def __init__(self, declared: list[DeclaredInput]) -> None:
        self.declared = declared
        self._slots: dict[tuple[str, str], _Slot] = {}
        """By the input's name and the key."""
        self._waiting: list[_Slot] = []
        self._view: Mapping[str, Any] = {}
        """What counts; it is replaced, not changed: a behaviour may look at it meanwhile."""
        self.forget()
        self.nothing = self._view
        """The view when nothing counts."""

    def slot(self, declared: DeclaredInput, key: str) -> Newest:
        """Where a message of this input goes that has come on `key`, and is looked at in the next step."""
        found = self._slots.get((declared.name, key))
        if found is None:
            target = names.split_robot_key(key) if declared.of_all_robots else None
            found = self._slots[declared.name, key] = _Slot(declared.name, None if target is None else target[0])
        if not found.waits:
            found.waits = True
            self._waiting.append(found)
        return found.newest

    def view(self, now: int) -> Mapping[str, Any]:
        """What counts in a step at time `now` (ns), by the input's name."""
        if self._waiting:
            changed: dict[str, dict[int | None, Any]] = {}
            for slot in self._waiting:
                slot.newest.settle(now)
                if slot.newest.message is not slot.before:
                    slot.before = changed.setdefault(slot.name, {})[slot.robot_id] = slot.newest.message
                slot.waits = slot.newest.is_coming
            self._waiting = [slot for slot in self._waiting if slot.waits]
            if changed:
                merged = {name: self._merge(name, news) for name, news in changed.items()}
                self._view = MappingProxyType({**self._view, **merged})
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
        self._slots = {}
        self._waiting = []
        self._view = MappingProxyType(
            {declared.name: MappingProxyType({}) if declared.of_all_robots else None for declared in self.declared}
        )
