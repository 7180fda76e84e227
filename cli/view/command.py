"""`firable view`: a net in the browser, to play with and to see its counterexamples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from firable.cli.files import CATALOGUE, READ
from firable.cli.loop import read_machines, read_machines_of
from firable.cli.options import load_net, net_argument, plant_found

if TYPE_CHECKING:
    from firable.cli.view.editing import Editing
    from firable.cli.view.site import Opening
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
    "--controller",
    metavar="NAME",
    multiple=True,
    help="Open this controller at first; repeatable.  [default: the whole net, or the overview of a large one]",
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
    controller: tuple[str, ...],
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

    The picture is that of `firable draw`, by the layout file beside NET where there is one. A large net begins with an
    overview: its controllers, where their tokens are, and the transitions that they share; a click opens one of them.

    Top view shows the cell from above where a plant file says what it is made of.

    Only this host is served, and only who has the token, which stands in the address that is opened.
    """
    import asyncio

    from firable.cli.pictures import kept_layout, refuse_unknown, viewable
    from firable.cli.text import show_diagnostic
    from firable.cli.view.drawing import Look
    from firable.cli.view.editing import editing_of
    from firable.cli.view.playing import Playing
    from firable.cli.view.runs import Run
    from firable.nets.diagnostics import InputError
    from firable.nets.machines.fitting import misfits
    from firable.semantics.trace import read_trace

    loaded = load_net(net)
    viewable(loaded.net, controller)
    refuse_unknown(loaded.net, collapse)
    look = Look(kept_layout(loaded.net, net), collapse, controller)
    for note in loaded.notes:
        show_diagnostic(note)
    runs = []
    if trace is not None:
        run = Run(trace, "the run of that file", read_trace(trace), is_given=True)
        run.to_json(loaded.net)  # what is no run of the net is refused before anything is served
        runs.append(run)
    playing = Playing(loaded, net, runs, _plant(loaded, net, plant), look)
    if plant is not None and playing.misfit:
        raise InputError(misfits(read_machines_of(plant, loaded.net), loaded.net))
    editing = editing_of(playing, net, read_only=read_only)
    try:
        asyncio.run(_served(editing, port, open_it=not no_browser))
    except KeyboardInterrupt:
        click.echo("", err=True)
    return 0


def _plant(loaded: Loaded, net: str, plant: str | None) -> PlantModel | str:
    """The plant of the top view: the one that is named, or is found for the net; else why there is none."""
    is_shipped = net.startswith(CATALOGUE) or loaded.decomposition is not None
    found = plant or plant_found(net, loaded.net.name if is_shipped else "")
    return (
        "no plant file says what the cell is made of: name it with --plant" if found is None else read_machines(found)
    )


async def _served(editing: Editing, port: int, *, open_it: bool) -> None:
    import asyncio

    from firable.cli.view.playing import application
    from firable.cli.view.site import Opening
    from firable.executor.operating.control import Endpoint, listening, new_token

    endpoint = Endpoint("127.0.0.1", port, new_token())
    opening = Opening(endpoint.token)
    async with listening(application(editing.playing, endpoint, editing.routes(), opening), endpoint) as address:
        show(address, opening, open_it=open_it)
        await asyncio.Event().wait()


def show(address: str, opening: Opening, *, open_it: bool) -> None:
    """Tell where a page is that is served at an address, and open a browser on it if that is wanted."""
    click.echo(f"see it at {address}/#token={opening.token}", err=True)
    if open_it:
        import webbrowser

        webbrowser.open(f"{address}{opening.path}")
