"""Systems of models and FMUs, and their co-simulation."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from . import _pilotage
from ._call import Left, PathLike, Progress, following, listen, pairs, text, words
from ._errors import FmuError, InputError
from ._fit import Fit
from ._model import Model
from ._tables import Array, Files, Table, as_run

Source = PathLike | Model | Fit


class Result(Table):
    """The rows of a simulation.

    Attributes
    ----------
    status : str
        `completed`, `stopped`, `end-requested`, `discarded` or `failed`.
    notes : list of str
        What the command notes, such as inputs that nothing feeds.
    """

    status: str = "completed"
    notes: list[str] = []  # noqa: RUF012 (set for each)


class System:
    """Models and FMUs, wired together.

    Examples
    --------
    >>> system = pl.System.read("loop.toml")
    >>> system = pl.System().add("pilot", "pilot.fmu").add("vehicle", "quadcopter.fmu")
    >>> system.connect("pilot.stick", "vehicle.stick").connect("vehicle.z", "pilot.position")
    >>> system.set("pilot.target", 10)
    """

    def __init__(self) -> None:
        self.file: str | None = None
        self.models: list[tuple[str, str | tuple[str, str]]] = []
        self.connections: list[tuple[str, str]] = []
        self.settings: dict[str, object] = {}
        self._reset()

    def _reset(self) -> None:
        self._files: Files | None = None
        self._prepared: dict[str, _pilotage.Prepared] = {}
        self._lock = threading.Lock()

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in vars(self).items() if not key.startswith("_")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._reset()

    def __repr__(self) -> str:
        names = [self.file] if self.file else []
        names += [f"{name} = {source if isinstance(source, str) else source[0]}" for name, source in self.models]
        wires = [f"{a} -> {b}" for a, b in self.connections]
        return f"System({'; '.join([*names, *wires, *pairs(self.settings)])})"

    @classmethod
    def read(cls, path: PathLike) -> Self:
        """The system of a system file (docs/systems.md)."""
        system = cls()
        system.file = text(path)
        return system

    def add(self, name: str, source: Source, model: str | None = None) -> Self:
        """Adds an instance, or another model under the name of one of the file.

        Parameters
        ----------
        name : str
        source : path, str, Model or Fit
            An FMU, a pilot, vehicle or model file, or the name of a built-in model.
        model : str, optional
            Which model of a fit, where it has several.
        """
        own: str | tuple[str, str]
        match source:
            case Model():
                own = source.file if source.text is None else (source.name, source.text)
            case Fit():
                own = (name, source._model(model))
            case _:
                own = text(source)
        self.models.append((name, own))
        self._prepared.clear()
        return self

    def connect(self, output: str, input: str) -> Self:
        """Connects an output to an input, both `instance.variable`; units are converted."""
        self.connections.append((output, input))
        self._prepared.clear()
        return self

    def set(self, name: str, value: object) -> Self:
        """Sets a parameter, or an input that nothing feeds: for all runs from now on."""
        self.settings[name] = value
        return self

    def words(self) -> tuple[list[str], dict[str, object]]:
        """The system as positional words and flags of the command."""
        with self._lock:
            if self._files is None:
                self._files = Files()
            named = [self.file] if self.file else []
            for name, source in self.models:
                if not isinstance(source, str):
                    source = str(self._files.text(f"{name}.toml", source[1]))
                named.append(f"{name}={source}")
        if not named:
            raise InputError("the system has no models", "add them, or read a system file")
        return named, {"connect": [f"{a}={b}" for a, b in self.connections]}

    def prepared(self, flags: Mapping[str, object]) -> _pilotage.Prepared:
        """The opened system; opened once for the same flags."""
        key = repr(flags)
        known = self._prepared.get(key)
        if known is None:
            named, wiring = self.words()
            try:
                known = _pilotage.Prepared(words(*named, **wiring, **flags))
            except ValueError as error:
                raise InputError(str(error).removeprefix("error: ").strip()) from None
            with self._lock:
                # An opened system holds its FMUs: the last two are kept.
                while len(self._prepared) > 1:
                    del self._prepared[next(iter(self._prepared))]
                self._prepared[key] = known
        return known


def as_system(given: Any) -> System:
    """A system of whatever is one: of a single model the system with it alone."""
    match given:
        case System():
            return given
        case Model() | Fit():
            return System().add(getattr(given, "name", "model"), given)
        case _:
            path = text(given)
            return System.read(path) if path.endswith(".toml") else System().add(Path(path).stem, path)


def simulate(
    system: System | Source,
    *,
    stop_time: float | None = None,
    step: float | None = None,
    start_time: float = 0.0,
    algorithm: str | None = None,
    input: Any = None,
    set: Mapping[str, object] | None = None,
    record: list[str] | None = None,
    isolate: bool | list[str] = True,
    step_limit: float | None = None,
    memory_limit: float | None = None,
    progress: Progress = False,
    **options: object,
) -> Result:
    """Simulates a system.

    Parameters
    ----------
    system : System, path, Model or Fit
        A system, a system file, or a single model or FMU.
    stop_time : float, optional
        End [s]; what the FMUs suggest if it is None.
    step : float, optional
        Communication step [s]; what the system suggests, else a 500th of the run.
    algorithm : {"jacobi", "gauss-seidel", "strong"}, optional
        How values are exchanged (docs/cosim.md).
    input : Run, DataFrame, dict of arrays or path, optional
        Inputs over time: a column with the name of an input drives it.
    set : dict, optional
        Values of parameters and inputs for this run alone.
    record : list of str, optional
        Patterns of the signals to record; all outputs if it is None.
    isolate : bool or list of str
        Whether FMUs run in processes of their own, or which: an FMU that crashes, hangs or takes too much memory then ends
        this run alone. Many short runs are faster without.
    step_limit, memory_limit : float, optional
        What a call to an isolated FMU may take [s], and its process [MB].
    progress : bool or callable
        Shows how far it is: by a bar of tqdm, or by a function that is called with what is done and what there is.
    **options
        All other flags of `pilotage cosim`: `tolerance=1e-4`, `kind="me"`, `record_every=0.1`.

    Returns
    -------
    Result
        A column `instance.variable` for each recorded signal.

    Raises
    ------
    InputError
        If the system cannot be opened or wired.
    FmuError
        If an FMU failed; `result` has the rows until then.
    Interrupted
        With the rows so far.
    """
    system = as_system(system)
    isolated = "all" if isolate is True else ",".join(isolate or []) or None
    flags: dict[str, object] = {
        "stop_time": stop_time,
        "step": step,
        "start_time": start_time or None,
        "algorithm": algorithm,
        "record": record,
        "isolate": isolated,
        "step_limit": step_limit if isolated else None,
        "memory_limit": memory_limit if isolated else None,
        "json": True,
        **options,
    }
    files = Files() if input is not None and not isinstance(input, str | Path) else None
    if input is not None:
        table = text(input) if files is None else str(files.path / "input.csv")
        if files is not None:
            as_run(input, "input").write(table)
        flags["input"] = f"input={table}"
    settings = {**system.settings, **(set or {})}
    return run_prepared(system.prepared(flags), settings, progress)


def run_prepared(prepared: _pilotage.Prepared, settings: Mapping[str, object], progress: Progress = False) -> Result:
    given = [(name, text(value)) for name, value in settings.items()]
    with following(progress) as told:
        left = listen(lambda: prepared.run(given, told), result, accepted=(0, 1))
    own = result(left)
    if left.code == 1 and own.status != "stopped":
        message = left.json()["message"] or "; ".join(own.notes)
        error = FmuError(message)
        error.result = own
        raise error
    return own


def result(left: Left) -> Result:
    """The rows that a run left."""
    summary = left.json()
    table = left.tables["result"]
    own = Result(table.time, table, table.units)
    own.status, own.notes = summary["status"], summary["notes"]
    return own


def simulate_fmu(
    filename: PathLike,
    start_time: float | None = None,
    stop_time: float | None = None,
    step_size: float | None = None,
    relative_tolerance: float | None = None,
    output_interval: float | None = None,
    fmi_type: str | None = None,
    start_values: Mapping[str, object] | None = None,
    input: Any = None,
    output: list[str] | None = None,
    timeout: float | None = None,
    isolate: bool = True,
) -> NDArray[np.void]:
    """Simulates one FMU, with FMPy's argument names.

    Parameters
    ----------
    filename : path
    start_time, stop_time : float, optional
        [s]; what the FMU suggests.
    step_size, output_interval : float, optional
        Communication step and interval of the rows [s]; what the FMU suggests, else a 500th of the time.
    relative_tolerance : float, optional
        For FMUs with error control.
    fmi_type : {"CoSimulation", "ModelExchange"}, optional
    start_values : dict, optional
        Parameters and inputs.
    input : structured array, DataFrame or dict of arrays, optional
        Inputs over `time`.
    output : list of str, optional
        The recorded variables; all outputs if it is None.
    timeout : float, optional
        What a call to the FMU may take [s].
    isolate : bool
        Whether the FMU runs in a process of its own.

    Returns
    -------
    structured array
        With the fields `time` and the names of the variables.
    """
    from ._tools import info

    experiment = info(filename).get("defaultExperiment") or {}
    start = start_time if start_time is not None else experiment.get("startTime") or 0.0
    stop = stop_time if stop_time is not None else experiment.get("stopTime") or 1.0
    rows = output_interval or step_size or experiment.get("stepSize") or (stop - start) / 500
    step = step_size or rows
    name = "fmu"
    system = System().add(name, filename)
    kinds = {"CoSimulation": "cs", "ModelExchange": "me", None: None}
    if fmi_type not in kinds:
        raise InputError(f'fmi_type is "{fmi_type}"', 'there are "CoSimulation" and "ModelExchange"')
    found = simulate(
        system,
        start_time=start,
        stop_time=stop,
        step=step,
        record_every=rows if rows != step else None,
        fmu_tolerance=relative_tolerance,
        kind=kinds[fmi_type],
        set=start_values,
        input=input,
        record=[f"{name}.{own}" for own in output] if output else None,
        isolate=isolate,
        step_limit=timeout,
    )
    columns: dict[str, Array] = {own.removeprefix(f"{name}."): values for own, values in found.items()}
    return Table(found.time, columns).to_numpy()
