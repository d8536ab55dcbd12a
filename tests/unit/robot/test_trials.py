"""`zteam check`: each kind of fault in a small behaviour, and what is right."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import msgspec
import pytest
from msgspec import Meta

from support.candidates import MINE, Candidate, faults_of, only_fault
from zteam.behaviors import Behavior
from zteam.errors import UsageError
from zteam.robot.behaviors.registry import BEHAVIORS
from zteam.robot.trials import check
from zteam.robot.trials.check import run_trials
from zteam.robot.trials.situations import bounds, given_params
from zteam.testing import find_faults


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty folder in which the test stands and Python finds modules. A crowded machine makes no step too slow."""
    monkeypatch.setattr(check, "TICK", 2.0)
    monkeypatch.setattr(check, "HANGS_AFTER", 30.0)
    monkeypatch.setattr(check, "SECONDS", 3.0)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    known = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - known:
        if name.startswith("mine_"):
            del sys.modules[name]


DIFFERS = "a new object answers the same views otherwise: step 1 asks for "
FAULTY = {
    "raises on nan": ("raises", "steps = int(view.scan.ranges.mean())", "step raises ValueError: cannot convert"),
    "divides by dt": ("raises", "rate = 0.01 / view.dt", "step raises ZeroDivisionError: float division by zero"),
    "takes a look-up for granted": ("raises", "pose, stamp = view.base_from_robot(0)", "step raises TypeError: "),
    "counts on 1081 beams": ("raises", "ahead = view.scan.ranges[540]", "step raises IndexError: index 540 is out"),
    "leaves the program": ("raises", "raise SystemExit(3)", "step raises SystemExit: 3"),
    "writes into the scan": ("raises", "view.scan.ranges[0] = 1.0", "step raises ValueError: assignment destination"),
    "no reason": ("type", "self.reason = None", "self.reason is None, not a text"),
    "returns nothing": ("type", "return None", "Mine.step returned None; return a Twist"),
    "nan": ("number", "return Twist(Vector3(0.1 * view.scan.ranges.mean() / 30))", "step asks for nan m/s, 0 rad/s"),
    "too fast": (
        "limit",
        "return Twist(Vector3(2.0), Vector3(z=-4.0))",
        "step asks for 2 m/s, -4 rad/s, this robot does 1 m/s, -3.14159 rad/s",
    ),
    "the turn in the wrong place": ("ignored", "return Twist(Vector3(0.1, 0.0, 0.5))", "step sets linear.z = 0.5, "),
    "goes by the host's clock": ("differs", "return Twist(Vector3(time.time() % 1.0))", DIFFERS),
    "numbers by chance": ("differs", "return Twist(angular=Vector3(z=random.uniform(-1.0, 1.0)))", DIFFERS),
    "keeps its state in the class": (
        "differs",
        "Mine.seen.append(view.now)\n        return Twist(Vector3(0.001 * len(Mine.seen)))",
        f"{DIFFERS}0.001 m/s, 0 rad/s, then for 0.013 m/s, 0 rad/s",
    ),
    "drives by old poses": (
        "old",
        "at = view.base_from_robot(0)\n        return Twist(Vector3(min(0.5, abs(at[0].x)))) if at else Twist()",
        "it drives by poses that are 3 s old: ",
    ),
    "drives by old poses, and stands at its leader without": (
        "old",
        "at, _ = view.base_from_robot(0) or (Pose2(0, 0, 0), 0)\n        return Twist(Vector3(min(0.5, abs(at.x))))",
        "it drives by poses that are 3 s old: ",
    ),
    "backs into what it never saw": ("touched", "return Twist(Vector3(-0.5))", "it drove against something for "),
}
"""By what is wrong: the fault's kind, the body of `step`, and how the text begins."""


@pytest.mark.few(6)
@pytest.mark.parametrize("what", FAULTY)
def test_a_fault_is_found(what: str, folder: Path) -> None:
    """A behaviour with one fault: that is found and nothing else, with the author's line."""
    kind, body, text = FAULTY[what]
    mine = Candidate(folder, f"{MINE}{body}\n        return Twist()\n")
    fault = only_fault(mine.try_it(in_worlds=kind == "touched"), kind)
    assert fault.text.startswith(text)
    assert fault.place == mine.place(body if kind == "raises" else "def step")


def test_what_was_touched_before_an_error_is_found(folder: Path) -> None:
    """A behaviour that backs into something and then raises does two things wrong."""
    body = "if view.now > 2e9:\n            raise ValueError\n        return Twist(Vector3(-0.5))\n"
    results = Candidate(folder, f"{MINE}{body}").try_it(in_worlds=True)
    assert {fault.kind for result in results for fault in result.faults} == {"raises", "touched"}


@pytest.mark.ci
@pytest.mark.parametrize("name", BEHAVIORS)
def test_a_shipped_behaviour_passes(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is wrong with any behaviour that comes with zteam, in more than twenty trials."""
    monkeypatch.setattr(check, "SECONDS", 5.0)
    params = {"waypoints": [[0.0, 0.0], [2.0, 0.0]]} if name == "path" else {}
    results = [*run_trials(name, BEHAVIORS[name], params)]
    assert not faults_of(results)
    assert len(results) > 20


COUNTS = """self.steps = getattr(self, "steps", 0) + 1
        return Twist(Vector3(0.0001 * self.steps), Vector3(z=view.random() - 0.5))
"""
NEAR = """near = any(abs(mate.pose.x) < 1.0 for mate in view.teammates)
        return Twist(angular=Vector3(z=0.5)) if near else Twist(Vector3(0.2))
"""


@pytest.mark.parametrize(
    "body", [COUNTS, "return Twist(Vector3(0.0 * len(view.scan.ranges)))\n", NEAR], ids=["state", "scan", "old poses"]
)
def test_what_is_right(body: str, folder: Path) -> None:
    """State in the object and chance of the view; a scan in the first step; to keep clear of where another one was."""
    assert not faults_of(Candidate(folder, f"{MINE}{body}").try_it())


BOUNDED = """
class Mine(Behavior):
    class Params(msgspec.Struct, forbid_unknown_fields=True):
        speed: Annotated[float, Meta(ge=0.0, lt=1.5)] = 0.3
        legs: Annotated[int, Meta(ge=0, le=9)] = 3

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


class Bounded(Behavior):
    """It has parameters of all kinds."""

    class Params(msgspec.Struct):
        """Its parameters."""

        closed: Annotated[float, Meta(ge=-1.0, le=20.0)] = 0.0
        opened: Annotated[float, Meta(gt=0.0, lt=20.0)] = 1.0
        whole: Annotated[int, Meta(gt=0, le=9)] = 1
        switch: bool = False
        name: Annotated[str, Meta(min_length=1)] = "x"


def test_bounds_of_numbers_and_both_values_of_switches() -> None:
    """A bound that does not belong to the allowed values is tried just inside; what has no bound is left alone."""
    tiny, large = pytest.approx(0.001), pytest.approx(19.98)
    numbers = [("closed", -1.0), ("closed", 20.0), ("opened", tiny), ("opened", large), ("whole", 1), ("whole", 9)]
    assert [*bounds(Bounded)] == [*numbers, ("switch", False), ("switch", True)]


INPUTS = """
class Mine(Behavior):
    inputs = {"statuses": ("robot_$*/status", RobotStatus), "goal": ("goal_pose", PoseStamped)}

    def missing(self, view):
        return [] if view.inputs["goal"] is None else None

    def step(self, view: View) -> Twist:
        return Twist(Vector3(0.1 * (view.inputs["goal"].pose.position.x > 1.0)))
"""


def test_declared_inputs_are_tried_with_and_without_messages(folder: Path) -> None:
    """An input that has not come is None; empty messages come in one trial."""
    mine = Candidate(folder, INPUTS)
    results = mine.try_it()
    (asked,) = [result for result in results if result.name == "empty messages on its inputs"]
    assert [(fault.text, fault.place) for fault in asked.faults] == [
        ("missing returned None, not a list of texts", mine.place("def missing"))
    ]
    assert results[0].faults[0].text.startswith("step raises AttributeError: 'NoneType' object has no attribute")


def test_an_error_of_the_constructor_is_found(folder: Path) -> None:
    """What `__init__` raises is said with its line."""
    code = f"{MINE}return Twist()\n\n    def __init__(self, params):\n        self.gain = 1 / len(self.seen)\n"
    mine = Candidate(folder, code)
    fault = only_fault(mine.try_it(), "raises")
    assert (fault.text, fault.place) == ("__init__ raises ZeroDivisionError: division by zero", mine.place("self.gain"))


def test_faults_are_lines_for_a_test(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`zteam.testing.find_faults`: each fault once, with its line and first trial. Parameters may be given."""
    monkeypatch.setattr(check, "SECONDS", 0.2)
    mine = Candidate(folder, f"{MINE}return Twist(Vector3(0.0 * len(view.scan.ranges), 0.1))\n")
    mine.load()
    (line,) = find_faults(f"{mine.module}:Mine")
    assert line.startswith(f"{mine.place('def step')}: step sets linear.y = 0.1, which moves nothing (trial: in the ")
    assert line.endswith(" more)")
    with pytest.raises(UsageError, match="speed"):
        find_faults("avoid", speed=5.0)


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [("follow", {}, {"leader": 0}), ("follow", {"leader": 2}, {"leader": 2}), ("path", {}, None)],
)
def test_the_leader_is_given_and_no_other_parameter(
    name: str, given: dict[str, Any], expected: dict[str, Any] | None
) -> None:
    """A follower is tried behind another robot of the trials. What else has no default has to be given."""
    if expected is None:
        with pytest.raises(UsageError, match="waypoints"):
            given_params(name, BEHAVIORS[name], given)
    else:
        assert given_params(name, BEHAVIORS[name], given) == expected


@pytest.mark.parametrize(
    ("tick", "wait", "steps", "is_slow"),
    [(2.0, 0.3, 1, False), (2.0, 0.3, 2, True), (2.0, 9.0, 2, False), (-1.0, 9.0, 0, True)],
    ids=["few", "many and long", "short", "works for longer than a tick"],
)
def test_the_third_slow_step_ends_the_trials(
    tick: float, wait: float, steps: int, is_slow: bool, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps that wait without working are a fault only if they are many and long. Each trial runs twice."""
    monkeypatch.setattr(check, "TICK", tick)
    monkeypatch.setattr(check, "WAIT", wait)
    body = f"self.steps = getattr(self, 'steps', 0) + 1\n        time.sleep(0.35 * (self.steps <= {steps}))\n"
    result = next(iter(run_trials("mine", Candidate(folder, f"{MINE}{body}        return Twist()\n").load(), {})))
    assert [fault.kind for fault in result.faults] == ["slow"] * is_slow


def test_a_step_that_does_not_return_ends_the_trials(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A loop without end is said with its line, and no further trial begins."""
    monkeypatch.setattr(check, "HANGS_AFTER", 0.3)
    body = "while not Mine.is_free:\n            x = 1\n        return Twist()\n"
    mine = Candidate(folder, f"{MINE}{body}".replace("seen = []", "is_free = False"))
    try:
        (result,) = mine.try_it()
        assert [fault.text for fault in result.faults] == ["step did not return within 0.3 s"]
        assert result.faults[0].place in (mine.place("while not"), mine.place("x = 1"))
    finally:
        sys.modules[mine.module].Mine.is_free = True


def test_no_step_is_under_way_after_one_that_raises(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A slow constructor of the next object is no step that does not return."""
    monkeypatch.setattr(check, "HANGS_AFTER", 0.1)
    body = "raise ValueError\n\n    def __init__(self, params):\n        time.sleep(0.4)\n"
    result = next(iter(run_trials("mine", Candidate(folder, MINE + body).load(), {})))
    assert [fault.kind for fault in result.faults] == ["raises"]
