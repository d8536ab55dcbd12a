"""Each kind of fault, found in a small behaviour."""

from pathlib import Path

import pytest

from support.candidates import MINE, Candidate, only_fault

FAULTY = {
    "raises on nan": (
        "raises",
        "steps = int(view.scan.ranges.mean())\n        return Twist(Vector3(0.1 * (steps > 1)))",
        "steps = int(",
        "step raises ValueError: cannot convert float NaN to integer",
    ),
    "divides by dt": (
        "raises",
        "rate = 0.01 / view.dt\n        return Twist(Vector3(min(1.0, rate)))",
        "rate = 0.01",
        "step raises ZeroDivisionError: float division by zero",
    ),
    "takes a look-up for granted": (
        "raises",
        "pose, stamp = view.base_from_robot(0)\n        return Twist()",
        "pose, stamp",
        "step raises TypeError: cannot unpack non-iterable NoneType object",
    ),
    "counts on 1081 beams": (
        "raises",
        "ahead = view.scan.ranges[540]\n        return Twist()",
        "ahead =",
        "step raises IndexError: index 540 is out of bounds for axis 0 with size 1",
    ),
    "leaves the program": ("raises", "raise SystemExit(3)", "raise SystemExit", "step raises SystemExit: 3"),
    "writes into the scan": (
        "raises",
        "view.scan.ranges[0] = 1.0\n        return Twist()",
        "view.scan.ranges[0]",
        "step raises ValueError: assignment destination is read-only",
    ),
    "writes into the view": (
        "raises",
        "view.dt = 1.0\n        return Twist()",
        "view.dt",
        "step raises AttributeError: immutable type: 'View'",
    ),
    "returns nothing": ("type", "Twist(Vector3(0.1))", "def step", "Mine.step returned None; return a Twist"),
    "returns a text": (
        "type",
        'return Twist(Vector3("fast"))',
        "def step",
        "Mine.step returned the speed 'fast'; give numbers, m/s and rad/s",
    ),
    "lacks nothing to say": (
        "type",
        "return Twist()\n\n    def missing(self, view: View):\n        pass",
        "def missing",
        "missing returned None",
    ),
    "no reason": ("type", "self.reason = None\n        return Twist()", "def step", "self.reason is None"),
    "nan": (
        "number",
        "return Twist(Vector3(0.1 * view.scan.ranges.mean() / 30))",
        "def step",
        "step asks for nan m/s, 0 rad/s",
    ),
    "too fast": (
        "limit",
        "return Twist(Vector3(2.0), Vector3(z=-4.0))",
        "def step",
        "step asks for 2 m/s, -4 rad/s, this robot does 1 m/s, -3.14159 rad/s",
    ),
    "the turn in the wrong place": (
        "ignored",
        "return Twist(Vector3(0.1, 0.0, 0.5))",
        "def step",
        "step sets linear.z = 0.5, which moves nothing",
    ),
    "changes a message": (
        "changed",
        "view.odom.pose.pose.position.x += 1.0\n        return Twist()",
        "def step",
        "step changed view.odom",
    ),
    "changes the scan": (
        "changed",
        "view.scan.ranges = view.scan.ranges * 0.5\n        return Twist()",
        "def step",
        "step changed view.scan",
    ),
    "goes by the host's clock": (
        "differs",
        "return Twist(Vector3(time.time() % 1.0))",
        "def step",
        "a new object answers the same views otherwise: step 1 asks for",
    ),
    "numbers by chance": (
        "differs",
        "return Twist(angular=Vector3(z=random.uniform(-1.0, 1.0)))",
        "def step",
        "a new object answers the same views otherwise: step 1 asks for",
    ),
    "numbers by numpy's chance": (
        "differs",
        "return Twist(angular=Vector3(z=np.random.uniform(-1.0, 1.0)))",
        "def step",
        "a new object answers the same views otherwise: step 1 asks for",
    ),
    "keeps its state in the class": (
        "differs",
        "Mine.seen.append(view.now)\n        return Twist(Vector3(0.001 * len(Mine.seen)))",
        "def step",
        "a new object answers the same views otherwise: step 1 asks for 0.001 m/s, 0 rad/s, then for 0.013 m/s",
    ),
    "keeps its state in the module": (
        "differs",
        "global count\n        count += 1\n        return Twist(Vector3(0.0001 * count))",
        "def step",
        "a new object answers the same views otherwise: step 1 asks for 0.0001 m/s",
    ),
    "drives by old poses": (
        "old",
        "at = view.base_from_robot(0)\n        return Twist(Vector3(min(0.5, abs(at[0].x)))) if at else Twist()",
        "def step",
        "it drives by poses that are 3 s old",
    ),
    "drives by old poses, and stands at its leader without": (
        "old",
        "at, _ = view.base_from_robot(0) or (Pose2(0, 0, 0), 0)\n        return Twist(Vector3(min(0.5, abs(at.x))))",
        "def step",
        "it drives by poses that are 3 s old",
    ),
    "backs into what it never saw": (
        "touched",
        "return Twist(Vector3(-0.5))",
        "def step",
        "it drove against something for",
    ),
}
"""By what is wrong: the fault's kind, the body of `step`, the line that is named, and how the text begins."""


@pytest.mark.few(5)
@pytest.mark.parametrize("what", FAULTY)
def test_a_fault_is_found(what: str, folder: Path) -> None:
    """A behaviour with one fault: that is found and nothing else, with the student's line and in these words."""
    kind, body, line, text = FAULTY[what]
    mine = Candidate(folder, f"count = 0\n\n\n{MINE}{body}\n")
    fault = only_fault(mine.try_it(in_worlds=kind == "touched"), kind)
    assert fault.text.startswith(text)
    assert fault.place == mine.place(line)


@pytest.mark.few(1)
def test_what_was_touched_before_an_error_is_found(folder: Path) -> None:
    """A behaviour that backs into something and then raises does two things wrong."""
    body = "if view.now > 5e9:\n            raise ValueError\n        return Twist(Vector3(-0.5))\n"
    results = Candidate(folder, f"{MINE}{body}").try_it(in_worlds=True)
    assert {fault.kind for result in results for fault in result.faults} == {"raises", "touched"}
