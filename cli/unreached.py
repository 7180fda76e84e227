"""Why a run cannot be reached, in an operator's words: what the client of HTTP raises, told with what there is to do.

What that raises names its own classes and the numbers of OpenSSL. Who stands before a cell that does not obey has to
know three things: whether anybody serves there, whether it is the run that is meant, and whether it would know its
operator. A run that does not believe a certificate closes the connection and says no more (the alert of TLS 1.3 is
lost with it), so what may be the matter is said of that. Rejected: a second connection that asks why; it is refused
as the first was.
"""

from __future__ import annotations

import socket
import ssl
from typing import Final

import aiohttp

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.source import printable

_ENDED: Final = "has the run ended? the address is the one that it has printed"
_EXPIRED, _EARLY, _HOST, _ADDRESS = 10, 9, 62, 64
"""What OpenSSL calls X509_V_ERR_CERT_HAS_EXPIRED, _CERT_NOT_YET_VALID, _HOSTNAME_MISMATCH, _IP_ADDRESS_MISMATCH."""
_UNKNOWN: Final = {2, 7, 18, 19, 20, 21, 30}
"""X509_V_ERR_* of an issuer that is not found, or that has not signed with the key that is known."""


def unreached(address: str, error: Exception, *, has_authority: bool, has_certificate: bool) -> InputError:
    """F5063 for what the client has raised of an address; what the caller has shown says what may be wrong with it."""
    match error:
        case aiohttp.ClientConnectorCertificateError(certificate_error=ssl.SSLCertVerificationError() as found):
            why, hint = _disbelieved(found, has_authority=has_authority)
        case aiohttp.ClientSSLError():
            why, hint = "no TLS is spoken there", "is it http:// that the run has printed?"
        case aiohttp.ClientConnectorError(os_error=socket.gaierror()):
            why, hint = "no host of that name is known", "write the address as the run has printed it"
        case aiohttp.ClientConnectorError(os_error=ConnectionRefusedError()):
            why, hint = "nobody serves there", _ENDED
        case aiohttp.ClientConnectorError(os_error=OSError(strerror=str() as reason)):
            why, hint = reason, _ENDED
        case TimeoutError():
            why, hint = "it does not answer in time", "somebody has to look at the machines, and at the host of the run"
        case aiohttp.ServerDisconnectedError() | OSError():
            why, hint = _closed(address, has_certificate=has_certificate)
        case _:
            why, hint = "what answers there is no run", _ENDED
    return refusal(f"{printable(address)} cannot be reached: {why}", hint)


def _disbelieved(found: ssl.SSLCertVerificationError, *, has_authority: bool) -> tuple[str, str]:
    match found.verify_code:
        case code if code in {_EXPIRED, _EARLY}:
            when = "has expired" if code == _EXPIRED else "is not valid yet"
            return f"the certificate that it shows {when}", "renew it, or set the clock of this host"
        case code if code in {_HOST, _ADDRESS}:
            return "the certificate that it shows is for another address", "write the address that stands in it"
        case code if code not in _UNKNOWN:
            return f"the certificate that it shows is not believed: {found.verify_message}", "make it out anew"
        case _ if has_authority:
            return "the certificate that it shows is of another authority than --ca", "is that the run that you mean?"
        case _:
            return "the certificate that it shows is of no authority known here", "name its authority with --ca"


def _closed(address: str, *, has_certificate: bool) -> tuple[str, str]:
    why = "the connection is closed without an answer"
    if not address.startswith("https://"):
        return why, "is it https:// that the run has printed?"
    if has_certificate:
        return why, "the run may not know you: is your certificate of the authority that it names with --operators?"
    return why, "the run may ask for a certificate: show yours with --cert"


def refusal(message: str, hint: str) -> InputError:
    """F5063."""
    return InputError([Diagnostic("F5063", message, hint)])
