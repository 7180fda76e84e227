"""A small network of namespaces, each a host of its own on one bridge; needs root and a system that allows it."""

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

PREFIX = "10.213.7"


def _run(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, timeout=60).stdout.decode()


class Network:
    """The namespaces; host i has the address PREFIX.i."""

    def __init__(self, hosts: int) -> None:
        tag = f"fb{os.getpid() % 100_000}"
        self.hub = f"{tag}h"
        self.names = [f"{tag}n{i}" for i in range(1, hosts + 1)]

    def make(self) -> None:
        """Make the namespaces and join them."""
        for name in (self.hub, *self.names):
            _run("ip", "netns", "add", name)
            _run("ip", "-n", name, "link", "set", "lo", "up")
        _run("ip", "-n", self.hub, "link", "add", "bridge", "type", "bridge")
        _run("ip", "-n", self.hub, "link", "set", "bridge", "up")
        for i, name in enumerate(self.names, 1):
            _run("ip", "-n", name, "link", "add", "eth0", "type", "veth", "peer", "name", f"port{i}", "netns", self.hub)
            _run("ip", "-n", self.hub, "link", "set", f"port{i}", "master", "bridge", "up")
            _run("ip", "-n", name, "addr", "add", f"{PREFIX}.{i}/24", "dev", "eth0")
            _run("ip", "-n", name, "link", "set", "eth0", "up")

    def remove(self) -> None:
        """Remove all that was made."""
        for name in (self.hub, *self.names):
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True, timeout=60)

    def within(self, host: int) -> list[str]:
        """What a command begins with that runs on host `host`."""
        return ["ip", "netns", "exec", self.names[host - 1]]

    def cut(self, host: int) -> None:
        """Take a host's cable out."""
        _run("ip", "-n", self.hub, "link", "set", f"port{host}", "down")

    def mend(self, host: int) -> None:
        """Put it in again."""
        _run("ip", "-n", self.hub, "link", "set", f"port{host}", "up")

    def lose(self, host: int, percent: int) -> None:
        """Let so many of the packets for a host be lost, and as many of those that it sends."""
        nft = [*self.within(host), "nft"]
        _run(*nft, "add table inet faults")
        for hook, lo in (("input", "iifname"), ("output", "oifname")):
            _run(*nft, f"add chain inet faults {hook} {{ type filter hook {hook} priority 0; }}")
            _run(*nft, f"add rule inet faults {hook} {lo} != lo numgen random mod 100 < {percent} counter drop")

    def dropped(self, host: int) -> int:
        """How many packets were lost."""
        listed = _run(*self.within(host), "nft", "list table inet faults")
        return sum(map(int, re.findall(r"counter packets (\d+)", listed)))

    def lose_nothing(self, host: int) -> None:
        """End the loss."""
        _run(*self.within(host), "nft", "delete table inet faults")


@contextmanager
def network(hosts: int) -> Iterator[Network]:
    """A network, or a skipped test with the reason where the system allows none."""
    if os.geteuid() != 0 or shutil.which("ip") is None or shutil.which("nft") is None:
        pytest.skip("network namespaces need root, `ip` and `nft`")
    made = Network(hosts)
    try:
        try:
            made.make()
            made.lose(1, 30)
            made.lose_nothing(1)
        except (subprocess.CalledProcessError, OSError) as error:
            said = getattr(error, "stderr", b"") or b""
            pytest.skip(f"this system allows no network namespaces: {said.decode(errors='replace').strip() or error}")
        yield made
    finally:
        made.remove()
