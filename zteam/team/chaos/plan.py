"""Plans of faults: TOML files, and plans that a seed draws."""

from collections.abc import Sequence
from pathlib import Path

import msgspec

from zteam import names
from zteam.config.fault import KINDS, Fault, FaultKind
from zteam.config.numbers import counted, parse_number
from zteam.config.problems import Problem, problems_of
from zteam.config.toml_values import toml_text
from zteam.counter_random import stream, uniform
from zteam.errors import ConfigError, UsageError, did_you_mean
from zteam.node.kinds import kind_of
from zteam.team.file.sources import KeyPlace, Mistake, Source, error_of, read_toml

MAX_SEED = 2**63 - 1
FIRST = 3.0
"""Simulated seconds after GO before the first fault of a random plan."""
SHORTEST, LONGEST = 0.5, 4.0
"""Simulated seconds of a random fault."""
_PAUSE = 4.0, 10.0
"""Simulated seconds from the end of a random fault to the beginning of the next one: a team recovers meanwhile."""
_DELAYS = 0.05, 1.6
"""Seconds of a random slow link."""


def read_plan(path: Path) -> tuple[Fault, ...]:
    """The faults of a plan file, in the order of time. Raises ConfigError with a line for each mistake."""
    lines, tables = read_toml(path, "plan of faults")
    source, entries = Source(path, lines), tables.get("faults")
    if isinstance(entries, list):
        problems = [Problem((key,), "unknown key; a plan has only faults") for key in tables if key != "faults"]
        for i, entry in enumerate(entries):
            problems += problems_of(entry, Fault, ("faults", i))
    else:
        problems = [Problem(("faults",), "write a table [[faults]] with at, fault and name for each fault")]
    if problems:
        raise error_of(Mistake(KeyPlace(source, problem.path), problem.text) for problem in problems)
    return tuple(sorted(msgspec.convert(entries, list[Fault]), key=lambda fault: fault.at))


def random_plan(
    seed: int, seconds: float, processes: Sequence[str], kinds: Sequence[FaultKind] = KINDS
) -> tuple[Fault, ...]:
    """Faults of these processes, one after the other, in so many simulated seconds after GO; equal seeds, equal plans.

    The router has no link of its own, because those of the others end there, and with a simulator that is killed the
    time of the run begins anew: these are paused instead.
    """
    chosen, plan, at = sorted(processes), list[Fault](), FIRST
    while chosen and at < seconds:
        draws = [uniform(seed, len(plan), i) for i in range(3)]
        name = chosen[stream(seed, len(plan), 5) % len(chosen)]
        fault = kinds[stream(seed, len(plan), 6) % len(kinds)]
        lasts = _between((SHORTEST, LONGEST), draws[0])
        kind = kind_of(name)
        has_link = kind is None or kind.on_bus
        if (fault in ("cut", "slow") and not has_link) or (fault == "kill" and name == names.SIMULATOR):
            fault = "pause"
        # A millisecond is finer than a tick, and short to read.
        delay = round(_between(_DELAYS, draws[1]), 3)
        plan.append(Fault(at=round(at, 3), fault=fault, name=name, seconds=lasts, delay=delay))
        at += plan[-1].lasts + _between(_PAUSE, draws[2])
    return tuple(plan)


def _between(bounds: tuple[float, float], share: float) -> float:
    return round(bounds[0] + share * (bounds[1] - bounds[0]), 3)


def plan_text(faults: Sequence[Fault], comment: str = "") -> str:
    """A plan as a TOML file."""
    tables = [
        "[[faults]]\n" + "".join(f"{key} = {toml_text(value)}\n" for key, value in _entries(fault).items())
        for fault in faults
    ]
    return "\n".join([f"# {comment}\n" if comment else "", *tables]).lstrip("\n")


def _entries(fault: Fault) -> dict[str, object]:
    told = msgspec.to_builtins(fault)
    unused = {"kill": ("for", "delay", "rate"), "slow": ()}.get(fault.fault, ("delay", "rate"))
    return {key: value for key, value in told.items() if key not in unused and value is not None}


def choose_plan(text: str, seconds: float | None, processes: Sequence[str], *, lockstep: bool) -> tuple[Fault, ...]:
    """The plan that a user names: a file, or the seed of a random one of so many simulated seconds. Raises UsageError,
    and ConfigError for a fault of a process that is not there.

    A random plan of lock-step has the faults that repeat to the bit.
    """
    if not text.isdigit():
        plan = read_plan(Path(text))
        for fault in plan:
            if fault.name not in processes:
                hint = did_you_mean(fault.name, processes) or f"; it has {', '.join(processes)}"
                raise ConfigError(f"{text}: the team has no process {fault.name!r}{hint}")
        return plan
    if seconds is None:
        raise UsageError(f"a plan of seed {text} needs an end: say --for SECONDS")
    seed = parse_number(text, 0, MAX_SEED, "the seed of a plan")
    if lockstep:
        robots = [name for name in processes if names.robot_id_of(name) is not None]
        return random_plan(seed, seconds, robots, KINDS[1:])
    return random_plan(seed, seconds, [name for name in processes if not names.is_view(name)])


def describe(plan: Sequence[Fault]) -> str:
    """How many faults of which kinds."""
    counts = {kind: sum(fault.fault == kind for fault in plan) for kind in KINDS}
    listed = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    return f"{counted(len(plan), 'fault')} ({listed})" if plan else "no faults"
