"""How `zteam doctor` prints its findings, and what it says of routers and certificates."""

import os
from contextlib import closing
from pathlib import Path

import pytest

from zteam.bus import BusOptions
from zteam.bus.options import RouterOptions
from zteam.bus.router import Router
from zteam.cli.doctor import format_findings
from zteam.monitor.doctor import examination
from zteam.monitor.doctor.examination import check_certificate, check_default_port, check_router
from zteam.monitor.doctor.facts import note, ok, problem
from zteam.team.security import certificates
from zteam.team.security.access import Rights

FINDINGS = [
    ok("data", "data on 7 keys"),
    problem("transforms", "no process tf", "zteam-tf"),
    note("refusals", "none within 60 s"),
]


def test_findings_are_columns() -> None:
    """Level, subject and text are aligned, a next step stands below its text, and the last line counts the problems."""
    plain = format_findings(FINDINGS)
    assert plain.splitlines() == [
        "ok       data        data on 7 keys",
        "problem  transforms  no process tf",
        "                     -> zteam-tf",
        "note     refusals    none within 60 s",
        "1 problem",
    ]
    assert format_findings([FINDINGS[0], FINDINGS[2]]).splitlines()[-1] == "no problems"
    assert format_findings([FINDINGS[1], FINDINGS[1]]).splitlines()[-1] == "2 problems"
    assert [finding.good for finding in FINDINGS] == [True, False, True]
    coloured = format_findings(FINDINGS, color=True)
    assert coloured.count("\033[") == 6
    assert "\033[31mproblem\033[0m  transforms" in coloured
    for code in ("\033[0m", "\033[31m", "\033[32m", "\033[33m"):
        coloured = coloured.replace(code, "")
    assert coloured == plain
    wrapped = format_findings([ok("data", "word " * 30), problem("world", "short", "step " * 30)], columns=60)
    assert max(map(len, wrapped.splitlines())) <= 60


def test_the_end_of_the_certificate_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From 14 days before on, with the step; a file that cannot be read is a problem too."""
    certificates.prepare(tmp_path, "", {"operator": Rights()}, "", ["operator"])
    files = certificates.files_of(tmp_path, "operator")
    assert check_certificate(files) == ok("certificate", "operator.1, valid for 364 days")
    begin = examination.wall_ns()
    for days, level, text in ((360, "note", "operator.1 expires on "), (366, "problem", "operator.1 has expired on ")):
        monkeypatch.setattr(examination, "wall_ns", lambda days=days: begin + days * 86_400 * 10**9)
        found = check_certificate(files)
        assert (found.level, found.next_step) == (level, f"zteam certs renew operator --folder {tmp_path}")
        assert text in found.text
    (tmp_path / "operator.pem").write_text("nonsense")
    assert check_certificate(files).level == "problem"


def test_the_router_at_the_default_port_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the team has another port; with its user where it is another one's, whose router is not joined unasked."""
    owner = os.getuid()
    with closing(Router(RouterOptions(("tcp/127.0.0.1:0",)))) as router:
        default, pid = router.endpoint, os.getpid()
        monkeypatch.setattr("zteam.bus.options.DEFAULT_ENDPOINT", default)
        assert check_router(BusOptions()).text.startswith(f"zteam-router at {default}, process {pid}, Zenoh ")
        assert check_default_port(BusOptions()) == []
        assert check_default_port(BusOptions(connect="tcp/10.0.0.1:7447")) == []
        monkeypatch.setattr(os, "getuid", lambda: owner + 1)
        found = check_router(BusOptions())
        assert (found.good, found.text) == (False, f"the router at {default} belongs to user id {owner}")
        (told,) = check_default_port(BusOptions(connect="tcp/127.0.0.1:1"))
        assert (told.level, told.next_step) == ("note", "export ZTEAM_CONNECT=tcp/127.0.0.1:1")
        assert f"zteam-router at {default}, process {pid}, of user id {owner}, Zenoh " in told.text
