"""The other commands: FMUs, problem files, comparisons, synthetic flights, optimal control."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from . import _pilotage
from ._call import Left, PathLike, Progress, call, pairs, text, words
from ._model import Model
from ._tables import Files, Run, read_run


class Finding(NamedTuple):
    """What a check of an FMU found.

    Attributes
    ----------
    fmu : str
        The FMU.
    severity : str
        `error` (it violates the standard), `warning` or `note`.
    message : str
        What is wrong.
    section : str
        Of the standard.
    file, line, variable : optional
        Where.
    """

    fmu: str
    severity: str
    message: str
    section: str | None
    file: str | None
    line: int | None
    variable: str | None


def version() -> str:
    """The version of pilotage."""
    return _pilotage.version()


def validate(*fmus: PathLike, run: bool = True, time_limit: float | None = None) -> list[Finding]:
    """Checks FMUs against the standard, and runs them in processes of their own.

    Parameters
    ----------
    *fmus : path
        FMUs, folders with unpacked ones, or system files.
    run : bool
        Whether the binaries are run.
    time_limit : float, optional
        Of each test of a binary [s].

    Returns
    -------
    list of Finding
        An FMU without an `error` among them is valid.
    """
    left = call("validate", words(*fmus, json=True, no_run=not run, time_limit=time_limit))
    return [
        Finding(own["file"], *(found[name] for name in Finding._fields[1:]))
        for own in left.json()["fmus"]
        for found in own["findings"]
    ]


def info(path: PathLike) -> dict[str, Any]:
    """What is in an FMU, a system file or a model file: interfaces, variables, units, structure."""
    return dict(call("info", words(path, json=True)).json())


def export(source: PathLike | Model, path: PathLike, **options: object) -> None:
    """Writes a model as an FMU.

    Parameters
    ----------
    source : path, str or Model
        A model, pilot or vehicle file, or the name of a built-in model.
    path : path
        The FMU.
    **options
        Flags of `pilotage export`: `fmi=3`, `author="..."`, `order=2`; for `"pilot"`, `preset="paper"`.
    """
    files = Files()
    if isinstance(source, Model):
        options = {"order": source.order, **options}
        source = source.file if source.text is None else files.text(f"{source.name}.toml", source.text)
    # `pilot` and `quadcopter` have flags of their own, which stand behind them.
    call("export", words(source) + words(output=path, **options), accepted=(0,))


def init(runs: Any, output: PathLike, **options: object) -> Path:
    """Writes a problem file for runs and models.

    Parameters
    ----------
    runs : path or list of paths
        The recorded runs, to which the file refers.
    output : path
        The problem file.
    **options
        Flags of `pilotage init`: `pilot="lead_lag"`, `vehicle="double_integrator"`, `model="tank.toml"`.

    Returns
    -------
    Path
        The file, for `fit`.
    """
    several = isinstance(runs, Sequence) and not isinstance(runs, str)
    given = list(runs) if several else [runs]
    call("init", words(*given, output=output, **options), accepted=(0,))
    return Path(output)


def compare(*problems: PathLike, time_limit: float | None = None) -> dict[str, Any]:
    """Selects one of several problem files on the same runs: by left-out runs, AICc and BIC."""
    return dict(call("compare", words(*problems, json=True, time_limit=time_limit)).json())


def excitation(runs: Any) -> dict[str, Any]:
    """How flights were excited: frequencies, coherence, and what lets doubt of them before any fit.

    Parameters
    ----------
    runs : path, Run, DataFrame, dict of arrays, or a list of these
    """
    files = Files()
    return dict(call("trials check", words(*files.runs(runs), json=True)).json())


def synth(folder: PathLike, **options: object) -> list[Run]:
    """Generates flights of a synthetic human.

    Parameters
    ----------
    folder : path
        Where the files go.
    **options
        Flags of `pilotage trials synth`: `targets="10,20"`, `runs=3`, `seed=4`, `delay=0.2`.

    Returns
    -------
    list of Run
    """
    call("trials synth", words(output=folder, **options), accepted=(0,))
    return [read_run(path) for path in sorted(Path(folder).glob("*.csv"))]


def optimise(problem: PathLike, **options: object) -> tuple[dict[str, Any], Run]:
    """The best inputs of a system, by an objective and constraints (docs/optimise.md).

    Parameters
    ----------
    problem : path
        A problem file with an [objective].
    **options
        Flags of `pilotage optimise`: `starts=5`, `no_refinement=True`, `time_limit=10`.

    Returns
    -------
    verdict : dict
        Status, objective, parameters, active constraints, certificate.
    trajectory : Run
        States, controls and other signals over time.
    """
    files = Files()
    table = files.path / "trajectory.csv"

    def finish(left: Left) -> tuple[dict[str, Any], Run]:
        return dict(left.json()), read_run(table)

    return finish(call("optimise", words(problem, json=True, output=table, **options), finish))


def hv(
    output: PathLike,
    helicopter: PathLike | None = None,
    *,
    pilot: PathLike | None = None,
    set: Mapping[str, float] | None = None,
    progress: Progress = False,
    **options: object,
) -> dict[str, Any]:
    """The height-velocity map of a helicopter after power loss (docs/hv.md).

    Parameters
    ----------
    output : path
        Folder of the page, the figure and the tables.
    helicopter : path, optional
        Model file; the built-in one if it is None.
    pilot : path, optional
        Pilot between command and rotor.
    set : dict, optional
        Parameters of the helicopter.
    progress : bool or callable
        As in `simulate`.
    **options
        Flags of `pilotage hv`: `speeds="0:24:3"`, `heights="2:150:12"`, `delay=0.5`.

    Returns
    -------
    dict
        What hv.json has.
    """
    given = [] if helicopter is None else [helicopter]
    flags = words(*given, json=True, output=output, pilot=pilot, set=pairs(set), **options)
    left = call("hv", flags, progress=progress)
    return dict(left.json())
