"""Many runs of a study: some processes at a time, results in a file, and what they say together."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, closing
from pathlib import Path
from subprocess import DEVNULL, PIPE
from typing import BinaryIO

import msgspec

from studies.study.agreement import disagreements
from studies.study.one_run import Outcome, Row, Task
from zteam.errors import UsageError
from zteam.team.launch.process import exit_text

Key = bytes
"""A task as JSON."""
COMMAND = [sys.executable, "-P", "-m", "studies.study.one_run"]


class Bounds(msgspec.Struct, frozen=True):
    """What all runs of a case must keep to; None: not judged."""

    contacts: int | None = None
    """In all runs together, at most."""
    held: float | None = None
    """Of each follower in each run, at least."""
    still: float | None = None
    """Seconds, at most."""
    share: float | None = None
    """Of the head's way, mean of the runs, at least."""


class CaseFigures(msgspec.Struct):
    """All runs of a case."""

    what: str
    seconds: float
    runs: list[Row]
    errors: int
    contacts: int
    held: float | None
    """Of the worst follower in the worst run."""
    still: float
    share: float | None
    """Mean of the runs that went to their end."""
    missed: list[str]
    """What was missed, and in which run; empty if all is well."""
    lockstep: list[Row] = []
    """Of runs in real time: the same in lock-step."""


def read_results(path: Path) -> dict[Key, Row]:
    """The rows of a file by their tasks; a last line that was cut off is no row. Raises UsageError for another file."""
    found = {}
    for number, line in enumerate(path.read_bytes().split(b"\n")[:-1] if path.exists() else (), 1):
        try:
            row = msgspec.json.decode(line, type=Row)
        except msgspec.DecodeError as error:
            raise UsageError(f"--results {path}: line {number} is no result of a study: {error}") from None
        found[_key(row.task)] = row
    return found


def run_study(
    tasks: Sequence[Task],
    results: Path | None,
    jobs: int | None = None,
    progress: Callable[[Task | None, int, int], None] = lambda task, done, total: None,
) -> list[Row]:
    """Run the tasks that `results` does not have yet, `jobs` at a time (None: one a core); the rows of all of them.

    Each row is written as soon as it is there. `progress(task, done, total)` is called after each run, and with None
    at first. Raises UsageError for a file of another kind, OSError if it cannot be read or written.
    """
    known = read_results(results) if results is not None else {}
    due = [task for task in tasks if _key(task) not in known]
    done = len(tasks) - len(due)
    progress(None, done, len(tasks))
    with ExitStack() as stack:
        file = stack.enter_context(_open_to_append(results)) if results is not None and due else None
        for row in stack.enter_context(closing(_run_all(due, jobs or os.cpu_count() or 1))):
            known[_key(row.task)], done = row, done + 1
            if file is not None:
                file.write(msgspec.json.encode(row) + b"\n")
            progress(row.task, done, len(tasks))
    return [known[_key(task)] for task in tasks]


def _key(task: Task) -> Key:
    return msgspec.json.encode(task)


def _open_to_append(path: Path) -> BinaryIO:
    """Behind the last whole line; each write reaches the file at once."""
    file = path.open("ab", buffering=0)
    file.truncate(path.read_bytes().rfind(b"\n") + 1)
    return file


def _run_all(tasks: Sequence[Task], jobs: int) -> Generator[Row, None, None]:
    """Rows in the order in which they come; what still runs is ended when the iterator is closed."""
    children: set[subprocess.Popen[bytes]] = set()
    lock, is_over = threading.Lock(), threading.Event()

    def run(task: Task) -> Row:
        with lock:
            if is_over.is_set():
                return Row(task, Outcome(error="stopped"))
            # In a session of its own: Ctrl+C in the terminal is for this process.
            child = subprocess.Popen(COMMAND, stdin=PIPE, stdout=PIPE, stderr=DEVNULL, start_new_session=True)
            children.add(child)
        # It ends with this process: its input stays open until it has answered.
        with child:
            assert child.stdin is not None and child.stdout is not None
            child.stdin.write(msgspec.json.encode(task) + b"\n")
            child.stdin.flush()
            out = child.stdout.read()
        with lock:
            children.remove(child)
        if child.returncode == 0:
            return Row(task, msgspec.json.decode(out, type=Outcome))
        return Row(task, Outcome(error=exit_text(child.returncode)))

    with ThreadPoolExecutor(jobs) as pool:
        futures = [pool.submit(run, task) for task in tasks]
        try:
            for future in as_completed(futures):
                yield future.result()
        finally:
            with lock:
                is_over.set()
                for child in children:
                    child.terminate()


def summarize(rows: Sequence[Row], bounds: Bounds, lockstep: Sequence[Row] = ()) -> CaseFigures:
    """The figures of the runs of one case, at least one, and what of the bounds they miss.

    `lockstep` are the same runs in lock-step, beside which runs in real time are judged.
    """
    good = [row for row in rows if not row.outcome.error]
    held = [(share, f"robot {i}, seed {row.task.seed}") for row in good for i, share in row.outcome.held.items()]
    stands = [(row.outcome.still, f"seed {row.task.seed}") for row in good]
    shares = [row.outcome.share for row in good if row.outcome.share is not None]
    contacts = sum(row.outcome.contacts for row in good)
    worst, longest = min(held, default=None), max(stands, default=(0.0, ""))
    share = round(sum(shares) / len(shares), 3) if shares else None
    missed = [f"seed {row.task.seed}: {row.outcome.error}" for row in (*lockstep, *rows) if row.outcome.error]
    if bounds.contacts is not None and contacts > bounds.contacts:
        seeds = ", ".join(str(row.task.seed) for row in good if row.outcome.contacts)
        missed.append(f"contacts {contacts}, at most {bounds.contacts}: seed {seeds}")
    if bounds.held is not None and worst is not None and worst[0] < bounds.held:
        missed.append(f"held {worst[0]:g}, at least {bounds.held:g}: {worst[1]}")
    if bounds.still is not None and longest[0] > bounds.still:
        missed.append(f"still {longest[0]:g} s, at most {bounds.still:g}: {longest[1]}")
    if bounds.share is not None and share is not None and share < bounds.share:
        missed.append(f"share {share:g} in the mean, at least {bounds.share:g}")
    first, beside = rows[0].task, [row.outcome for row in lockstep if not row.outcome.error]
    if good and beside:
        missed += disagreements(first.what, [row.outcome for row in good], beside)
    return CaseFigures(
        first.what, first.seconds, list(rows), len(rows) - len(good), contacts, worst[0] if worst else None, longest[0],
        share, missed, list(lockstep),
    )  # fmt: skip
