"""A job of the lasers on two threads. Each takes the next scans, one from the front, the other from the back.

The bits of a scan are the same on either thread. The helping thread stays inside one compiled function, so it needs no
lock of the interpreter. If it comes late, or is missing in a forked child, the caller does all parts.
"""

import ctypes
import os
import sys
import threading
import weakref

import numpy as np
from numpy.typing import NDArray

from zteam.sim.casting import Job, cast_part
from zteam.sim.jit import SIMULATOR, External, unlocked

_GO, _LEFT, _DONE = 0, 1, 2
"""Semaphores: there is work; the parts that no thread has taken; the parts that the helper has finished."""
_END, _CLOSING = 0, 1
"""Places in the state: where the parts that are left end; whether the helper is to end."""
_ALONE, _BEGIN, _FIRST, _HELPER = 0, 1, 2, 3
"""What a thread does: the whole job; it lets the helper begin; it finishes the job with the helper; it helps."""
_ROOM = 64
"""Bytes for a semaphore."""
_SPIN = 3000
"""Times that the caller asks for a part before it sleeps: that takes as long as a part."""
_PARTS = 10
"""Parts of a job, or fewer: more of them begin more often, fewer leave one thread waiting for the other."""
WORTH = 10_000
"""Rays from which on a second thread is worth its wake-up: 4000 take as long with it, 20 000 a third less."""

Semaphores = NDArray[np.uintp]
State = NDArray[np.int64]

_sem_wait = External("sem_wait")
_sem_trywait = External("sem_trywait")
_sem_post = External("sem_post")


@unlocked
def cast_parts(semaphores: Semaphores, state: State, job: Job, role: int) -> None:
    """Do a job alone; or let a helper begin; or finish it from the front; or help from the back when one begins."""
    scans = job.ranges.shape[0]
    if role == _ALONE:
        cast_part(job, 0, scans)
        return
    size = (scans + _PARTS - 1) // _PARTS
    parts = (scans + size - 1) // size
    if role == _BEGIN:
        state[_END] = scans
        for _ in range(parts):
            _sem_post(semaphores[_LEFT])
        _sem_post(semaphores[_GO])
        return
    if role == _HELPER:
        while state[_CLOSING] == 0:
            # A signal to the process may end a wait early.
            if _sem_wait(semaphores[_GO]) != 0:
                continue
            while _sem_trywait(semaphores[_LEFT]) == 0:
                begin = (state[_END] - 1) // size * size
                cast_part(job, begin, state[_END])
                state[_END] = begin
                _sem_post(semaphores[_DONE])
        return
    mine = 0
    while _sem_trywait(semaphores[_LEFT]) == 0:
        cast_part(job, mine * size, min(scans, (mine + 1) * size))
        mine += 1
    for _ in range(parts - mine):
        spins = 0
        while _sem_trywait(semaphores[_DONE]) != 0:
            spins += 1
            if spins > _SPIN and _sem_wait(semaphores[_DONE]) == 0:
                break


class CastPair:
    """Casts one job again and again, with a helping thread where there is a processor for it.

    The thread ends when this object is gone.
    """

    def __init__(self, job: Job) -> None:
        self._memory = ctypes.create_string_buffer(3 * _ROOM)
        semaphores = ctypes.addressof(self._memory) + _ROOM * np.arange(3, dtype=np.uintp)
        self._state = np.array([0, 0])
        self._arguments = semaphores, self._state, job
        self._helped = False
        """Whether there is a helping thread."""
        self._begun = False

    def begin(self) -> None:
        """Let the helping thread, if there is one, begin with what the job's arrays hold now. `finish` follows."""
        if self._helped and not self._begun:
            cast_parts(*self._arguments, _BEGIN)
            self._begun = True

    def finish(self) -> None:
        """Have the job done. If it was not begun, it is done for what its arrays hold now."""
        compiled = bool(SIMULATOR.choice)
        if not self._begun and compiled:
            self.begin()
        cast_parts(*self._arguments, _FIRST if self._begun else _ALONE)
        self._begun = False
        # After the first call, which loads the kernel or compiles it: the thread only runs it.
        if compiled and not self._helped and _can_help():
            self._start()

    def _start(self) -> None:
        system = ctypes.CDLL(None)
        go, *others = (ctypes.c_void_p(int(address)) for address in self._arguments[0])
        for semaphore in (go, *others):
            system.sem_init(semaphore, 0, 0)
        # The thread holds all memory that it uses, and not this object. The process ends without it.
        threading.Thread(target=_run, args=(self._memory, *self._arguments), name="lasers", daemon=True).start()
        weakref.finalize(self, _end, system, self._memory, self._state, go).atexit = False
        self._helped = True


def _can_help() -> bool:
    return sys.platform == "linux" and len(os.sched_getaffinity(0)) > 1


def _run(_memory: object, semaphores: Semaphores, state: State, job: Job) -> None:
    cast_parts(semaphores, state, job, _HELPER)


def _end(system: ctypes.CDLL, _memory: object, state: State, go: ctypes.c_void_p) -> None:
    state[_CLOSING] = 1
    system.sem_post(go)
