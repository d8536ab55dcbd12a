"""Whose process a router or its user is: two users' teams on one machine must not mix by accident."""

import os
from pathlib import Path

import msgspec

from zteam.errors import printable

OWNER_VARIABLE = "ZTEAM_OWNER"
"""The user that a process in a container belongs to: its own user id there says nothing about the host's users."""


class Owner(msgspec.Struct, frozen=True):
    """A process's user, as a router reports it in Zenoh's admin space."""

    uid: int | None = None
    pid_namespace: str = ""
    """As Linux names it (pid_namespaces(7)); empty elsewhere. User ids of one namespace can be compared."""
    user: str = ""
    """ZTEAM_OWNER; empty without it."""

    @classmethod
    def of_this_process(cls) -> "Owner":
        try:
            namespace = str(Path("/proc/self/ns/pid").readlink())
        except OSError:
            namespace = ""
        return cls(os.getuid(), namespace, os.environ.get(OWNER_VARIABLE, ""))

    def is_another_user(self) -> bool:
        """Whether this process's user is certainly another one.

        A container has a PID namespace of its own, so its user id is not compared.
        """
        own = Owner.of_this_process()
        if self.user:
            # As docker-compose.yml passes it, also under sudo.
            own_user = own.user or os.environ.get("SUDO_USER") or os.environ.get("USER")
            if own_user and own_user != self.user:
                return True
        return self.uid not in (None, own.uid) and self.pid_namespace == own.pid_namespace

    def __str__(self) -> str:
        return printable(f"user {self.user}" if self.user else f"user id {self.uid}")
