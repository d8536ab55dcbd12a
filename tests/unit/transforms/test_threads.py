"""Waiting look-ups, and several threads on one buffer."""

import threading
from collections.abc import Callable
from threading import RLock

import pytest

from support.limits import LIMIT
from support.transforms import S, stamped
from zteam.clock import wait_until
from zteam.tf import Buffer, LookupException, NoDataForExtrapolationException


def test_every_waiter_is_woken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of several waiting look-ups ends when its own data is stored, static data included."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "slow", S), "test")
    answers: dict[str, float] = {}
    asleep = threading.Semaphore(0)

    def announce(condition: threading.Condition, ready: Callable[[], bool], timeout: float) -> bool:
        # The caller holds the lock until it sleeps.
        asleep.release()
        return wait_until(condition, ready, timeout)

    monkeypatch.setattr("zteam.clock.wait_until", announce)

    def wait(frame: str) -> None:
        found = buffer.wait_for_transform("map", frame, 0, 1000.0)
        answers[frame] = found.transform.translation.x

    threads = [threading.Thread(target=wait, args=(name,), daemon=True) for name in ("a", "b", "c")]
    for thread in threads:
        thread.start()
        assert asleep.acquire(timeout=LIMIT)
    buffer.set_transform_static(stamped("map", "a", 0, 1.0), "test")
    buffer.set_transform(stamped("map", "b", S, 2.0), "test")
    buffer.set_all_static([stamped("map", "c", 0, 3.0)], "other")
    for thread in threads:
        thread.join(LIMIT)
    assert answers == {"a": 1.0, "b": 2.0, "c": 3.0}


def test_a_wait_in_vain_ends_with_its_own_reason() -> None:
    """On time-out, the look-up's own exception is raised, not a TimeoutException."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "test")
    with pytest.raises(LookupException):
        buffer.wait_for_transform("map", "nowhere", 0, 0.01)
    with pytest.raises(NoDataForExtrapolationException):
        buffer.wait_for_transform("map", "base", 2 * S, 0.01)


class TellingLock:
    """A re-entrant lock that sets `waits` before a thread has to wait for it."""

    def __init__(self) -> None:
        self._lock = RLock()
        self.waits = threading.Event()

    def __enter__(self) -> None:
        if not self._lock.acquire(blocking=False):
            self.waits.set()
            self._lock.acquire()

    acquire = __enter__

    def release(self, *_: object) -> None:
        self._lock.release()

    __exit__ = release

    def _is_owned(self) -> bool:
        return True


@pytest.mark.parametrize(
    "call",
    [
        lambda buffer: buffer.lookup_transform("map", "base", 0),
        lambda buffer: buffer.lookup_pose2("map", "base", 0),
        lambda buffer: buffer.lookup_transform_full("map", S, "base", 2 * S, "map"),
        lambda buffer: buffer.lookup_twist("base", "map", 0),
        lambda buffer: buffer.can_transform("map", "base", 0),
        lambda buffer: buffer.latest_common_time("map", "base"),
        lambda buffer: buffer.frames(),
        lambda buffer: buffer.frame("base"),
        lambda buffer: buffer.chain("base"),
        lambda buffer: buffer.forget("base"),
        lambda buffer: buffer.clear(),
        lambda buffer: buffer.set_all_static([], "test"),
        lambda buffer: buffer.set_transform_static(stamped("map", "a", 0), "test"),
        lambda buffer: buffer.set_transform(stamped("map", "base", 3 * S), "test"),
    ],
)
def test_every_call_waits_for_the_lock(call: Callable[[Buffer], object], monkeypatch: pytest.MonkeyPatch) -> None:
    """While a thread holds `lock`, the calls of others wait: a look-up sees a whole change or none."""
    lock = TellingLock()
    monkeypatch.setattr("zteam.transforms.buffer.threading.RLock", lambda: lock)
    buffer = Buffer()
    for stamp in (S, 2 * S):
        buffer.set_transform(stamped("map", "base", stamp), "test")
    thread = threading.Thread(target=call, args=(buffer,), daemon=True)
    with buffer.lock:
        thread.start()
        assert lock.waits.wait(LIMIT)
    thread.join(LIMIT)
    assert not thread.is_alive()
