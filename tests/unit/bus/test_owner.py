"""Whose router it is, as a tool decides it."""

import os
from pathlib import Path

import pytest

from zteam.bus.connection import why_foreign
from zteam.bus.options import Owner
from zteam.bus.router import RouterMetadata, RouterRecord

HERE, OTHER = str(Path("/proc/self/ns/pid").readlink()), "pid:[1]"


@pytest.mark.parametrize(
    ("uid", "namespace", "user", "foreign"),
    [
        ("own", HERE, "", ""),
        ("another", HERE, "", "user id 12345"),
        ("another", OTHER, "", ""),  # a container's, as `docker run` starts it
        ("another", OTHER, "ann", ""),  # as docker-compose.yml starts it
        ("own", OTHER, "bob", "user bob"),
        ("own", HERE, "bob", "user bob"),
        ("another", HERE, "ann", "user ann"),
        (None, OTHER, "", ""),
        (None, "", "b\x1bob", "user b�ob"),
    ],
)
@pytest.mark.parametrize("by", ["USER", "SUDO_USER", "ZTEAM_OWNER"])
def test_another_users_router_is_refused(
    uid: str | None, namespace: str, user: str, foreign: str, by: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """User ids are compared within a PID namespace only, and an owner that is named always."""
    monkeypatch.setenv("USER", "root")
    monkeypatch.delenv("SUDO_USER", raising=False)
    monkeypatch.setenv(by, "ann")
    owner = Owner({"own": os.getuid(), "another": 12345, None: None}[uid], namespace, user)
    found = why_foreign(RouterRecord(metadata=RouterMetadata(owner=owner)), "tcp/127.0.0.1:7447")
    if not foreign:
        assert found is None
    else:
        assert found is not None
        assert found[0].endswith(f"belongs to {foreign}")
        assert "--connect tcp/127.0.0.1:7447" in found[1]


def test_a_user_without_a_name_joins(monkeypatch: pytest.MonkeyPatch) -> None:
    """A service without USER cannot be known to be another user."""
    for name in ("USER", "SUDO_USER", "ZTEAM_OWNER"):
        monkeypatch.delenv(name, raising=False)
    assert not Owner(12345, OTHER, "ann").is_another_user()
