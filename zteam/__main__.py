"""`python -m zteam COMMAND …`, as `zteam COMMAND …`; `python -m zteam zteam-robot …` is that command of a process."""

import sys

from zteam.cli.main import PROCESSES, start, start_command

if __name__ == "__main__":
    if sys.argv[1:2] and sys.argv[1] in PROCESSES:
        del sys.argv[0]
        start_command(sys.argv[0])
    start()
