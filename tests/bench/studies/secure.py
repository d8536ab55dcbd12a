"""What certificates cost, a secure team beside a plain one in turns, and how soon a revoked robot is out."""

import json
import resource
import statistics
import subprocess
import tempfile
import threading
from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec

from studies.launching import launch
from zteam import names
from zteam.bus import BusOptions, connect
from zteam.bus.options import DEFAULT_TLS_ENDPOINT
from zteam.bus.transport import RawSample
from zteam.cli.tables import format_table
from zteam.clock import monotonic, pause
from zteam.errors import ZteamError
from zteam.messages import Odometry, decode
from zteam.team.launch.process import zteam_command
from zteam.team.security.access import Rights
from zteam.team.security.certificates import files_of, prepare

_LIMIT = 120.0
"""Host seconds for anything that takes a few."""
_MESSAGES = 2000
_WATCHED = 4.0
"""Host seconds after a revocation."""
_STANDS = 1e-4
"""Metres, or radians."""
_FLEET = """
[team]
world = "arena"

[[robots]]
id = 0
behavior = "wander"

[[robots]]
id = 1
behavior = "wander"
"""


class SecureFigures(msgspec.Struct):
    """Medians over the rounds: plain and secure, by what was measured."""

    plain: dict[str, float]
    secure: dict[str, float]
    revoked: list[dict[str, float]]
    """Of each round: host seconds from the start of `zteam certs revoke robot_1`."""


def measure_secure(seconds: float, rounds: int, say: Callable[[str], None]) -> SecureFigures:
    """Runs of `seconds` simulated seconds. Raises ZteamError."""
    found: dict[bool, list[dict[str, float]]] = {False: [], True: []}
    revoked = []
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for number in range(rounds):
            for secure in (False, True) if number % 2 == 0 else (True, False):
                say(f"round {number + 1} of {rounds}")
                row = _measure_run(folder, seconds, secure=secure) | _measure_messages(folder / "bench", secure=secure)
                found[secure].append(row)
            revoked.append(_measure_revocation(folder))
    plain, secured = ({key: statistics.median(row[key] for row in rows) for key in rows[0]} for rows in found.values())
    return SecureFigures(plain, secured, revoked)


def _measure_run(folder: Path, seconds: float, *, secure: bool) -> dict[str, float]:
    """`zteam up line`, in lock-step, and for a third of the time in real time."""
    more, row = (["--secure"] if secure else []), dict[str, float]()
    for paced, duration in ((["--lockstep"], seconds), ([], seconds / 3)):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = zteam_command(
            "zteam", "up", "line", "--for", f"{duration:g}", "--report", "report.json", *paced, *more
        )
        subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=_LIMIT + 2 * duration)
        after, report = resource.getrusage(resource.RUSAGE_CHILDREN), json.loads((folder / "report.json").read_text())
        if paced:
            row["start → GO, ms"] = 1e3 * report["go_after_seconds"]
            row["lock-step, × real time"] = report["real_time_factor"]
            row["user time of the run, s"] = after.ru_utime - before.ru_utime
        else:
            row["scan → command, ms"] = report["latency_ms"]["p50"]
            row["scan → command, 99 %, ms"] = report["latency_ms"]["p99"]
    return row


def _measure_messages(folder: Path, *, secure: bool) -> dict[str, float]:
    """From one session through the router to another one."""
    row = {}
    if secure:
        prepare(folder, "", {"router": Rights(links=True), "bench": Rights(links=True)}, "", ["router", "bench"])
    with launch() as processes:
        endpoint = processes.start_router(folder if secure else None)
        options = BusOptions(connect=endpoint, tls=files_of(folder, "bench") if secure else None)
        sender, receiver = (connect(options, patience=_LIMIT) for _ in range(2))
        came = threading.Semaphore(0)
        receiver.subscribe_raw("bench", lambda _: came.release())
        for size in (64, 4400):
            publisher = sender.transport.declare_publisher("bench", "", latched=False)
            times = []
            for _ in range(_MESSAGES):
                begin = monotonic()
                publisher.put(bytes(size))
                if came.acquire(timeout=_LIMIT):
                    times.append(monotonic() - begin)
            publisher.close()
            row[f"a message of {size} bytes, ms"] = 1e3 * statistics.median(times)
        sender.close()
        receiver.close()
    return row


def _measure_revocation(folder: Path) -> dict[str, float]:
    (folder / "fleet.toml").write_text(_FLEET)
    with launch() as processes:
        processes.start("up", "zteam", "up", str(folder / "fleet.toml"), "--secure", str(folder / "fleet"))
        processes.wait_for("up", "All robots GO!")
        said = [line.partition("ZTEAM_CONNECT=")[2].strip() for line in processes.lines["up"]]
        return _watch_revocation(folder, next(filter(None, said), DEFAULT_TLS_ENDPOINT))


def _watch_revocation(folder: Path, endpoint: str) -> dict[str, float]:
    heard: dict[str, float] = {}
    place: list[float] = []

    def take(sample: RawSample) -> None:
        if sample.key == names.robot_key(1, names.GROUND_TRUTH):
            pose = decode(Odometry, sample.payload).pose.pose
            new = [pose.position.x, pose.position.y, pose.orientation.z]
            if place and max(abs(a - b) for a, b in zip(place, new, strict=True)) > _STANDS:
                heard["moved"] = monotonic()
            place[:] = new
        heard[sample.key] = monotonic()

    bus = connect(BusOptions(connect=endpoint, tls=files_of(folder / "fleet", "operator")), patience=_LIMIT)
    robots = {i: names.robot_key(i, names.CMD_VEL) for i in (0, 1)}
    for key in (*robots.values(), names.robot_key(1, names.GROUND_TRUTH)):
        bus.subscribe_raw(key, take)
    deadline = monotonic() + _LIMIT
    while not {"moved", *robots.values()} <= heard.keys() and monotonic() < deadline:
        pause(0.05)
    begin = monotonic()
    _certs(folder, "revoke")
    done = monotonic()
    pause(_WATCHED)
    row = {
        "revoke has ended": done - begin,
        "its last command was heard": heard[robots[1]] - begin,
        "its wheels stand": heard["moved"] - begin,
    }
    if heard[robots[0]] < begin + _WATCHED / 2:
        raise ZteamError("the other robot did not come back")
    # For the next round.
    _certs(folder, "issue")
    bus.close()
    return row


def _certs(folder: Path, verb: str) -> None:
    command = zteam_command("zteam", "certs", verb, "robot_1", "--folder", "fleet")
    subprocess.run(command, cwd=folder, check=True, capture_output=True)


def format_secure(found: SecureFigures) -> str:
    """Two tables."""
    rows = [
        (key, f"{plain:.3g}", f"{found.secure[key]:.3g}", f"{100 * (found.secure[key] / plain - 1):+.0f} %")
        for key, plain in found.plain.items()
    ]
    revoked: Mapping[str, list[float]] = {key: [row[key] for row in found.revoked] for key in found.revoked[0]}
    later = [(key, f"{statistics.median(all_of):.2f}", f"{max(all_of):.2f}") for key, all_of in revoked.items()]
    return "\n\n".join(
        [
            format_table(("median", "plain", "secure", "more"), rows, numbers_from=1),
            format_table(("s after the start of revoke", "median", "longest"), later, numbers_from=1),
        ]
    )
