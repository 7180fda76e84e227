"""`firable view`: a net in the browser, to play with and to see its counterexamples."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from firable.cli.files import CATALOGUE, NET_FILES, READ
from firable.cli.loop import read_machines
from firable.cli.options import catalogue_file, load_net, net_argument

if TYPE_CHECKING:
    from firable.cli.view.editing import Editing
    from firable.nets.loading import Loaded
    from firable.nets.machines.plant_file import PlantModel


@click.command(short_help="Show a net in the browser: play with it, see its counterexamples.")
@net_argument
@click.option(
    "--trace",
    metavar="FILE",
    type=READ,
    help="A run to play: of `firable check --trace-dir` or `firable run --trace`.",
)
@click.option(
    "--plant",
    metavar="FILE",
    type=READ,
    help="The plant file of the cell, or catalogue:NAME, for the top view.  [default: NAME.plant.yaml beside NET]",
)
@click.option(
    "--collapse",
    metavar="NAME",
    multiple=True,
    help="Draw a task as one place at first: the task that a place is in, those of a controller, or `all`; repeatable.",
)
@click.option(
    "--port", type=click.IntRange(0, 65535), default=0, show_default=True, help="Where to serve on this host; 0: free."
)
@click.option("--read-only", is_flag=True, help="Let nobody edit the net on the page.")
@click.option("--no-browser", is_flag=True, help="Tell the address, and open no browser.")
def view(
    net: str,
    trace: str | None,
    plant: str | None,
    collapse: tuple[str, ...],
    port: int,
    read_only: bool,
    no_browser: bool,
) -> int:
    """Show NET in a browser on this host, until Ctrl-C.

    Click a transition that may fire, and switch the gates; a transition that may not says what it waits for. The page
    checks the net, and plays each counterexample step by step, or the run that --trace names.

    Edit on the page changes NET where it is a net file, and keeps its comments and its order; each edit is written to
    the file at once, if the file is a net with it, and can be undone. With --read-only nothing is edited.

    The picture is that of `firable draw`, by the layout file beside NET where there is one.

    Top view shows the cell from above where a plant file says what it is made of.

    Only this host is served, and only who has the token, which stands in the address that is opened.
    """
    import asyncio

    from firable.cli.pictures import drawable, kept_layout, refuse_unknown
    from firable.cli.text import show_diagnostic
    from firable.cli.view.drawing import Look
    from firable.cli.view.editing import editing_of
    from firable.cli.view.playing import Playing
    from firable.cli.view.runs import Run
    from firable.nets.diagnostics import InputError
    from firable.nets.machines.plant_file import misfits
    from firable.semantics.trace import read_trace

    loaded = load_net(net)
    drawable(loaded.net)
    refuse_unknown(loaded.net, collapse)
    look = Look(kept_layout(loaded.net, net), collapse)
    for note in loaded.notes:
        show_diagnostic(note)
    runs = []
    if trace is not None:
        run = Run(trace, "the run of that file", read_trace(trace), is_given=True)
        run.to_json(loaded.net)  # what is no run of the net is refused before anything is served
        runs.append(run)
    playing = Playing(loaded, net, runs, _plant(loaded, net, plant), look)
    if plant is not None and playing.misfit:
        raise InputError(misfits(read_machines(plant), loaded.net))
    editing = editing_of(playing, net, read_only=read_only)
    try:
        asyncio.run(_served(editing, port, open_it=not no_browser))
    except KeyboardInterrupt:
        click.echo("", err=True)
    return 0


def _plant(loaded: Loaded, net: str, plant: str | None) -> PlantModel | str:
    """The plant of the top view: the one that is named, or of that name beside the net; else why there is none."""
    from firable.nets.catalogue import catalogue_names

    if plant is not None:
        return read_machines(plant)
    name = loaded.net.name.replace("-", "_")
    if net.startswith(CATALOGUE):
        name = net.removeprefix(CATALOGUE)
    elif net.endswith(NET_FILES):
        beside = Path(net.rpartition(".firable.")[0] + ".plant.yaml")
        if beside.is_file():
            return read_machines(str(beside))
    is_shipped = net.startswith(CATALOGUE) or loaded.decomposition is not None
    if is_shipped and name in catalogue_names() and catalogue_file(f"{CATALOGUE}{name}", "plant").exists():
        return read_machines(f"{CATALOGUE}{name}")
    return "no plant file says what the cell is made of: name it with --plant"


async def _served(editing: Editing, port: int, *, open_it: bool) -> None:
    import asyncio

    from firable.cli.view.playing import application
    from firable.executor.operating.control import Endpoint, listening, new_token

    endpoint = Endpoint("127.0.0.1", port, new_token())
    async with listening(application(editing.playing, endpoint, editing.routes()), endpoint) as address:
        show(f"{address}/#token={endpoint.token}", open_it=open_it)
        await asyncio.Event().wait()


def show(address: str, *, open_it: bool) -> None:
    """Tell the address of a page, and open a browser on it if that is wanted."""
    click.echo(f"see it at {address}", err=True)
    if open_it:
        import webbrowser

        webbrowser.open(address)
