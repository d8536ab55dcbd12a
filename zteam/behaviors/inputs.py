"""The further inputs that a behaviour declares: by name, which messages of which keys its view holds."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from zteam import names
from zteam.errors import UsageError
from zteam.messages import Message

_EXAMPLE = 'inputs = {"goal": ("goal_pose", PoseStamped)}'


class DeclaredInput(NamedTuple):
    """One input of one robot's behaviour."""

    name: str
    """In `view.inputs`."""
    key: str
    """A key, or the wildcard for a topic of every robot."""
    type: type[Message]

    @property
    def of_all_robots(self) -> bool:
        """Whether the view holds a message of each robot."""
        return names.is_wildcard(self.key)


def declared_inputs(inputs: Mapping[str, tuple[str, type[Message]]], robot_id: int) -> list[DeclaredInput]:
    """What robot `robot_id` listens to for a behaviour that declares these."""
    return [DeclaredInput(name, names.input_key(robot_id, topic), kind) for name, (topic, kind) in inputs.items()]


def check_inputs(inputs: Any) -> None:
    """Raise UsageError that names the first mistake in what a behaviour declares."""
    if not isinstance(inputs, Mapping):
        raise UsageError(f"inputs is {inputs!r}, not a dict such as {_EXAMPLE}")
    for name, declared in inputs.items():
        if not (isinstance(name, str) and isinstance(declared, tuple) and len(declared) == 2):
            raise UsageError(f"inputs: {name!r}: {declared!r} is no topic with its type: {_EXAMPLE}")
        try:
            _check_input(*declared)
        except UsageError as error:
            raise UsageError(f"inputs: {name!r}: {error}") from None


def _check_input(topic: Any, kind: Any) -> None:
    # Imported here, because most behaviours declare nothing.
    from zteam.bus.bus import check_message_type
    from zteam.bus.topics import type_of_key
    from zteam.bus.transport import problem_of

    if not isinstance(topic, str) or not topic:
        raise UsageError(f"{topic!r} is no topic, such as 'goal_pose'")
    key = names.input_key(0, topic)
    single = names.keys_in(key, [0])
    if not single:
        raise UsageError(f"{topic!r} stands for many keys: take one topic, of every robot as 'robot_$*/status'")
    if problem := problem_of(key):
        raise UsageError(f"{topic!r} is no topic: {problem}")
    check_message_type(topic, kind)
    carried = type_of_key(single[0])
    if carried not in (None, kind):
        raise UsageError(f"{topic} carries {carried.__name__}, not {kind.__name__}")
