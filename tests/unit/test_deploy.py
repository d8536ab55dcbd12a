"""What deploys a team is of one piece with it: compose files and manifests for Kubernetes."""

import importlib
import re
import shlex
from collections.abc import Iterator
from typing import Any

import pytest
import yaml

from support.pages import ROOT
from zteam.config.resources import find_team
from zteam.team.file.reading import load_team
from zteam.team.security.access import rights_of

SECURE = "deploy/docker-compose.secure.yml"
COMPOSE = ("docker-compose.yml", SECURE)


def services(name: str) -> dict[str, Any]:
    """The services of a compose file."""
    found: dict[str, Any] = yaml.safe_load((ROOT / name).read_text())["services"]
    return found


def texts() -> Iterator[tuple[str, str]]:
    """The file and the text of each command of the compose files and of the manifests."""
    for name in COMPOSE:
        yield from ((name, service["command"]) for service in services(name).values() if "command" in service)
    for path in sorted((ROOT / "deploy" / "kubernetes").glob("*.yaml")):
        for manifest in yaml.safe_load_all(path.read_text()):
            for container in manifest.get("spec", {}).get("template", {}).get("spec", {}).get("containers", ()):
                words = container["command"]
                yield path.name, words[-1] if words[0] == "sh" else shlex.join(words)


def commands() -> Iterator[Any]:
    """The words of each command of zteam, also within a shell's; variables have their default, else 1."""
    for file, text in texts():
        filled = re.sub(r"\$\(\(.*?\)\)|\$\w+", "1", re.sub(r"\$\{\w+:-(.*?)\}", r"\1", text))
        for command in re.findall(r"zteam(?:-\w+)?(?: [^;'\n]+)?", filled):
            yield pytest.param(shlex.split(command), id=f"{file}: {command}")


@pytest.mark.parametrize("words", [*commands()])
def test_commands_are_ones_of_zteam(words: list[str]) -> None:
    """Every command of the compose files and of the manifests is accepted by its own parser."""
    module, *arguments = words[1:] if words[0] == "zteam" else [words[0].replace("-", "_"), *words[1:]]
    importlib.import_module(f"zteam.cli.{module}").build_parser().parse_args(arguments)


def test_a_container_sees_its_own_certificate() -> None:
    """Each service has the pair of its own name, one of those that `zteam certs init` gives to the default team."""
    known = rights_of(load_team(find_team("line")))
    secure = services(SECURE)
    assert set(secure) == {name for name, each in services("docker-compose.yml").items() if "profiles" not in each}
    assert set(secure) <= set(known)
    for name, service in secure.items():
        pair = {each["target"]: each["source"] for each in service["secrets"] if isinstance(each, dict)}
        assert pair == {"own.pem": f"{name}.pem", "own.key": f"{name}.key"}
        shared = {each for each in service["secrets"] if isinstance(each, str)}
        assert shared == {"ca.pem"} | ({"access.json5"} if name == "router" else set())
