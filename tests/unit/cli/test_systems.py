"""Commands on systems that lack what Linux has."""

import subprocess
import sys

from support.limits import LIMIT

UNIX = ("fcntl", "grp", "pty", "pwd", "resource", "termios")
HIDING = """
import os, signal, sys
for name in {modules}:
    sys.modules[name] = None
for place, names in ((os, ("fork", "register_at_fork", "waitid")), (signal, ("SIGHUP", "SIGKILL"))):
    for name in names:
        vars(place).pop(name, None)
sys.argv[0] = "zteam"
from zteam.cli import main
main.{start}()
"""


def test_on_windows_a_command_names_wsl() -> None:
    """The first line says where zteam runs, instead of a traceback; the exit code is that of a wrong call."""
    code = HIDING.format(modules=UNIX, start="start_robot")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("zteam-robot: ") and "WSL 2" in line and "docker compose" in line


def test_a_processs_part_needs_only_what_every_system_has() -> None:
    """The node of a process, its log and its stop work without forks, SIGHUP and the modules of Unix."""
    code = HIDING.format(modules=UNIX, start="COMMANDS.keys")
    code += """
import zteam
from zteam.bus import MemoryHub
from zteam.node import process_node
from zteam.node import node
hub = MemoryHub()
node.connect = lambda options, stopping: hub.bus()
zteam.run("planner", lambda planner: (planner.become_present(), planner.stop.request("over")))
print("done")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=False)
    assert (done.returncode, done.stdout) == (0, "done\n"), done.stderr
