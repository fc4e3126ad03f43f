"""pilotage: how a human pilot acts on a vehicle, identified, and handed on as an FMU.

The functions are those of the command, in the words of NumPy, SciPy, pandas and FMPy:

>>> import pilotage as pl
>>> fit = pl.fit([pl.read_run(file) for file in files])
>>> fit.params
>>> fit.export("pilot.fmu")

The guide is docs/python.md. Errors are exceptions with the command's words (`Error` and those derived from it), its
warnings are `PilotageWarning`. Long calls let other threads run; Ctrl-C stops them with what they have (`Interrupted`).
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._errors import Error, FmuError, InputError, Interrupted, PilotageWarning
    from ._fit import Diagnostic, Fit, Fits, bootstrap, fit, fit_many, profile
    from ._linear import Linearization, linearize
    from ._model import Model
    from ._sweep import Study, merge, sweep
    from ._system import Result, System, simulate, simulate_fmu
    from ._tables import Run, Table, read_run
    from ._tools import (
        Finding,
        compare,
        excitation,
        export,
        hv,
        info,
        init,
        optimise,
        synth,
        validate,
        version,
    )

# Modules are imported when they are first used: the command needs none of them, and no NumPy.
_HOMES = {
    "_errors": ("Error", "FmuError", "InputError", "Interrupted", "PilotageWarning"),
    "_fit": ("Diagnostic", "Fit", "Fits", "bootstrap", "fit", "fit_many", "profile"),
    "_linear": ("Linearization", "linearize"),
    "_model": ("Model",),
    "_sweep": ("Study", "merge", "sweep"),
    "_system": ("Result", "System", "simulate", "simulate_fmu"),
    "_tables": ("Run", "Table", "read_run"),
    "_tools": (
        "Finding",
        "compare",
        "excitation",
        "export",
        "hv",
        "info",
        "init",
        "optimise",
        "synth",
        "validate",
        "version",
    ),
}

__all__ = [
    "Diagnostic",
    "Error",
    "Finding",
    "Fit",
    "Fits",
    "FmuError",
    "InputError",
    "Interrupted",
    "Linearization",
    "Model",
    "PilotageWarning",
    "Result",
    "Run",
    "Study",
    "System",
    "Table",
    "bootstrap",
    "compare",
    "excitation",
    "export",
    "fit",
    "fit_many",
    "hv",
    "info",
    "init",
    "linearize",
    "merge",
    "optimise",
    "profile",
    "read_run",
    "simulate",
    "simulate_fmu",
    "sweep",
    "synth",
    "validate",
    "version",
]


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            value = getattr(import_module(f".{home}", __name__), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
