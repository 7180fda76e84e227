"""Whether a certificate of one's own, or of those whom one believes, is still good, asked before anybody comes.

Who is shown a certificate that has expired closes the connection and says no more; the alert of TLS is lost on the way.
So the one who has it looks first. Python's `ssl` reads no dates but in a handshake: here is one with oneself, in
memory, in which the certificate is shown in the role that it is for and nothing but itself need be trusted. Rejected:
`cryptography`, which reads certificates, and which a host without signed bundles need not have.
"""

from __future__ import annotations

import ssl
from pathlib import Path
from typing import Final

from firable.nets.source import printable

_BYTES_MAX: Final = 1 << 20
_FLIGHTS_MAX: Final = 8
"""A handshake has fewer; one that comes to no end shows nothing."""


def unloaded(error: OSError | ValueError, *files: str) -> str:
    """Why the files of a certificate and its key, or of an authority, could not be loaded."""
    texts = []
    for file in files:
        try:
            with Path(file).open("rb") as opened:
                texts.append(opened.read(_BYTES_MAX))
        except (OSError, ValueError) as found:  # ValueError: a NUL in the path
            return f"{printable(file)}: {found.strerror if isinstance(found, OSError) else found}"
    if isinstance(error, ssl.SSLError):
        if error.reason == "KEY_VALUES_MISMATCH":
            return "the key is that of another certificate"
        holds = [(b"BEGIN CERTIFICATE" in text, b"PRIVATE KEY" in text) for text in texts]
        if holds == [(False, True), (True, False)]:
            return "certificate and key have changed places"
        return "the key has a password" if any(b"ENCRYPTED" in text for text in texts) else "it is not in PEM"
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


def fault_of_authority(file: str, now_seconds: float) -> str | None:
    """Why no certificate is believed by the authorities in a file, at a time of the clock, or None.

    OpenSSL takes any certificate there for an authority, and says nothing before somebody is turned away by it. Raises
    `OSError` where the file cannot be read, or is none of certificates.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.load_verify_locations(file)
    known = context.get_ca_certs()
    if not known:
        return "it holds no certificate of an authority (one that may sign others)"
    dates = [[ssl.cert_time_to_seconds(str(one[key])) for key in ("notBefore", "notAfter")] for one in known]
    if all(end < now_seconds for _, end in dates):
        return "certificate has expired"
    if all(now_seconds < begin or end < now_seconds for begin, end in dates):
        return "certificate is not yet valid"
    return None


def fault_of(certificate: str, key: str, *, is_server: bool) -> str | None:
    """Why nobody would believe a certificate, in the words of OpenSSL, or None.

    That of a key with a password is not looked at: whoever loads it is asked for that once.
    """
    looks = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT if is_server else ssl.PROTOCOL_TLS_SERVER)
    shows = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER if is_server else ssl.PROTOCOL_TLS_CLIENT)
    looks.check_hostname = shows.check_hostname = False
    shows.verify_mode = ssl.CERT_NONE
    looks.verify_mode = ssl.CERT_REQUIRED
    try:
        looks.load_verify_locations(certificate)
        for side in (shows,) if is_server else (shows, looks):  # a server has to show one, too, whoever looks at it
            side.load_cert_chain(certificate, key, password="")
    except ssl.SSLError:
        return None
    looks.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    both = [
        looks.wrap_bio(there, back, server_side=not is_server),
        shows.wrap_bio(back, there, server_side=is_server),
    ]
    for _ in range(_FLIGHTS_MAX):
        for one in tuple(both):
            try:
                one.do_handshake()
                both.remove(one)
            except ssl.SSLWantReadError:
                continue
            except ssl.SSLCertVerificationError as error:
                return error.verify_message
            except ssl.SSLError as error:
                return str(error.reason or error)
    return None


def remedy_of(fault: str) -> str:
    """What to do about a certificate of which `fault_of` has told a fault."""
    if "purpose" in fault:
        return "take one made for it: serverAuth for who listens or serves, clientAuth for who joins or operates"
    return "renew it, or set the clock of this host"
