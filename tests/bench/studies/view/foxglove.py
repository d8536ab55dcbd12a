"""What a client of Foxglove's protocol costs the view: the scans of many robots, passed through."""

import json

import msgspec
from websockets.sync.client import ClientConnection, connect

from studies.view.stage import Stage, crowd, view_port
from zteam.clock import monotonic
from zteam.errors import ZteamError

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
        port = view_port(stage.supervisor, r"team at ws://127\.0\.0\.1:(\d+)")
        url = f"ws://127.0.0.1:{port}"
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
