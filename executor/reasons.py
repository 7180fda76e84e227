"""Why the system refuses something, in its words: libraries say them twice, with a number, and with the address."""

from __future__ import annotations

import errno
import os
import socket
import ssl


def reason(error: Exception) -> str:
    """Why the system has refused something.

    >>> reason(ConnectionRefusedError(errno.ECONNREFUSED, "Connect call failed ('127.0.0.1', 4840)"))
    'Connection refused'
    """
    if not isinstance(error, OSError):
        return str(error)
    number = error.errno or 0
    if number in errno.errorcode and not isinstance(error, ssl.SSLError | socket.gaierror):  # which number their own
        return os.strerror(number)
    return str(error.strerror or error)


def is_in_use(error: Exception) -> bool:
    """Whether a serial port cannot be had because another program has it.

    >>> is_in_use(BlockingIOError(errno.EAGAIN, "locked")), is_in_use(FileNotFoundError(errno.ENOENT, "none"))
    (True, False)
    """
    return isinstance(error, OSError) and error.errno in {errno.EAGAIN, errno.EBUSY}


def port_reason(error: Exception) -> str:
    """Why a serial port cannot be had; one that another program has is locked by it.

    What the system says of a file that is no port, pyserial hands on in words of its own.
    """
    if is_in_use(error):
        return "another program has it open"
    said_first = error.__context__
    if said_first is not None and said_first.args[:1] == (errno.ENOTTY,):
        return "this is no serial port"
    return reason(error)
