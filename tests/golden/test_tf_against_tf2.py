"""The buffer and tf2 itself answer alike on random trees, if Debian's python3-tf2 can be imported."""

import importlib
import math
import random
import warnings
from typing import Any

import pytest

from support.tf2_records import agrees, stamped
from zteam.tf import Buffer, LookupException, TransformException

CASES = 400
FRAMES = 8


@pytest.fixture(scope="module")
def ros() -> dict[str, Any]:
    """The modules with tf2's buffer and its message types."""
    with warnings.catch_warnings():
        # ROS 1's own modules raise warnings on new Python versions.
        warnings.simplefilter("ignore")
        pytest.importorskip("tf2_py", reason="tf2 (Debian's python3-tf2) is not here")
        return {name: importlib.import_module(name) for name in ("tf2_py", "genpy", "geometry_msgs.msg")}


class _Twins:
    """A tf2 buffer and a zteam buffer that get the same samples and look-ups."""

    def __init__(self, ros: dict[str, Any], cache: float) -> None:
        self._genpy = ros["genpy"]
        self._message = ros["geometry_msgs.msg"].TransformStamped
        self._failure = ros["tf2_py"].TransformException
        self.theirs = ros["tf2_py"].BufferCore(self._genpy.Duration.from_sec(cache))
        self.ours = Buffer(cache)

    def time(self, stamp: int) -> Any:
        return self._genpy.Time(*divmod(stamp, 10**9))

    def put(self, parent: str, child: str, stamp: int, xf: list[float], static: bool) -> None:
        message = self._message()
        message.header.frame_id, message.child_frame_id = parent, child
        message.header.stamp = self.time(stamp)
        t, r = message.transform.translation, message.transform.rotation
        t.x, t.y, t.z, r.x, r.y, r.z, r.w = xf
        if static:
            self.theirs.set_transform_static(message, "test")
            self.ours.set_transform_static(stamped(parent, child, stamp, xf), "test")
        else:
            self.theirs.set_transform(message, "test")
            self.ours.set_transform(stamped(parent, child, stamp, xf), "test")

    def agree(self, target: str, source: str, stamp: int) -> bool:
        """Whether both give the same answer or exception; zteam may not know a frame of a refused sample."""
        recorded: list[Any]
        try:
            found = self.theirs.lookup_transform_core(target, source, self.time(stamp))
            t, r = found.transform.translation, found.transform.rotation
            recorded = [found.header.stamp.to_nsec(), t.x, t.y, t.z, r.x, r.y, r.z, r.w]
        except self._failure as failure:
            recorded = [type(failure).__name__, str(failure)]
        try:
            return agrees(recorded, self.ours.lookup_transform(target, source, stamp))
        except LookupException:
            return isinstance(recorded[0], str)
        except TransformException as error:
            return agrees(recorded, error)


def _run(twins: _Twins, seed: int, reparenting: bool) -> list[str]:
    """Give the samples and look-ups of a random tree to both, and return where they disagree."""
    pick = random.Random(seed)
    frames = [f"f{i}" for i in range(pick.randint(2, FRAMES))]
    static = {i for i in range(1, len(frames)) if pick.random() < 0.25}
    usual = [pick.randrange(max(i, 1)) for i in range(len(frames))]
    # tf2_py converts times to doubles, which are exact to the nanosecond only for small times.
    step = pick.choice([50_000_000, 10**9, 3 * 10**9])
    stamps, wrong = [10**9], []
    for tick in range(pick.randint(5, 100)):
        if pick.random() < 0.6:
            child = pick.randrange(1, len(frames))
            parent = pick.randrange(child) if reparenting and pick.random() < 0.25 else usual[child]
            stamp = 10**9 + tick * step // 2 + pick.randint(0, 10) * step + pick.choice([0, 0, pick.randint(0, step)])
            rotation = [pick.gauss(0.0, 1.0) for _ in range(4)]
            xf = [pick.uniform(-10.0, 10.0) for _ in range(3)] + [q / math.hypot(*rotation) for q in rotation]
            twins.put(frames[parent], frames[child], stamp, xf, child in static)
            stamps.append(stamp)
        else:
            near = pick.choice(stamps) + pick.choice([0, 0, 1, -1, pick.randint(-step, step)])
            question = pick.choice(frames), pick.choice(frames), pick.choice([0, max(near, 1)])
            if not twins.agree(*question):
                wrong.append(f"seed {seed}, tick {tick}: {question}")
    return wrong


def test_random_trees_answer_as_tf2(ros: dict[str, Any]) -> None:
    """With fixed parents, values agree to 1e-9, and stamps and exception classes are equal."""
    wrong = [w for seed in range(CASES) for w in _run(_Twins(ros, 10.0), seed, reparenting=False)]
    assert wrong == []


def test_random_trees_with_changing_parents_answer_as_tf2(ros: dict[str, Any]) -> None:
    """Both agree also if frames change their parents."""
    wrong = [w for seed in range(CASES) for w in _run(_Twins(ros, 10.0), seed, reparenting=True)]
    assert wrong == []
