"""`firable sign`: say with a key that a bundle may run."""

from __future__ import annotations

import shlex

import click

from firable.cli.files import MADE, READ


@click.command(short_help="Sign a bundle, so that a site can demand who released it.")
@click.argument("bundle", metavar="[BUNDLE]", type=READ, required=False)
@click.option("--key", metavar="FILE", type=READ, help="The secret key to sign with.")
@click.option(
    "--make-key", metavar="FILE", type=MADE, help="Make a key: the secret one in FILE, the public one in FILE.pub."
)
def sign(bundle: str | None, key: str | None, make_key: str | None) -> int:
    """Sign BUNDLE with a secret key (Ed25519): the signature is written beside it, to BUNDLE.signatures.

    A bundle shows by itself whether it was damaged, not who made it. `firable run --trust FILE.pub` and `firable verify
    --trust FILE.pub` refuse a bundle that none of the keys they name has signed. Several people may sign one bundle.
    """
    if bundle is not None and key is None and make_key is not None:
        raise click.UsageError(
            f"--make-key makes a key and signs nothing with it: add `--key {shlex.quote(make_key)}` to sign {bundle}"
        )
    if (bundle is None) != (key is None) or (bundle is None and make_key is None):
        raise click.UsageError("say which BUNDLE to sign, and with --key which key; --make-key FILE makes one")
    from firable.cli.options import refuse_a_net

    if bundle is not None:
        refuse_a_net(bundle, "what is signed is a bundle", f"firable sign --key {shlex.quote(str(key))}")
    from firable.nets import signing
    from firable.nets.bundle import read_bundle

    if make_key is not None:
        name = signing.make_key(make_key)
        click.echo(f"made the key {name[:16]}…: {make_key} is secret, and {make_key}.pub is for who trusts it")
    if bundle is not None and key is not None:
        read = read_bundle(bundle)
        name = signing.sign(read, bundle, key)
        click.echo(f"signed the bundle {read.digest[:16]}… of '{read.net.name}' with the key {name[:16]}…")
        click.echo(f"  {signing.signatures_path(bundle)}")
    return 0


trust_option = click.option(
    "--trust",
    metavar="KEY",
    type=READ,
    multiple=True,
    help="Refuse a bundle that is signed by none of these public keys; may be given several times.",
)
