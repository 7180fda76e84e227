"""Devices that let in only who shows a certificate or a password, and that are believed only if they show theirs."""

from __future__ import annotations

import asyncio
import datetime
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from asyncua import ua
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.server import Server
from asyncua.server.user_managers import UserManager
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from support.certificates import Site

from firable.executor.drivers.bench import Heard, until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import BoundDriver
from firable.executor.drivers.far_side.mqtt_device import MqttEnd, mosquitto
from firable.executor.drivers.far_side.opcua_server import OpcUaEnd
from firable.executor.drivers.far_side.ports import free_port

BINDING = """
firable_bind: 1
cell: secured
devices: {{D: {{{keys}, timeout_s: 2, retry_s: 0.02}}}}
signals: {{s: {{device: D, read: "{point}", on_loss: hold}}}}
"""


@asynccontextmanager
async def driving(keys: str, point: str) -> AsyncIterator[tuple[BoundDriver, Heard]]:
    """A driver with one signal of a device."""
    driver, heard = BoundDriver(parse_binding(BINDING.format(keys=keys, point=point)), (), frozenset()), Heard()
    task = asyncio.create_task(driver.run(heard, heard))
    try:
        yield driver, heard
    finally:
        task.cancel()
        await asyncio.wait([task])


async def is_read(keys: str, point: str) -> None:
    async with driving(keys, point) as (_, heard):
        await until(lambda: ("s", True, None) in heard.signals, f"the signal is read: {heard.notes}")


async def is_refused(keys: str, point: str, why: str = "") -> None:
    async with driving(keys, point) as (driver, heard):
        await until(lambda: any("not connected" in note and why in note for note in heard.notes), "the refusal")
        assert not driver.devices["D"].is_ready.is_set()
        assert heard.signals == []


def own(folder: Path, name: str) -> tuple[str, str]:
    """The files of a certificate that nobody else has signed, as OPC UA has them, and of its key."""
    key = rsa.generate_private_key(65_537, 2048)
    subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
    now = datetime.datetime.now(datetime.UTC)
    signed = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(hours=1))
        .not_valid_after(now + datetime.timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName([x509.UniformResourceIdentifier(f"urn:{name}")]), critical=False)
        .sign(key, hashes.SHA256())
    )
    certificate, secret = folder / f"{name}.der", folder / f"{name}.pem"
    certificate.write_bytes(signed.public_bytes(serialization.Encoding.DER))
    pem, form = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
    secret.write_bytes(key.private_bytes(pem, form, serialization.NoEncryption()))
    return str(certificate), str(secret)


class Passwords(UserManager):
    """One user, who has a password."""

    def get_user(
        self, iserver: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> User | None:
        del iserver, certificate
        return User(role=UserRole.Admin) if (username, password) == ("cell", "secret") else None


def test_opc_ua_server_that_demands_encryption_and_a_password_is_read_and_another_one_is_not_believed(
    tmp_path: Path,
) -> None:
    server, client, stranger = (own(tmp_path, name) for name in ("server", "client", "stranger"))

    async def secure(made: Server) -> None:
        made.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
        await made.load_certificate(server[0])
        await made.load_private_key(server[1])
        made.iserver.user_manager = Passwords()

    async def main() -> None:
        end, point = OpcUaEnd({"ns=2;s=s": True}, secure=secure), "ns=2;s=s"
        await end.start(lambda _point, _value: None)
        url = f"driver: opcua, url: 'opc.tcp://127.0.0.1:{end.port}/'"

        def keys(certificate: str, password: str = "secret", mode: str = "SignAndEncrypt") -> str:
            files = f"certificate: {client[0]}, key: {client[1]}, server: {certificate}, application: 'urn:client'"
            return f"{url}, user: cell, password: {password}, security: {{{files}, mode: {mode}}}"

        try:
            await is_read(keys(server[0]), point)
            await is_refused(url, point)
            await is_refused(keys(server[0], "wrong"), point, "does not let the user 'cell' in: is the password right?")
            await is_refused(keys(server[0], mode="Sign"), point)
            await is_refused(keys(stranger[0]), point)
            await is_refused(keys(client[1]), point, "is no certificate and its key")
            await is_refused(keys(f"{tmp_path}/none.der"), point, "No such file")
        finally:
            await end.stop()
            await end.end()

    asyncio.run(main())


@pytest.mark.skipif(mosquitto() is None, reason="needs the broker mosquitto, which is not installed")
def test_broker_that_demands_a_certificate_and_a_password_is_read_and_another_one_is_not_believed(
    tmp_path: Path,
) -> None:
    site, other = Site(tmp_path / "site"), Site(tmp_path / "other")
    broker, client, stranger = site.host("broker"), site.host("client"), other.host("stranger")
    passwords = tmp_path / "passwords"
    subprocess.run(["mosquitto_passwd", "-b", "-c", str(passwords), "cell", "secret"], check=True, timeout=20)
    demands = f"""user root
allow_anonymous false
password_file {passwords}
cafile {site.authority}
certfile {broker.certificate}
keyfile {broker.key}
require_certificate true"""

    async def main() -> None:
        end, point = MqttEnd(["x"], secured=demands), "cell/s"
        await end.start(lambda _point, _value: None)
        end.show(point, value=True)
        at = f"driver: mqtt, host: 127.0.0.1, port: {end.port}"

        def keys(ca: object, own: Any, password: str | None = "secret") -> str:
            files = f"ca: {ca}, certificate: {own.certificate}, key: {own.key}"
            shown = "" if password is None else f"password: {password}, "
            return f"{at}, user: cell, {shown}tls: {{{files}}}"

        try:
            await is_read(keys(site.authority, client), point)
            await is_refused(at, point)
            in_vain = f"127.0.0.1:{end.port} does not let the user 'cell' in:"
            await is_refused(keys(site.authority, client, "wrong"), point, f"{in_vain} is the password right?")
            await is_refused(keys(site.authority, client, None), point, f"{in_vain} no password is given")
            nobody = keys(site.authority, client, None).replace("user: cell, ", "")
            await is_refused(nobody, point, f"127.0.0.1:{end.port} does not let this host in, which gives no user")
            await is_refused(keys(site.authority, stranger), point)
            await is_refused(keys(other.authority, client), point)
            await is_refused(f"{at}, user: cell, password: secret, tls: true", point)
        finally:
            await end.stop()

    asyncio.run(main())


@pytest.mark.parametrize(
    ("keys", "where"),
    [
        ("driver: mqtt, host: 127.0.0.1, port: {port}", "127.0.0.1:{port}"),
        ("driver: opcua, url: 'opc.tcp://127.0.0.1:{port}/'", "opc.tcp://127.0.0.1:{port}/"),
    ],
    ids=["MQTT", "OPC UA"],
)
def test_where_nobody_serves_is_told_in_words_with_the_address(keys: str, where: str) -> None:
    port = free_port()
    why = f"D: not connected: {where.format(port=port)}: Connection refused"
    asyncio.run(is_refused(keys.format(port=port), "ns=2;s=s", why))
