"""What `ps` and `top` call a process."""

from pathlib import Path

_COMM = Path("/proc/self/comm")


def show_name(command: str) -> None:
    """Show a process under the name of its command, as if that were a program: `python -m` would hide it.

    Linux keeps 15 characters. On other systems nothing changes.
    """
    try:
        _COMM.write_text(command)
    except OSError:
        # No such file, or it cannot be written: a name is not needed.
        pass
