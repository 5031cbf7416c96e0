"""The container's files, which no test can build: what must hold of them can be read."""

from __future__ import annotations

import re
from pathlib import Path

from service.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
IMAGE = (ROOT / "Dockerfile").read_text(encoding="utf-8")
COMPOSE = (ROOT / "docker-compose.yml").read_text(encoding="utf-8")


def test_every_base_is_one_release() -> None:
    bases = re.findall(r"^FROM (\S+)", IMAGE, re.MULTILINE)
    assert len(bases) == 2
    for base in bases:
        assert re.fullmatch(r"python:3\.\d+\.\d+-slim-[a-z]+", base), base


def test_only_versions_that_were_tried_are_installed() -> None:
    installs = re.findall(r"pip install [^&\n]*", IMAGE)
    assert len(installs) == 2
    assert all("constraints.txt" in line for line in installs)


def test_no_port_is_open_to_the_network() -> None:
    block = COMPOSE.partition("ports:")[2].partition("volumes:")[0]
    ports = re.findall(r'^\s*- "?([^"\n]+)', block, re.MULTILINE)
    assert ports and all(port.startswith("127.0.0.1:") for port in ports)
    assert "network_mode" not in COMPOSE and "privileged" not in COMPOSE


def test_nobody_reaches_it_without_a_key() -> None:
    # What is published, to whomever, comes from an address at which the service asks for keys.
    (host,) = re.findall(r"RIGWRIGHT_HOST=(\S+)", IMAGE)
    assert Settings(host=host).asks_for_keys
    assert "RIGWRIGHT_HOST" not in COMPOSE and "--host" not in IMAGE + COMPOSE


def test_it_has_a_user_and_an_end_to_its_memory() -> None:
    assert re.search(r"^USER rigwright$", IMAGE, re.MULTILINE)
    assert re.search(r"^\s+mem_limit: \d+g$", COMPOSE, re.MULTILINE)
