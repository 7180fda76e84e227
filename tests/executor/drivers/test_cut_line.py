"""A command on a line that is cut never comes when the line is back, though its connection or its process is gone.

In a network of its own, since whoever cuts the line of this host would cut it for all others.
"""

import shutil
import subprocess
import sys

import pytest

CLIENT = """
import asyncio, sys
from firable.executor.drivers import modbus
from firable.executor.drivers.device import Wanted

async def main():
    options = modbus.TcpOptions(host="127.0.0.1", port=int(sys.argv[1]))
    connection = await modbus.TCP.connect(options, Wanted(read=(), timeout_s=60))
    print("connected", flush=True)
    sys.stdin.readline()
    writing = connection.begin([("coil 1", True)])
    print("sent", flush=True)
    sys.stdin.readline()
    writing.close()
    await connection.close()
    await asyncio.sleep(0.01)  # the event loop closes the socket in a turn of its own
    print("closed", flush=True)
    sys.stdin.readline()

asyncio.run(main())
"""
NETWORK = """
import socket, subprocess, sys

def done(*command):
    subprocess.run(command, check=True)

done("ip", "link", "set", "lo", "up")
server = socket.create_server(("127.0.0.1", 0))
command = [sys.executable, "-c", sys.argv[2], str(server.getsockname()[1])]
client = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
assert client.stdout.readline() == "connected\\n"
device, _ = server.accept()
done("nft", "add table ip cut; add chain ip cut o { type filter hook output priority 0; policy drop; }")
client.stdin.write("go\\n")
client.stdin.flush()
assert client.stdout.readline() == "sent\\n"
if sys.argv[1] == "killed":
    client.kill()
    client.wait()
else:
    client.stdin.write("close\\n")
    client.stdin.flush()
    assert client.stdout.readline() == "closed\\n"
done("nft", "delete table ip cut")
device.settimeout(3)  # a kernel that goes on sending does it within some tenths of a second
try:
    print("came:", device.recv(64))
except (TimeoutError, ConnectionResetError):
    print("nothing came")
client.kill()
"""
OWN = ["unshare", "--map-root-user", "--net"]


def has_networks_of_its_own() -> bool:
    """Whether this process may make a network and cut lines in it."""
    if not all(shutil.which(program) for program in ("unshare", "ip", "nft")):
        return False
    cut = ["nft", "add table ip cut; add chain ip cut o { type filter hook output priority 0; policy drop; }"]
    return subprocess.run([*OWN, *cut], capture_output=True, check=False).returncode == 0


@pytest.mark.skipif(not has_networks_of_its_own(), reason="needs a network of its own, and nft: not allowed here")
@pytest.mark.parametrize("how", ["closed", "killed"])
def test_command_on_a_line_that_was_cut_never_comes(how: str) -> None:
    command = [*OWN, sys.executable, "-c", NETWORK, how, CLIENT]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (ended.stdout, ended.returncode) == ("nothing came\n", 0), ended.stderr
