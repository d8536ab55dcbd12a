"""What each behaviour does and takes, for tools and documents."""

import msgspec

from zteam.behaviors.parameters import Parameter, parameters_of
from zteam.behaviors.registry import BEHAVIORS, find_behavior
from zteam.entry_points import BEHAVIORS as GROUP
from zteam.entry_points import offered


class BehaviorInfo(msgspec.Struct):
    """One behaviour."""

    name: str
    """As `--behavior` takes it."""
    source: str
    """Its class, as `package.module:Class`."""
    summary: str
    """The first paragraph of the docstring of its class, on one line."""
    parameters: list[Parameter]


def behavior_names() -> list[str]:
    """The behaviours that come with zteam, then those of installed packages."""
    return [*BEHAVIORS, *(name for name in offered(GROUP) if name not in BEHAVIORS)]


def describe_behavior(spec: str) -> BehaviorInfo:
    """The behaviour called `spec`. Imports its module. Raises UsageError."""
    kind = find_behavior(spec)
    # Its own docstring: that of the base class would say nothing of it.
    paragraph = (vars(kind).get("__doc__") or "").strip().partition("\n\n")[0]
    source = f"{kind.__module__}:{kind.__qualname__}"
    return BehaviorInfo(spec, source, " ".join(paragraph.split()), parameters_of(kind.Params))
