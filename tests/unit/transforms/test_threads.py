"""Waiting look-ups, and several threads on one buffer."""

import random
import threading
from collections.abc import Callable

import pytest

from support.limits import LIMIT
from support.transforms import S, stamped
from zteam.clock import wait_until
from zteam.messages import ns_from_time
from zteam.tf import (
    Buffer,
    ExtrapolationException,
    LookupException,
    NoDataForExtrapolationException,
)


def test_a_look_up_can_wait() -> None:
    """A waiting look-up answers as soon as the sample is stored, and raises its own exception on time-out."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "test")
    answers = []
    waiting = threading.Thread(target=lambda: answers.append(buffer.wait_for_transform("map", "base", 2 * S, LIMIT)))
    waiting.start()
    buffer.set_transform(stamped("map", "base", 2 * S, 7.0), "test")
    waiting.join(LIMIT)
    assert answers[0].transform.translation.x == 7.0
    with pytest.raises(ExtrapolationException):
        buffer.wait_for_transform("map", "base", 9 * S, 0.01)


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

    monkeypatch.setattr("zteam.transforms.buffer.wait_until", announce)

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


def test_threads_may_store_and_look_up_at_once() -> None:
    """A look-up in one thread is right while other threads store samples."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S, float(S)), "test")
    done = threading.Event()

    def store() -> None:
        for i in range(1, 3000):
            buffer.set_transform(stamped("map", "base", S + i, float(S + i)), "test")
        done.set()

    writer = threading.Thread(target=store)
    writer.start()
    while not done.is_set():
        transform = buffer.lookup_transform("map", "base", 0)
        assert transform.transform.translation.x == float(ns_from_time(transform.header.stamp))
    writer.join(LIMIT)


@pytest.mark.ci
def test_many_threads_see_one_tree() -> None:
    """With writers, late samples, a changing parent and readers at once, every answer is right or a tf2 exception.

    The x of every sample is its stamp, so x in a look-up's answer is its time multiplied by the number of moving edges.
    """
    buffer = Buffer(cache_time=1.0)
    ms = S // 1000
    buffer.set_transform_static(stamped("map", "room", 0), "test")
    for name, parent in (("base", "map"), ("arm", "base")):
        buffer.set_transform(stamped(parent, name, S, 1000.0), name)
    failures: list[str] = []
    answered = [0, 0]
    done = threading.Event()

    def write(name: str, parents: tuple[str, ...], seed: int) -> None:
        stamps = list(range(1001, 3000))
        shuffle = random.Random(seed)
        for i in range(0, len(stamps), 4):
            block = stamps[i : i + 4]
            shuffle.shuffle(block)
            for stamp in block:
                parent = parents[(stamp // 50) % len(parents)]
                refused = buffer.set_transform(stamped(parent, name, stamp * ms, float(stamp)), name)
                if refused is not None:
                    failures.append(refused.text)

    def read(index: int) -> None:
        pick = random.Random(index)
        while not done.is_set() or answered[index] < 100:
            newest = buffer.frames()["arm"].newest
            time = pick.choice([0, newest - pick.randrange(200) * ms])
            try:
                found = buffer.lookup_transform("base", "arm", time)
                whole = buffer.lookup_transform("room", "arm", ns_from_time(found.header.stamp))
            except ExtrapolationException:
                continue
            answered[index] += 1
            stamp = ns_from_time(found.header.stamp) / ms
            if abs(found.transform.translation.x - stamp) > 1e-6:
                failures.append(f"base → arm at {stamp}: {found.transform.translation.x}")
            # Across a change of parent the older sample holds; its neighbour is at most four stamps away.
            if not 2 * stamp - 5 <= whole.transform.translation.x <= 2 * stamp + 1e-6:
                failures.append(f"room → arm at {stamp}: {whole.transform.translation.x}")

    writers = [
        threading.Thread(target=write, args=("base", ("map", "room"), 1)),
        threading.Thread(target=write, args=("arm", ("base",), 2)),
    ]
    readers = [threading.Thread(target=read, args=(index,)) for index in (0, 1)]
    for thread in writers + readers:
        thread.start()
    for thread in writers:
        thread.join(LIMIT)
    done.set()
    for thread in readers:
        thread.join(LIMIT)
    assert not any(thread.is_alive() for thread in writers + readers)
    assert failures == []
    assert buffer.frames()["arm"].newest == 2999 * ms
