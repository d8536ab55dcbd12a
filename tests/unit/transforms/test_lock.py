"""The buffer's lock: at whatever line a thread is interrupted, another thread sees a whole change or none."""

import sys
import threading
from collections.abc import Callable
from threading import RLock
from types import FrameType

import pytest

from support.limits import LIMIT
from support.transforms import S, stamped
from zteam.geometry import quaternion_from_rpy
from zteam.messages import Quaternion
from zteam.tf import Buffer, TransformException


class _TellingLock:
    """A re-entrant lock that calls `on_wait` before a thread has to wait for it."""

    def __init__(self) -> None:
        self._lock = RLock()
        self.on_wait: Callable[[], None] = lambda: None

    def acquire(self) -> bool:
        if not self._lock.acquire(blocking=False):
            self.on_wait()
            self._lock.acquire()
        return True

    __enter__ = acquire

    def release(self) -> None:
        self._lock.release()

    def __exit__(self, *_: object) -> None:
        self.release()


Call = Callable[[Buffer], object]


def _say(seconds: float, x: float, parent: str = "map", z: float = 0.0, roll: float = 0.0) -> Call:
    """A call that stores a sample of `base`."""
    message = stamped(parent, "base", round(seconds * S), x)
    message.transform.translation.z = z
    message.transform.rotation = Quaternion(*quaternion_from_rpy(roll, 0.0, 0.0))
    return lambda buffer: buffer.set_transform(message, "other")


def _fix(parent: str, child: str) -> Call:
    """A call that makes a frame static."""
    return lambda buffer: buffer.set_transform_static(stamped(parent, child, 0, 50.0), "other")


def _look(buffer: Buffer) -> object:
    """The tip's place in the map at 1.25 s, or the text of the look-up's exception."""
    try:
        found = buffer.lookup_transform("map", "tip", 5 * S // 4)
    except TransformException as error:
        return str(error)
    return found.transform.translation


def _filled(roll: float) -> tuple[Buffer, _TellingLock]:
    """A buffer with map → base → tip at 1, 2 and 3 s; the path is prepared, and the last sample is still raw."""
    lock = _TellingLock()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("zteam.transforms.buffer.threading.RLock", lambda: lock)
        buffer = Buffer()
    buffer.set_transform_static(stamped("base", "tip", 0, 0.5), "test")
    buffer.set_transform_static(stamped("map", "room", 0, 100.0), "test")
    for second in (1.0, 2.0):
        _say(second, second, roll=roll)(buffer)
    _look(buffer)
    _say(3.0, 3.0, roll=roll)(buffer)
    return buffer, lock


def _interrupt(outer: Call, inner: Call, line: int, roll: float) -> tuple[object, object] | None:
    """Interrupt the call `outer` at its `line`-th line in zteam by `inner` in another thread. Return both results.

    `outer` continues when `inner` has ended or waits for the lock. None if `outer` runs fewer lines than `line`.
    """
    buffer, lock = _filled(roll)
    stopped, answers, lines = threading.Event(), list[object](), 0
    lock.on_wait = stopped.set

    def run() -> None:
        try:
            answers.append(inner(buffer))
        finally:
            stopped.set()

    thread = threading.Thread(target=run, daemon=True)

    def trace(frame: FrameType, event: str, _argument: object) -> object:
        nonlocal lines
        if not frame.f_globals["__name__"].startswith("zteam.transforms"):
            return None
        lines += event == "line"
        if lines == line and thread.ident is None:
            thread.start()
            assert stopped.wait(LIMIT)
        return trace

    usual = sys.gettrace()
    sys.settrace(trace)  # type: ignore[arg-type]
    try:
        answer = outer(buffer)
    finally:
        sys.settrace(usual)
    if thread.ident is None:
        return None
    thread.join(LIMIT)
    assert answers, "the second call failed"
    return answer, answers[0]


@pytest.mark.few(12)
@pytest.mark.parametrize("roll", [0.0, 0.5], ids=["planar", "spatial"])
@pytest.mark.parametrize("order", ["the writer is interrupted", "the reader is interrupted"])
@pytest.mark.parametrize(
    "change",
    [
        pytest.param(_say(4.0, 4.0), id="newer"),
        pytest.param(_say(1.5, 50.0), id="late"),
        pytest.param(_say(12.5, 50.0), id="some too old"),
        pytest.param(_say(99.0, 50.0), id="all too old"),
        pytest.param(_say(4.0, 50.0, parent="room"), id="new parent"),
        pytest.param(_say(4.0, 50.0, z=1.0), id="raised"),
        pytest.param(_say(1.5, 50.0, roll=1.0), id="tilted"),
        pytest.param(_fix("map", "base"), id="fixed"),
        pytest.param(_fix("base", "tip"), id="leg"),
        pytest.param(lambda buffer: buffer.clear(), id="cleared"),
        pytest.param(lambda buffer: buffer.forget("base"), id="forgotten"),
    ],
)
def test_a_look_up_comes_before_a_change_or_after_it(change: Call, order: str, roll: float) -> None:
    """At whatever line one call interrupts the other, both return what they return one after the other."""
    before, after = _filled(roll)[0], _filled(roll)[0]
    seen, done = _look(before), change(before)
    assert change(after) == done
    if order == "the writer is interrupted":
        allowed = [(done, seen), (done, _look(after))]
        outer, inner = change, _look
    else:
        allowed = [(seen, done), (_look(after), done)]
        outer, inner = _look, change
    line = 1
    while (found := _interrupt(outer, inner, line, roll)) is not None:
        assert found in allowed, f"interrupted at line {line}"
        line += 1
    assert line > 5


@pytest.mark.parametrize(
    "call",
    [
        _look,
        lambda buffer: buffer.lookup_pose2("map", "tip", 0),
        lambda buffer: buffer.lookup_transform_full("map", S, "tip", 2 * S, "map"),
        lambda buffer: buffer.lookup_twist("tip", "map", 0),
        lambda buffer: buffer.can_transform("map", "tip", 0),
        lambda buffer: buffer.latest_common_time("map", "tip"),
        lambda buffer: buffer.frames(),
        _say(4.0, 4.0),
    ],
    ids=["transform", "pose", "full", "twist", "can", "common time", "frames", "set"],
)
def test_every_call_waits_for_the_lock(call: Call) -> None:
    """While a thread holds `lock`, every call of another thread waits."""
    buffer, lock = _filled(0.0)
    order: list[str] = []
    stopped = threading.Event()
    lock.on_wait = stopped.set

    def run() -> None:
        try:
            call(buffer)
            order.append("call")
        finally:
            stopped.set()

    thread = threading.Thread(target=run, daemon=True)
    with buffer.lock:
        thread.start()
        assert stopped.wait(LIMIT)
        order.append("holder")
    thread.join(LIMIT)
    assert order == ["holder", "call"]
