"""When the view examines its team, and what a page gets of it."""

import threading
from typing import Any

import msgspec
import pytest

from support.limits import LIMIT
from zteam.bus import BusOptions
from zteam.errors import BusError
from zteam.monitor.doctor.facts import Finding, ok
from zteam.view import queries
from zteam.view.queries import Diagnosis


class Doctor:
    """Counts its runs; `fault` is what it raises."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.runs: list[BusOptions] = []
        self.fault: Exception | None = None
        self._done = threading.Semaphore(0)
        monkeypatch.setattr(queries, "examine", self._examine)
        self.diagnosis = Diagnosis(BusOptions(namespace="left"), self._done.release)

    def _examine(self, options: BusOptions, **_: Any) -> list[Finding]:
        self.runs.append(options)
        if self.fault is not None:
            raise self.fault
        return [ok("router", "there")]

    def wait(self) -> Any:
        """The document that a page gets when the run is over."""
        assert self._done.acquire(timeout=LIMIT)
        return msgspec.json.decode(self.diagnosis.document)


@pytest.fixture
def doctor(monkeypatch: pytest.MonkeyPatch) -> Doctor:
    """One that finds no problem."""
    return Doctor(monkeypatch)


def test_a_page_that_opens_it_again_begins_no_second_run(doctor: Doctor) -> None:
    """A page may open and close it as often as it likes; the button always begins a run."""
    doctor.diagnosis.want(True)
    found = doctor.wait()
    assert found["findings"] == [{"what": "router", "good": True, "text": "there", "next_step": "", "level": "ok"}]
    assert found["time"] > 0.0
    assert not found["running"]
    for wanted in (False, True):
        doctor.diagnosis.want(wanted)
    assert len(doctor.runs) == 1
    doctor.diagnosis.start()
    doctor.wait()
    assert [options.namespace for options in doctor.runs] == ["left", "left"]


@pytest.mark.parametrize(
    ("fault", "text"),
    [(BusError("no router"), "no router: try 'zteam doctor' in a terminal"), (KeyError("x"), "failed: KeyError('x')")],
)
def test_a_run_that_fails_says_why(doctor: Doctor, fault: Exception, text: str) -> None:
    """Also where the data of a hostile team were too much for a check: the view goes on."""
    doctor.fault = fault
    doctor.diagnosis.want(True)
    found = doctor.wait()
    assert found["error"].endswith(text)
    assert not found["running"]


def test_a_team_in_one_process_has_no_doctor() -> None:
    """No other session reaches a bus in memory: the document says so, and nothing runs."""
    diagnosis = Diagnosis(None, lambda: None)
    diagnosis.want(True)
    document = msgspec.json.decode(diagnosis.document)
    assert "one process" in document["error"]
    assert not document["running"]
