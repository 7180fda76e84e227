"""The addresses of devices as a binding writes them, judged before anything is connected.

A host that has a typing mistake is no error to a network: nobody answers there, today or ever. So what can be seen of
it is refused with its line: an address with a scheme, a port or a path where a host alone is meant, figures that are no
address, a URL of another protocol. Whether a host of such a name is there is not asked: a binding is read where the
network of its cell is not. Rejected: the types of URLs of pydantic, which take any scheme and guess what is missing.
"""

from __future__ import annotations

import re
from ipaddress import ip_address
from typing import Annotated, Final, NoReturn
from urllib.parse import urlsplit

from pydantic import AfterValidator
from pydantic_core import PydanticCustomError

from firable.nets.diagnostics import did_you_mean
from firable.nets.source import quoted

_LABEL: Final = r"\w(?:[\w-]{0,61}\w)?"
_NAME: Final = re.compile(rf"{_LABEL}(?:\.{_LABEL})*\.?")
_FIGURES: Final = re.compile(r"[\d.]+")
_OPCUA: Final = "opc.tcp"


def refuse(said: str, hint: str) -> NoReturn:
    """Refuse what an option holds, from a validator of pydantic, in these words."""
    raise PydanticCustomError("refused", "refused", {"error": said, "hint": hint})


def is_host(text: str) -> bool:
    """Whether a text may be the name or the address of a host.

    >>> [is_host(text) for text in ("plc-1.cell", "192.168.0.10", "fe80::1%eth0")]
    [True, True, True]
    >>> [is_host(text) for text in ("", "192.168.0.256", "192.168.0", "plc:502", "tcp://plc", "plc 1")]
    [False, False, False, False, False, False]
    """
    try:
        ip_address(text)
    except ValueError:
        return _FIGURES.fullmatch(text) is None and _NAME.fullmatch(text) is not None
    return True


def one_name(host: str) -> str:
    """The one name of a host, which is the same in small letters and without the dot of a whole name.

    >>> one_name("PLC.cell."), one_name("FE80::0001%eth0")
    ('plc.cell', 'fe80::1%eth0')
    """
    try:
        return str(ip_address(host))
    except ValueError:
        return host.lower().removesuffix(".")


def _host(text: str) -> str:
    if is_host(text):
        return text
    hint = "write the name or the address of a host, such as `plc.cell` or `192.168.0.10`"
    rest = text.rpartition("//")[2].partition("/")[0]
    host, colon, port = rest.rpartition(":")
    bare = (host if colon and port.isdecimal() else rest).strip("[]")
    if bare != text and is_host(bare):
        hint = f"write `host: {bare}`" + (f" and `port: {port}`" if colon and port.isdecimal() else "")
    refuse(f"{quoted(text)} is no host", hint)


def _opcua_url(text: str) -> str:
    try:
        parts = urlsplit(text)
        is_whole = text.isprintable() and " " not in text  # the parser leaves blanks out, and a server does not
        is_right = is_whole and parts.scheme == _OPCUA and is_host(parts.hostname or "") and bool(parts.port)
    except ValueError:  # figures that are no port, a bracket that is not closed
        is_right = False
    if not is_right:
        scheme = text.partition(":")[0]
        hint = "" if scheme == _OPCUA else did_you_mean(scheme, [_OPCUA])
        refuse(
            f"{quoted(text)} is no `{_OPCUA}://HOST:PORT/`", f"{hint}write it such as `{_OPCUA}://192.168.0.10:4840/`"
        )
    return text


def _port_of_a_line(text: str) -> str:
    if "/" in text and "://" not in text:
        return text
    refuse(f"{quoted(text)} is no path of a serial port", "write a path such as `/dev/ttyUSB0`")


HostName = Annotated[str, AfterValidator(_host)]
"""The type of an option that names a host, without a scheme, a port or a path."""

OpcUaUrl = Annotated[str, AfterValidator(_opcua_url)]
"""The type of an option that is the URL of an OPC UA server, with a host and a port."""

LinePath = Annotated[str, AfterValidator(_port_of_a_line)]
"""The type of an option that is the path of a serial port."""
