"""Clients that draw nothing: a page that notes how old its frames are, and one of Foxglove's protocol."""

import json
import threading
from typing import Any

import msgspec
import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from studies.view.frames import decode_frame
from studies.view.stage import Stage, crowd
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

    def __init__(self, port: int, token: str, seconds: float, *, delay: float = 0.0) -> None:
        super().__init__(name="page", daemon=True)
        self._port, self._token, self._seconds, self._delay = port, token, seconds, delay
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
            self._say(socket, op="look", layers=["scans"], beams=360)
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
    def _say(socket: ClientConnection, **message: Any) -> None:
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
        ages = 1e3 * np.percentile(settled, (50, 95, 100)) if settled else (None, None, None)
        return FrameFigures(
            frames_per_s=(len(self._times) - 1) / span,
            kilobytes_per_s=self._bytes / 1e3 / span,
            age_p50=ages[0],
            age_p95=ages[1],
            age_max=ages[2],
            gap_max=1e3 * float(np.diff(self._times).max()),
            scans=len(self._scans),
        )


ROBOTS, BEAMS = 20, 1081
PATIENCE = 30.0
"""Host seconds for the topics to be there."""


class FoxgloveFigures(msgspec.Struct):
    """One client that takes all scans of 20 robots."""

    messages_per_s: float
    kilobytes_per_s: float
    cores: float
    """Processor time of the view a second."""
    idle_cores: float
    """The same without a subscription."""
    rss_mb: float


def measure_foxglove(seconds: float) -> FoxgloveFigures:
    """Take all scans for so many host seconds, after as many with a client that looks at nothing."""
    with crowd(ROBOTS, BEAMS, "--foxglove", "--foxglove-port", "0") as stage:
        url = stage.processes.wait_for("view", r"team at (ws://127\.0\.0\.1:\d+)")[1]
        with connect(url, subprotocols=["foxglove.sdk.v1"], compression=None, max_size=None) as socket:  # type: ignore[list-item]
            channels = _find_scans(socket)
            idle_cores, _, _ = _take(socket, stage, seconds)
            wanted = [{"id": channel, "channelId": channel} for channel in channels]
            socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            # The first scan: the subscriptions are open.
            socket.recv(timeout=PATIENCE)
            cores, messages, size = _take(socket, stage, seconds)
        rss_mb = stage.view_usage().rss_mb
        return FoxgloveFigures(messages / seconds, size / seconds / 1e3, cores, idle_cores, round(rss_mb, 1))


def _find_scans(socket: ClientConnection) -> list[int]:
    found: dict[str, int] = {}
    end = monotonic() + PATIENCE
    while len(found) < ROBOTS and monotonic() < end:
        said = socket.recv(timeout=PATIENCE)
        if isinstance(said, str):
            channels = json.loads(said).get("channels", [])
            found.update({each["topic"]: each["id"] for each in channels if each["topic"].endswith("/base_scan")})
    if len(found) < ROBOTS:
        raise ZteamError(f"{len(found)} of {ROBOTS} scans are there")
    return list(found.values())


def _take(socket: ClientConnection, stage: Stage, seconds: float) -> tuple[float, int, int]:
    """Take messages: processor time of the view a second, scans, bytes."""
    before, messages, size = stage.view_usage().cpu_seconds, 0, 0
    start = monotonic()
    while (left := start + seconds - monotonic()) > 0.0:
        try:
            message = socket.recv(timeout=left)
        except TimeoutError:
            break
        # The others tell the time.
        if isinstance(message, bytes) and message[0] == 1:
            messages, size = messages + 1, size + len(message)
    return (stage.view_usage().cpu_seconds - before) / (monotonic() - start), messages, size
