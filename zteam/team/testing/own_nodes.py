"""Own nodes of a team under test, by name: functions of this process, or processes that run a function."""

from collections.abc import Container, Mapping, Sequence
from typing import NamedTuple

from zteam import names
from zteam.errors import UsageError
from zteam.node.process_options import NodeOptions, to_line
from zteam.team.launch.own_behaviors import Inquiry, Question
from zteam.team.launch.plan import MEMBER
from zteam.team.launch.supervisor import Job
from zteam.team.own_code import find_body
from zteam.team.run.threads import Body


class OwnNodes(NamedTuple):
    """The nodes of a team in one process as functions, or those of a team of processes as jobs."""

    bodies: Mapping[str, Body] = {}
    jobs: Mapping[str, Job] = {}

    def check_names(self, taken: Container[str]) -> None:
        """Raise UsageError for a node with the name of a process of the team."""
        for name in (*self.bodies, *self.jobs):
            if name in taken:
                raise UsageError(f"node {name!r}: the team has a process of this name already")


NO_NODES = OwnNodes()


def own_nodes(call: str, nodes: "Mapping[str, Body | str]", folders: Sequence[str], *, here: bool) -> OwnNodes:
    """The nodes that `call` was given. Their modules are looked for in `folders` too; with `here` this process runs
    them, else a child imports them first.

    Raises UsageError.
    """
    for name, body in nodes.items():
        if problem := names.name_problem(name):
            raise UsageError(f"{call}: node {name!r}: {problem}")
        if not (isinstance(body, str) or (here and callable(body))):
            raise UsageError(f"{call}: nodes[{name!r}] is {_told(body, here)}")
    texts = {name: body for name, body in nodes.items() if isinstance(body, str)}
    if here:
        functions = {name: body for name, body in nodes.items() if not isinstance(body, str)}
        return OwnNodes({**functions, **{name: find_body(name, text) for name, text in texts.items()}})
    with Inquiry([Question(text, {}, node=name) for name, text in texts.items()], folders, ()) as inquiry:
        if refused := [answered.refused for answered in inquiry.answers() if answered.refused]:
            raise UsageError("\n".join(refused))
    options = {name: NodeOptions(name, text, (*folders, "")) for name, text in texts.items()}
    return OwnNodes(jobs={name: Job(MEMBER, words=to_line(name, options[name])) for name in texts})


def _told(body: object, here: bool) -> str:
    module, function = getattr(body, "__module__", None), getattr(body, "__qualname__", "")
    if here or not callable(body):
        return f"{body!r}: give text 'module:function'" + (", or a function of the node" if here else "")
    text = f"{module}:{function}" if function.isidentifier() else "module:function"
    return f"a function of this process: give a function of a module as text ({text!r}), or say in_process=True"
