r"""The net model, its text format, PNML, diagnostics, the bundle format and the catalogue of example cells.

What a program imports from here. To read and to write: `load` reads a net from whatever file it is in, as `Loaded`;
`read_net`, `parse_net` and `format_net` know the net file, `read_pnml` and `write_pnml` PNML. `catalogue_net` gives one
of the example cells in `catalogue_names`.

    from firable.nets import InputError, load

    try:
        net = load("cell.firable.yaml").net
    except InputError as error:
        print(*error.diagnostics, sep="\n")

To build: a `Net` is made of `Controller`, `Place` with its `Command` and perhaps a `TimeLimit` (in a conceptual net
with a `TaskUse` or a `Resource`), `Signal` of a `SignalKind`, `Transition` with each `ExternalGate`, `Arbiter` with its
`ArbitrationRule`, and `Property` with its `PropertyKind` and `Fairness`, whose formula `parse_formula` reads and
`format_formula` prints (`FormulaError` where it is none). A net that exists is well formed; what is wrong with an input
is an `InputError`, each `Diagnostic` with its `Severity` and its `Span`. `net_digest` tells nets apart.

To pass on: a `Verdict` has a `Status`, never a bare Boolean, a `Weight` and perhaps a `Witness`. A `Bundle` holds a
`Decomposition` with the verdicts on it: `read_bundle`, `write_bundle`.

The names are loaded when they are asked for: who needs the records alone loads neither YAML nor pydantic.
"""

from typing import TYPE_CHECKING, Final

from firable.nets.lazy import loaded_when_asked

if TYPE_CHECKING:
    from firable.nets.bundle import Bundle, read_bundle, write_bundle
    from firable.nets.catalogue import catalogue_names, catalogue_net
    from firable.nets.decomposition import Decomposition
    from firable.nets.diagnostics import Diagnostic, InputError, Severity, Span
    from firable.nets.formula import FormulaError, format_formula, parse_formula
    from firable.nets.interchange import net_digest
    from firable.nets.loading import Loaded, load
    from firable.nets.net import (
        Arbiter,
        ArbitrationRule,
        Command,
        Controller,
        ExternalGate,
        Fairness,
        Net,
        Place,
        Property,
        PropertyKind,
        Resource,
        Signal,
        SignalKind,
        TaskUse,
        TimeLimit,
        Transition,
    )
    from firable.nets.pnml import read_pnml
    from firable.nets.pnml_writer import write_pnml
    from firable.nets.printing import format_net
    from firable.nets.text import parse_net, read_net
    from firable.nets.verdict import Status, Verdict, Weight, Witness

__all__ = [
    "Arbiter",
    "ArbitrationRule",
    "Bundle",
    "Command",
    "Controller",
    "Decomposition",
    "Diagnostic",
    "ExternalGate",
    "Fairness",
    "FormulaError",
    "InputError",
    "Loaded",
    "Net",
    "Place",
    "Property",
    "PropertyKind",
    "Resource",
    "Severity",
    "Signal",
    "SignalKind",
    "Span",
    "Status",
    "TaskUse",
    "TimeLimit",
    "Transition",
    "Verdict",
    "Weight",
    "Witness",
    "catalogue_names",
    "catalogue_net",
    "format_formula",
    "format_net",
    "load",
    "net_digest",
    "parse_formula",
    "parse_net",
    "read_bundle",
    "read_net",
    "read_pnml",
    "write_bundle",
    "write_pnml",
]

_MODULES: Final = {
    "bundle": ("Bundle", "read_bundle", "write_bundle"),
    "catalogue": ("catalogue_names", "catalogue_net"),
    "decomposition": ("Decomposition",),
    "diagnostics": ("Diagnostic", "InputError", "Severity", "Span"),
    "formula": ("FormulaError", "format_formula", "parse_formula"),
    "interchange": ("net_digest",),
    "loading": ("Loaded", "load"),
    "net": (
        *(
            "Arbiter",
            "ArbitrationRule",
            "Command",
            "Controller",
            "ExternalGate",
            "Fairness",
            "Net",
            "Place",
            "Property",
        ),
        *("PropertyKind", "Resource", "Signal", "SignalKind", "TaskUse", "TimeLimit", "Transition"),
    ),
    "pnml": ("read_pnml",),
    "pnml_writer": ("write_pnml",),
    "printing": ("format_net",),
    "text": ("parse_net", "read_net"),
    "verdict": ("Status", "Verdict", "Weight", "Witness"),
}

if not TYPE_CHECKING:  # type checkers read the imports above, and so see a name that is misspelt
    __getattr__ = loaded_when_asked(__name__, _MODULES)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
