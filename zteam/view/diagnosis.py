"""What `zteam doctor` finds, for the pages that show it."""

import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import IO, Any

import msgspec

from zteam.bus import BusOptions
from zteam.bus.queries import decode_json
from zteam.clock import monotonic, wall_ns
from zteam.errors import DecodeError

LIMIT = 60.0
"""Host seconds for one run; about five are usual."""
MAX_OUTPUT = 1 << 23
"""Bytes of its findings, and of its errors."""
FRESH = 30.0
"""Host seconds after which a page that opens it begins another run; its button does so at any time."""


class Examination(msgspec.Struct):
    """The document `doctor`."""

    running: bool = False
    """Whether it is being made anew."""
    time: float = 0.0
    """When it was made, seconds since the Unix epoch; 0: not yet."""
    findings: list[dict[str, Any]] = []
    """As `zteam doctor --json` prints them."""
    error: str = ""
    """Why there are none."""


class Diagnosis:
    """Runs the command, one at a time, as a process of its own: it listens to all keys of the team, and pages must not
    wait for it. Threads may make calls at the same time."""

    def __init__(self, options: BusOptions | None, on_news: Callable[[], None]) -> None:
        """`options` is how to reach the team; None for a bus in memory, which no other process can join."""
        self._options, self._on_news = options, on_news
        self._lock = threading.Lock()
        self._child: subprocess.Popen[bytes] | None = None
        self._wanted = self._closed = False
        self._found = Examination()
        self._begun = float("-inf")
        """Host time of the newest run."""

    @property
    def document(self) -> bytes:
        """`doctor`."""
        return msgspec.json.encode(self._found)

    def want(self, wanted: bool) -> None:
        """Whether some page shows it: it is made when the first one begins to, unless it is fresh."""
        before, self._wanted = self._wanted, wanted
        if wanted and not before and monotonic() - self._begun > FRESH:
            self.start()

    def start(self) -> None:
        """Make it anew, unless that goes on already."""
        with self._lock:
            if self._child is not None or self._closed:
                return
            if self._options is None:
                self._found = Examination(error="the team is in one process, which no other one can look at")
                return
            self._begun = monotonic()
            try:
                self._child = subprocess.Popen(
                    command(self._options), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE
                )
            except OSError as error:
                self._found = Examination(error=f"'zteam doctor' cannot be started: {error.strerror or error}")
                return
            self._found = msgspec.structs.replace(self._found, running=True)
            threading.Thread(target=self._finish, args=(self._child,), name="doctor", daemon=True).start()

    def _finish(self, child: subprocess.Popen[bytes]) -> None:
        # Host time: the command looks at a team whose simulated time may stand still.
        limit = threading.Timer(LIMIT, child.kill)  # noqa: TID251
        limit.start()
        with ThreadPoolExecutor(2) as readers, child:
            output, errors = readers.map(partial(_read, child), (child.stdout, child.stderr))
        limit.cancel()
        if child.returncode < 0:
            hint = "try 'zteam doctor' in a terminal"
            found = Examination(error=f"no answer within {LIMIT:g} s, or one of more than {MAX_OUTPUT} bytes: {hint}")
        else:
            found = read_findings(output, errors)
        with self._lock:
            self._child, self._found = None, found
        self._on_news()

    def close(self) -> None:
        """End what runs."""
        with self._lock:
            self._closed = True
            if self._child is not None:
                self._child.kill()


def _read(child: subprocess.Popen[bytes], stream: IO[bytes] | None) -> bytes:
    """What the child writes to one of its outputs; more than MAX_OUTPUT bytes end it."""
    assert stream is not None
    output = stream.read(MAX_OUTPUT + 1)
    if len(output) > MAX_OUTPUT:
        child.kill()
    return output


def command(options: BusOptions) -> list[str]:
    """The command line that looks at the team of a session with these options. Certificates are in the environment."""
    words = [f"{name}={value}" for name, value in options.words.items()]
    return [sys.executable, "-P", "-m", "zteam", "doctor", "--json", *words]


def read_findings(output: bytes, errors: bytes) -> Examination:
    """What the command printed; without findings its last line of errors says why."""
    try:
        return Examination(time=wall_ns() / 1e9, findings=decode_json(output, list[dict[str, Any]]))
    except DecodeError:
        lines = errors.decode(errors="replace").strip().splitlines()
        return Examination(error=f"{lines[-1]:.1000}" if lines else "'zteam doctor' ended without an answer")
