"""Certificates of a site, made anew for each test: an authority, and hosts that it vouches for."""

import datetime
import ipaddress
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from firable.executor.links.zenoh_link import Certificates

HERE = "127.0.0.1"


class Site:
    """An authority, and its files in a folder."""

    def __init__(self, folder: Path, *, valid_days: tuple[float, float] = (-0.1, 1.0)) -> None:
        self.folder = folder
        folder.mkdir()
        self.key = ec.generate_private_key(ec.SECP256R1())
        self.name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, folder.name)])
        self.authority = folder / "authority.pem"
        signed = self._certificate(self.name, self.key, is_authority=True, valid_days=valid_days)
        self.authority.write_bytes(signed.public_bytes(serialization.Encoding.PEM))

    def host(
        self,
        name: str,
        *,
        valid_days: tuple[float, float] = (-0.1, 1.0),
        address: str = HERE,
        purpose: x509.ObjectIdentifier | None = None,
    ) -> Certificates:
        """The files of a host at an address, which are valid between two days from now, and for one purpose or any."""
        key = ec.generate_private_key(ec.SECP256R1())
        subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
        certificate, secret = self.folder / f"{name}.pem", self.folder / f"{name}.key"
        signed = self._certificate(subject, key, is_authority=False, valid_days=valid_days, at=address, purpose=purpose)
        certificate.write_bytes(signed.public_bytes(serialization.Encoding.PEM))
        secret.touch(0o600)
        secret.write_bytes(
            key.private_bytes(
                serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
            )
        )
        return Certificates(str(self.authority), str(certificate), str(secret))

    def _certificate(
        self,
        subject: x509.Name,
        key: ec.EllipticCurvePrivateKey,
        *,
        is_authority: bool,
        valid_days: tuple[float, float] = (-0.1, 1.0),
        at: str = HERE,
        purpose: x509.ObjectIdentifier | None = None,
    ) -> x509.Certificate:
        now = datetime.datetime.now(datetime.UTC)
        begins, ends = (now + datetime.timedelta(days=days) for days in valid_days)
        draft = (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(self.name)
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(begins)
            .not_valid_after(ends)
            .add_extension(x509.BasicConstraints(ca=is_authority, path_length=None), critical=True)
            .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address(at))]), critical=False)
        )
        if purpose is not None:
            draft = draft.add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
        return draft.sign(self.key, hashes.SHA256())
