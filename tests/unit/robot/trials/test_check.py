"""`run_trials`: what shipped behaviours and the pages' pass, and what is right and wrong besides `test_faults`."""

import importlib
from pathlib import Path
from typing import Any

import pytest

from support.candidates import MINE, Candidate, faults_of, only_fault
from zteam.errors import UsageError
from zteam.robot.behaviors.registry import BEHAVIORS
from zteam.robot.trials import check
from zteam.robot.trials.check import run_trials
from zteam.testing import find_faults

GIVEN: dict[str, dict[str, Any]] = {"path": {"waypoints": [[0.0, 0.0], [2.0, 0.0]]}}
"""Parameters that a shipped behaviour cannot do without, by its name."""


@pytest.mark.ci
@pytest.mark.parametrize("name", BEHAVIORS)
def test_a_shipped_behaviour_passes(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is wrong with any behaviour that comes with zteam, in more than twenty trials."""
    monkeypatch.setattr(check, "SECONDS", 5.0)
    results = [*run_trials(name, BEHAVIORS[name], GIVEN.get(name, {}))]
    assert not faults_of(results)
    assert len(results) > 20


def test_state_kept_in_the_object_is_right(folder: Path) -> None:
    """A behaviour that counts its steps in `self` and takes chance from its view repeats, so nothing is wrong."""
    code = """
class Mine(Behavior):
    def __init__(self, params):
        super().__init__(params)
        self.steps = 0

    def step(self, view: View) -> Twist:
        self.steps += 1
        return Twist(Vector3(0.0001 * self.steps), Vector3(z=view.random() - 0.5))
"""
    assert not faults_of(Candidate(folder, code).try_it())


def test_a_step_before_the_first_scan_is_not_tried(folder: Path) -> None:
    """A robot waits for its first scan, so a step that takes one for granted is right."""
    assert not faults_of(Candidate(folder, f"{MINE}return Twist(Vector3(0.0 * len(view.scan.ranges)))\n").try_it())


BOUNDED = """
class Mine(Behavior):
    class Params(msgspec.Struct, forbid_unknown_fields=True):
        speed: Annotated[float, Meta(ge=0.0, lt=1.5)] = 0.3
        legs: Annotated[int, Meta(ge=0, le=9)] = 3
        backwards: bool = False

    def on_params(self):
        self.leg = 1.0 / self.params.legs

    def step(self, view: View) -> Twist:
        return Twist(Vector3(self.params.speed))
"""


def test_parameters_are_tried_at_their_bounds(folder: Path) -> None:
    """A bound above what the robot does, and one that on_params cannot take, are both named with their values."""
    faults = faults_of(Candidate(folder, BOUNDED).try_it())
    assert [*faults] == ["parameters at their bounds"]
    assert [fault.text for fault in faults["parameters at their bounds"]] == [
        "step asks for 1.4985 m/s, 0 rad/s, this robot does 1 m/s, 0 rad/s, with speed = 1.4985",
        "on_params raises ZeroDivisionError: float division by zero, with legs = 0",
    ]


INPUTS = """
class Mine(Behavior):
    inputs = {"goal": ("goal_pose", PoseStamped)}

    def step(self, view: View) -> Twist:
        goal = view.inputs["goal"]
        return Twist(Vector3(0.1 * (goal.pose.position.x > 1.0)))
"""


def test_an_input_that_has_not_come_is_tried(folder: Path) -> None:
    """A behaviour that takes its declared input for granted fails where no message has come, and only there."""
    results = Candidate(folder, INPUTS).try_it()
    names = {result.name for result in results if result.faults}
    assert "in the middle of a room" in names
    assert "empty messages on its inputs" not in names
    assert only_fault(results, "raises").text.startswith(
        "step raises AttributeError: 'NoneType' object has no attribute"
    )


HEARERS = """
class Mine(Behavior):
    inputs = {"statuses": ("robot_$*/status", RobotStatus)}

    def step(self, view: View) -> Twist:
        for status in view.inputs["statuses"].values():
            status.reason = "seen"
        return Twist()
"""


def test_a_changed_message_of_all_robots_is_found(folder: Path) -> None:
    """The messages of a topic of every robot belong to others too, and come only where messages come."""
    results = Candidate(folder, HEARERS).try_it()
    assert only_fault(results, "changed").text == 'step changed view.inputs["statuses"]'
    assert [result.name for result in results if result.faults] == ["empty messages on its inputs"]


def test_an_error_of_the_constructor_is_found(folder: Path) -> None:
    """What `__init__` raises is said with its line."""
    code = f"{MINE}return Twist()\n\n    def __init__(self, params):\n        self.gain = 1 / len(self.seen)\n"
    mine = Candidate(folder, code)
    fault = only_fault(mine.try_it(), "raises")
    assert fault.text == "__init__ raises ZeroDivisionError: division by zero"
    assert fault.place == mine.place("self.gain")


@pytest.mark.ci
def test_faults_are_told_as_texts_for_a_test(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`zteam.testing.find_faults`: each fault once, with line and first trial."""
    monkeypatch.setattr(check, "SECONDS", 0.5)
    mine = Candidate(folder, f"{MINE}return Twist(Vector3(0.0 * len(view.scan.ranges), 0.1))\n")
    importlib.invalidate_caches()
    place = mine.place("def step")
    assert find_faults(f"{mine.module}:Mine") == [
        f"step sets linear.y = 0.1, which moves nothing ({place}; in the middle of a room)"
    ]
    assert find_faults("avoid", speed=0.5) == []
    with pytest.raises(UsageError, match="speed"):
        find_faults("avoid", speed=5.0)


def test_a_parameter_that_is_missing_is_asked_for(folder: Path) -> None:
    """A behaviour that cannot do without a parameter is not tried without it; the leader is given."""
    with pytest.raises(UsageError, match=r"behaviour path needs waypoints: give --param waypoints=VALUE"):
        next(run_trials("path", BEHAVIORS["path"], {}))
    with pytest.raises(UsageError, match=r"behaviour path: waypoints"):
        next(run_trials("path", BEHAVIORS["path"], {"waypoints": 3}))


@pytest.mark.parametrize(
    "body",
    [
        """near = any(abs(mate.pose.x) < 1.0 for mate in view.teammates)
        return Twist(angular=Vector3(z=0.5)) if near else Twist(Vector3(0.2))
""",
        "return Twist(Vector3(0.2 * bool(view.teammates)))\n",
    ],
    ids=["drives without poses too", "drives in the same way whatever they are"],
)
def test_to_keep_clear_of_an_old_pose_is_right(body: str, folder: Path) -> None:
    """A behaviour that turns where another robot was 3 s ago, or waits for others, is careful, not wrong."""
    assert not faults_of(Candidate(folder, f"{MINE}{body}").try_it())
