"""What deploys a team is of one piece with it: compose files and manifests for Kubernetes."""

import json
import re
import shlex
from collections.abc import Iterator
from typing import Any

import pytest
import yaml
import zenoh

from support.commands import command_of
from support.pages import ROOT
from zteam.bus.options import RouterOptions, router_config
from zteam.config.resources import find_team
from zteam.team.file.reading import load_team
from zteam.team.security.access import rights_of

SECURE = "deploy/docker-compose.secure.yml"
ZENOHD = "deploy/docker-compose.zenohd.yml"
OWN = "deploy/team_service.yml"
COMPOSE = ("docker-compose.yml", SECURE, OWN)


class Compose(yaml.SafeLoader):
    """Reads compose files, whose `!reset` takes back what an earlier file says."""


Compose.add_constructor("!reset", lambda _loader, _node: None)


def services(name: str) -> dict[str, Any]:
    """The services of a compose file."""
    found: dict[str, Any] = yaml.load((ROOT / name).read_text(), Compose)["services"]
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
    """The words of each command of zteam, also within a shell's; variables have what stands for them, else 1."""
    for file, text in texts():
        filled = re.sub(r"\$\(\(.*?\)\)|\$\w+", "1", re.sub(r"\$\{\w+:[-+](.*?)\}", r"\1", text))
        for command in re.findall(r"zteam(?:-\w+)?(?: [^;'\n]+)?", filled):
            yield pytest.param(shlex.split(command), id=f"{file}: {command}")


@pytest.mark.parametrize("words", [*commands()])
def test_commands_are_ones_of_zteam(words: list[str]) -> None:
    """Every command of the compose files and of the manifests is accepted by its own parser."""
    name, *arguments = words[1:] if words[0] == "zteam" else words
    command_of(name)[0]().parse_args(arguments)


def test_a_container_sees_its_own_certificate() -> None:
    """Each service has the pair of its own name, one of those that `zteam certs init` gives to the default team."""
    known = rights_of(load_team(find_team("line")))
    secure = services(SECURE)
    assert set(secure) == {name for name, each in services("docker-compose.yml").items() if "scale" not in each}
    assert set(secure) <= set(known)
    for name, service in secure.items():
        pair = {each["target"]: each["source"] for each in service["secrets"] if isinstance(each, dict)}
        assert pair == {"own.pem": f"{name}.pem", "own.key": f"{name}.key"}
        shared = {each for each in service["secrets"] if isinstance(each, str)}
        assert shared == {"ca.pem"} | ({"access.json5"} if name == "router" else set())


def test_the_official_router_has_the_settings_of_zteams_own() -> None:
    """All of them, but for the name and the process id by which `zteam doctor` knows the router as zteam's."""
    words = [word.replace("$$", "$") for word in services(ZENOHD)["router"]["command"]]
    given = dict(word.removeprefix("--cfg=").split(":", 1) for word in words if word.startswith("--cfg="))
    own = router_config(RouterOptions(("tcp/0.0.0.0:7447",), lease=2.0))
    official = zenoh.Config()
    # What the other words say, and what zenohd is without being told.
    as_told = {
        "--listen=tcp/0.0.0.0:7447": {"listen/endpoints": '["tcp/0.0.0.0:7447"]'},
        "--no-multicast-scouting": {"scouting/multicast/enabled": "false"},
        "--rest-http-port=none": {},
    }
    assert [word for word in words if not word.startswith("--cfg=")] == [*as_told]
    for settings in (given, *as_told.values(), {"mode": '"router"', "connect/endpoints": "[]"}):
        for key, value in settings.items():
            official.insert_json5(key, value)
    found, wanted = (json.loads(str(config)) for config in (official, own))
    del wanted["metadata"], found["metadata"]
    assert found == wanted


def test_every_container_has_few_rights() -> None:
    """No root, no capabilities, no write to the root file system, ports on loopback alone; no override loosens it."""
    hardened = {"read_only": True, "cap_drop": ["ALL"], "security_opt": ["no-new-privileges:true"]}
    loosening = {"privileged", "cap_add", "network_mode", "pid", "ipc", "devices"}
    for name, service in {**services("docker-compose.yml"), **services(OWN)}.items():
        assert {key: service.get(key) for key in hardened} == hardened, name
        assert not loosening & set(service), name
        assert re.fullmatch(r"\$\{ZTEAM_USER:-[1-9][0-9]*:[1-9][0-9]*\}", service["user"]), name
        assert all(port.startswith("127.0.0.1:") for port in service.get("ports", ())), name
    for override in (SECURE, ZENOHD):
        assert not [
            name
            for name, service in services(override).items()
            if {*loosening, *hardened, "user", "ports"} & set(service)
        ]
