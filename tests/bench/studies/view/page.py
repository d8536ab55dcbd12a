"""A page that draws nothing: it takes frames and notes how old they are."""

import json
import threading
from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from studies.view.frames import decode_frame
from zteam.clock import monotonic, pause
from zteam.errors import ZteamError
from zteam.view.frames import SCAN


class FrameFigures(msgspec.Struct):
    """What came to one page; times in ms."""

    frames_per_s: float
    kilobytes_per_s: float
    age_p50: float | None
    """Of the newest poses when the page has taken the frame."""
    age_p95: float | None
    age_max: float | None
    gap_max: float
    """Longest time between two frames."""
    scans: int
    """Different lasers that were seen."""


class Page(threading.Thread):
    """Takes frames for `seconds` on a thread of its own; `pause` seconds a frame make it a slow one."""

    def __init__(self, port: int, token: str, seconds: float, *, beams: int = 360, delay: float = 0.0) -> None:
        super().__init__(name="page", daemon=True)
        self._port, self._token, self._seconds, self._beams, self._delay = port, token, seconds, beams, delay
        self._error: Exception | None = None
        self._ages: list[float] = []
        self._times: list[float] = []
        self._bytes = 0
        self._scans: set[int] = set()
        self._over = threading.Event()

    def run(self) -> None:
        """Take frames until the time is over."""
        try:
            self._take_frames()
        except (OSError, ConnectionClosed, TimeoutError, ValueError) as error:
            if not self._over.is_set():
                self._error = error

    def _take_frames(self) -> None:
        with connect(f"ws://127.0.0.1:{self._port}/ws", compression=None, max_size=None) as socket:
            self._say(socket, op="hello", version=1, token=self._token)
            self._say(socket, op="look", layers=["scans"], beams=self._beams)
            begin = monotonic()
            while monotonic() - begin < self._seconds and not self._over.is_set():
                message = socket.recv(timeout=5.0)
                if isinstance(message, str):
                    continue
                came = monotonic()
                if self._delay:
                    pause(self._delay)
                frame, blocks = decode_frame(message)
                self._scans |= {owner for kind, _, owner, _ in blocks if kind == SCAN}
                self._times.append(monotonic())
                self._bytes += len(message)
                if frame.age >= 0.0:
                    self._ages.append(frame.age + monotonic() - came)
                self._say(socket, op="ack", frame=frame.number)

    @staticmethod
    def _say(socket: Any, **message: Any) -> None:
        socket.send(json.dumps(message))

    def stop(self) -> None:
        """Take no more frames."""
        self._over.set()

    def figures(self) -> FrameFigures:
        """What came, when it has ended. The first second is left out. Raises ZteamError if it failed."""
        self.join(self._seconds + 10.0)
        if self._error is not None or len(self._times) < 3:
            raise ZteamError(f"a page got {len(self._times)} frames: {self._error or 'the view sends none'}")
        span = self._times[-1] - self._times[0]
        first = len([time for time in self._times if time < self._times[0] + 1.0])
        settled = self._ages[min(first, len(self._ages) // 4) :]
        return FrameFigures(
            frames_per_s=(len(self._times) - 1) / span,
            kilobytes_per_s=self._bytes / 1e3 / span,
            age_p50=percentile(settled, 50.0),
            age_p95=percentile(settled, 95.0),
            age_max=percentile(settled, 100.0),
            gap_max=1e3 * float(np.diff(self._times).max()),
            scans=len(self._scans),
        )


def percentile(seconds: Sequence[float], share: float) -> float | None:
    """A percentile of times, in ms; None of none."""
    return 1e3 * float(np.percentile(seconds, share)) if seconds else None
