"""How the view runs `zteam doctor`, and what it makes of the output."""

import sys
import threading

import msgspec
import pytest

from support.limits import LIMIT
from zteam.bus import BusOptions
from zteam.view import diagnosis as diagnoses
from zteam.view.diagnosis import Diagnosis, command, read_findings


def test_the_command_joins_the_same_team() -> None:
    """Endpoint and namespace are those of the view's session; what it lacks overrides the environment."""
    words = command(BusOptions(connect="tcp/127.0.0.1:7", namespace="left"))
    assert words[-4:] == ["--json", "--connect=tcp/127.0.0.1:7", "--namespace=left", "--config="]


def test_output_that_is_none_says_why() -> None:
    """Findings are taken as they are; without them the last line of errors is the reason."""
    found = read_findings(b'[{"what": "router", "good": true}]', b"warning: slow")
    assert found.findings == [{"what": "router", "good": True}]
    assert not found.error
    assert read_findings(b"", b"one\nzteam doctor: no router\n").error == "zteam doctor: no router"
    assert "without an answer" in read_findings(b"", b"").error


def test_a_team_in_one_process_has_no_doctor() -> None:
    """No other process reaches a bus in memory: the document says so, and nothing runs."""
    diagnosis = Diagnosis(None, lambda: None)
    diagnosis.want(True)
    document = msgspec.json.decode(diagnosis.document)
    assert "one process" in document["error"]
    assert not document["running"]


def test_a_page_that_opens_it_again_begins_no_second_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """A page may open and close it as often as it likes, also after a failed run; the button always begins one."""
    runs: list[BusOptions] = []
    monkeypatch.setattr(diagnoses, "command", lambda options: runs.append(options) or [sys.executable, "-c", ""])
    done = threading.Semaphore(0)
    diagnosis = Diagnosis(BusOptions(), done.release)
    diagnosis.want(True)
    assert done.acquire(timeout=LIMIT)
    for wanted in (False, True):
        diagnosis.want(wanted)
    assert len(runs) == 1
    diagnosis.start()
    assert done.acquire(timeout=LIMIT)
    assert len(runs) == 2


def test_a_command_that_cannot_be_started_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where the system gives no more processes; the next run may be possible."""
    monkeypatch.setattr(diagnoses, "command", lambda _options: ["/none/such"])
    diagnosis = Diagnosis(BusOptions(), lambda: None)
    diagnosis.want(True)
    document = msgspec.json.decode(diagnosis.document)
    assert document["error"] == "'zteam doctor' cannot be started: No such file or directory"
    assert not document["running"]


@pytest.mark.parametrize("output", ["stdout", "stderr"])
def test_a_command_that_writes_without_end_is_ended(monkeypatch: pytest.MonkeyPatch, output: str) -> None:
    """What it writes comes from a team, which may be hostile: the view keeps none of it and says so."""
    code = f"import sys\nwhile True: sys.{output}.write('x' * 10_000)"
    monkeypatch.setattr(diagnoses, "command", lambda _options: [sys.executable, "-c", code])
    done = threading.Event()
    diagnosis = Diagnosis(BusOptions(), done.set)
    diagnosis.want(True)
    assert done.wait(LIMIT)
    document = msgspec.json.decode(diagnosis.document)
    assert "or one of more than 8388608 bytes: try 'zteam doctor' in a terminal" in document["error"]
    assert not document["running"]
