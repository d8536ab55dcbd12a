"""`python -P -m zteam.team.member`: one process of a team. Its name and its options are a line on standard input
(`process_options.to_line`); the environment has the options of the bus and of the log."""

import sys
from collections.abc import Callable

import msgspec

from zteam.bus.options import BusOptions, RouterOptions
from zteam.errors import ZteamError, printable
from zteam.node import kinds
from zteam.node.faults import log_fault, shortage_text
from zteam.node.leaving import leave, show_name
from zteam.node.logs import start_logging
from zteam.node.process_node import ClockMode, ProcessNode, run_node
from zteam.node.process_options import MAX_LINE, ProcessOptions, from_line
from zteam.node.router import run_router
from zteam.team.parts import part_of


def main() -> int:
    """Be the process; its exit code."""
    name = "zteam"
    try:
        name, options = from_line(sys.stdin.readline(MAX_LINE))
        kind = kinds.kind_of(name)
        show_name("zteam-node" if kind is None else kind.command)
        start_logging(name)
        if isinstance(options, RouterOptions):
            return run_router(options)
        bus, ProcessNode.in_team = BusOptions.from_environment(), True
        return run_member(name, options, lambda small: msgspec.structs.replace(bus, small=small))
    except ZteamError as error:
        return _fail(name, str(error), error.exit_code)
    except KeyboardInterrupt:
        return 130
    except BaseException as error:
        # Zenoh's panics are no Exception.
        if text := shortage_text(error):
            return _fail(name, text, 1)
        raise


def run_member(
    name: str, options: ProcessOptions, bus_options: Callable[[bool], BusOptions], clock: ClockMode | None = None
) -> int:
    """Be the process `name`; its exit code. `bus_options(small)` are those of its session."""
    # A mistake is reported before the router is waited for.
    try:
        part = part_of(options)
    except ZteamError:
        raise
    except Exception as error:
        # In the code of a user's behaviour.
        return log_fault(error)
    bus = msgspec.structs.replace(bus_options(part.small), large=part.large)
    return run_node(part.name or name, bus, part.body, clock or part.clock, make=part.make)


def _fail(name: str, text: str, code: int) -> int:
    for line in text.splitlines():
        sys.stderr.write(f"{name}: {printable(line)}\n")
    return code


if __name__ == "__main__":
    leave(main())
