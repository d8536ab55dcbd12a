"""Why shipped behaviours stand: always in words of their own, wherever they are."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest

from zteam.behaviors import Behavior, SafetyLayer, View, decide
from zteam.messages import Twist
from zteam.robot.behaviors.behavior import ask
from zteam.robot.behaviors.registry import BEHAVIORS, load_behavior
from zteam.robot.trials.check import PLACES, drive
from zteam.robot.trials.situations import LEADER, POSES, SITUATIONS, empty_messages, make_views, steady

_AT_ITS_PLACE = {**POSES, LEADER: (0.55, 0.0, 0.0)}
"""The leader stands so near before it that it has nothing to do."""
_NEEDED: Mapping[str, Mapping[str, Any]] = {
    "follow": {"leader": LEADER},
    "formation": {"leader": LEADER},
    "path": {"waypoints": [[0.0, 0.0], [1.0, 0.0]]},
}
_FURTHER = [
    ("forward", {"speed": 0.0}),
    ("avoid", {"speed": 0.0}),
    ("wander", {"speed": 0.0}),
    ("go_to", {"speed": 0.0}),
    ("follow", {"leader": LEADER, "law": "direct"}),
    ("follow", {"leader": LEADER, "max_linear": 0.0}),
    ("follow", {"leader": LEADER, "gap": 2.5}),
    ("formation", {"leader": LEADER, "max_linear": 0.0}),
    ("formation", {"leader": LEADER, "shape": "line", "spacing": 0.5}),
    ("path", {"waypoints": [[0.0, 0.0], [0.01, 0.0]], "loop": True}),
    ("path", {"waypoints": [[0.0, 0.0], [1.0, 0.0]], "speed": 0.0}),
]
_CASES = [*((name, dict(_NEEDED.get(name, {}))) for name in BEHAVIORS), *_FURTHER]


def _views(kind: type[Behavior]) -> Iterator[tuple[str, Iterator[View]]]:
    places = {"at its place": steady(poses=_AT_ITS_PLACE), "a narrow room": steady(np.full(1081, 0.35))}
    for name, situation in {**SITUATIONS, **places}.items():
        yield name, make_views(situation, empty_messages(kind.inputs))
    yield "with messages", make_views(steady(), empty_messages(kind.inputs, (LEADER, 2)))


class _Asked:
    """A behaviour in awkward views and in small worlds: how often it stands, and what it says then."""

    def __init__(self, name: str, params: dict[str, Any]) -> None:
        self._name, self._params = name, params
        self.told: list[tuple[str, str]] = []
        """Where it stood, and the word."""
        self.steps = 0

    def _begin(self, where: str) -> None:
        self._where, self._behavior = where, load_behavior(self._name, self._params)

    def step(self, view: View) -> tuple[Twist, str]:
        """The velocity that it wants, and its reason."""
        return self._note(*ask(self._behavior, view))

    def _note(self, command: Twist, reason: str) -> tuple[Twist, str]:
        self.steps += 1
        if not command.linear.x and not command.angular.z:
            self.told.append((self._where, reason or self._behavior.why_it_rests()))
        return command, reason

    def run(self) -> None:
        """Step it everywhere."""
        for where, views in _views(BEHAVIORS[self._name]):
            self._begin(where)
            layer = SafetyLayer()
            for view in views:
                self._note(*decide(self._behavior, view, layer))
        for where, place in PLACES.items():
            self._begin(where)
            drive(self.step, place, empty_messages(self._behavior.inputs), [])


@pytest.mark.few(1)
@pytest.mark.parametrize(("name", "params"), _CASES, ids=lambda value: value if isinstance(value, str) else None)
def test_a_shipped_behavior_says_why_it_stands(name: str, params: dict[str, Any]) -> None:
    """In every view and world a command of zero comes with a reason or with a word on why it rests."""
    asked = _Asked(name, params)
    asked.run()
    assert asked.steps > 500
    assert not [where for where, told in asked.told if not told or not _is_sane(told)], asked.told


def _is_sane(text: str) -> bool:
    """Whether a reason names no number that is none, and no robot that does not exist."""
    return "nan" not in text and "inf" not in text and "robot_-" not in text


def test_a_follower_says_which_robot_is_how_near() -> None:
    """By both laws, at its place and before it."""
    for law, said in (("trail", "waits: robot_0 is 0.6 m away"), ("direct", "waits: robot_0 is 0.6 m away")):
        behavior = load_behavior("follow", {"leader": LEADER, "law": law})
        for view in make_views(steady(poses={**POSES, LEADER: (0.59, 0.0, 0.0)}), empty_messages(behavior.inputs)):
            command, reason = decide(behavior, view)
        assert (command.linear.x, command.angular.z, reason) == (0.0, 0.0, "")
        assert behavior.why_it_rests() == said


def test_a_step_of_a_users_own_has_no_word_of_the_class_above() -> None:
    """What a shipped behaviour says of its own step need not be true of a subclass's; its other base hears of it."""
    heard: list[type] = []

    class Listed:
        def __init_subclass__(cls) -> None:
            heard.append(cls)

    class Own(BEHAVIORS["forward"], Listed):  # type: ignore[misc]
        def step(self, view: View) -> Twist:
            return Twist()

    assert (Own(Own.Params(speed=0.0)).why_it_rests(), heard) == ("", [Own])


def test_a_wander_that_follows_does_not_say_its_own_speed() -> None:
    """As the last of a line it drives at the speed of that line."""
    behavior = load_behavior("wander", {"speed": 0.0})
    assert behavior.why_it_rests() == "its parameter speed is 0"
    behavior.follows = 3
    assert behavior.why_it_rests() == "waits: robot_3 is 0.0 m away"
