"""Fits: parameters of pilots and of any system, from recorded runs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from . import _pilotage
from ._call import Left, PathLike, Progress, call, cleaned, following, listen, pairs, words
from ._errors import Error, InputError, Interrupted
from ._tables import Array, Files, Table

if TYPE_CHECKING:
    from distributed import Client
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Diagnostic(NamedTuple):
    """A reason to doubt a fit."""

    code: str
    words: str


class Fit:
    """What a fit found.

    Attributes
    ----------
    json : dict
        All that `pilotage fit --json` prints (docs/json.md).
    converged : bool
        Whether it is an answer.
    verdict : str
        How it ended, in a sentence.
    summary : str
        What the command prints.
    runs : dict of Table
        For each run what was recorded (`recorded NAME`) and what the model says (`model NAME`), the residuals in standard
        deviations (`residual NAME`), and the states (`state INSTANCE.NAME`).
    models : dict of str
        The fitted models, as text of model files, by the names of their files.
    """

    def __init__(self, left: Left, models: Mapping[str, str], recipe: Recipe) -> None:
        self.json: dict[str, Any] = left.json()
        self.converged: bool = self.json["converged"]
        self.verdict = left.texts.get("verdict", self.json["status"])
        self.summary = left.texts.get("summary", "")
        self.runs = starting(left.tables, "run ")
        self.models = dict(models)
        self._paths = starting(left.tables, "path ")
        self._loops = starting(left.tables, "loop ")
        self._recipe = recipe

    def __repr__(self) -> str:
        return f"Fit: {self.verdict}\n{self.summary}"

    def __eq__(self, other: object) -> bool:
        """Whether the data are the same, and the result bit by bit."""
        if not isinstance(other, Fit):
            return NotImplemented
        return without_time(self.json) == without_time(other.json) and self.runs == other.runs

    __hash__ = None  # type: ignore[assignment]

    @property
    def params(self) -> Any:
        """The parameters: a pandas.DataFrame with the columns value, sd, low, high (95 % interval), class and unit,
        indexed by name; without pandas a structured array with the field `name`."""
        return estimates(self.json["parameters"])

    @property
    def derived(self) -> Any:
        """What follows from the parameters, such as crossover frequency and margins: a frame as `params`."""
        return estimates(self.json["derived"])

    @property
    def values(self) -> dict[str, float]:
        """The estimates alone, by name."""
        return {str(row[0]): float(row[1]) for row in rows(self.json["parameters"])}

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """The reasons to doubt the fit, the most severe first (docs/problems.md)."""
        return [Diagnostic(own["code"], own["words"]) for own in self.json["doubts"]]

    @property
    def residuals(self) -> dict[str, Table]:
        """The residuals of each run, in standard deviations."""
        return {name: run.starting("residual ") for name, run in self.runs.items()}

    @property
    def states(self) -> dict[str, Table]:
        """The states of each run at its samples, in their units."""
        return {name: run.starting("state ") for name, run in self.runs.items()}

    @property
    def cov_names(self) -> list[str]:
        """The parameters of the rows of `cov`; `ln NAME` is the logarithm."""
        return list(self.json["uncertainty"].get("parameters", []))

    @property
    def cov(self) -> NDArray[np.float64]:
        """The covariance of the shared parameters.

        Raises
        ------
        Error
            With the reason why there is none.
        """
        own = self.json["uncertainty"]
        if "covariance" not in own:
            raise Error(f"no covariance: {own['reason']}")
        return numbers(own["covariance"])

    def save(self, path: PathLike, model: str | None = None) -> None:
        """Writes the file of a fitted model, which every command takes.

        Parameters
        ----------
        path : path
        model : str, optional
            Which one, where several were fitted: a key of `models`.
        """
        Path(path).write_text(self._model(model), encoding="utf-8")

    def export(self, path: PathLike, model: str | None = None, **options: object) -> None:
        """Writes a fitted model as an FMU.

        Parameters
        ----------
        path : path
        model : str, optional
            Which one, where several were fitted: a key of `models`.
        **options
            Flags of `pilotage export`, such as `fmi=3` or `allow_unconverged=True`.
        """
        from ._tools import export

        files = Files()
        export(files.text("pilot.toml", self._model(model)), path, **options)

    def _model(self, name: str | None) -> str:
        names = ", ".join(self.models)
        if name is None and len(self.models) == 1:
            return next(iter(self.models.values()))
        if name is None:
            raise InputError(f"the fit has {len(self.models)} models: {names}", "say which: model=...")
        try:
            return self.models[name]
        except KeyError:
            raise InputError(f"no fitted model is called `{name}`; there are {names}") from None

    def frequency_response(self) -> dict[str, tuple[Array, NDArray[np.complex128]]]:
        """Frequencies [rad/s] and responses: of each path through the pilot (`FROM -> TO`), then of each open loop
        (`loop OUTPUT`), linear where the first run ends."""
        loops = {f"loop {name}": own for name, own in self._loops.items()}
        return {
            name: (own.time, own["real"] + 1j * own["imaginary"])
            for name, own in {**self._paths, **loops}.items()
        }

    def plot(self, fig: Figure | None = None) -> Figure:
        """Draws what was recorded and what the model says, an axis for each measured signal.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from matplotlib import pyplot

        first = next(iter(self.runs.values()))
        names = list(first.starting("model "))
        if fig is None:
            fig = pyplot.figure(figsize=(7, 3 * len(names)))
        for k, name in enumerate(names):
            ax = fig.add_subplot(len(names), 1, k + 1)
            for run in self.runs.values():
                ax.plot(run.time, run[f"recorded {name}"], ".", color="0.6", markersize=2)
                ax.plot(run.time, run[f"model {name}"], linewidth=1)
            ax.set_ylabel(f"{name} [{first.units[f'model {name}']}]")
            ax.set_xlabel("time [s]")
        return fig

    def bode(self, fig: Figure | None = None) -> Figure:
        """Draws magnitude and phase of the pilot and of the open loops.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from matplotlib import pyplot

        if fig is None:
            fig = pyplot.figure(figsize=(7, 5))
        magnitude, phase = fig.subplots(2, 1, sharex=True)
        for name, (omega, value) in self.frequency_response().items():
            magnitude.loglog(omega, np.abs(value), label=name)
            phase.semilogx(omega, np.degrees(np.unwrap(np.angle(value))))
        magnitude.set_ylabel("magnitude")
        phase.set_ylabel("phase [deg]")
        phase.set_xlabel("frequency [rad/s]")
        magnitude.legend()
        return fig

    def bootstrap(self, n: int = 200, **options: Any) -> Any:
        """Refits replicates of the runs: `pilotage.bootstrap` of this fit."""
        return bootstrap(self, n, **options)

    def to_control(self, model: str | None = None) -> Any:
        """A fitted model, linear where it starts, as a control.StateSpace."""
        from ._linear import linearize
        from ._system import System

        system = System().add("model", self, model)
        return linearize(system).to_control()

    def _repr_html_(self) -> str:
        from ._html import of_fit

        return of_fit(self)


class Recipe:
    """What a fit was made of, so that it can be made again with other flags."""

    def __init__(self, data: Any, flags: Mapping[str, object]) -> None:
        self.data = data
        self.flags = dict(flags)

    def run(self, progress: Progress = False, **more: object) -> Fit:
        arguments, finish = self.ready(**more)
        return finish(call("fit", arguments, finish, progress=progress))

    def ready(self, **more: object) -> tuple[list[str], Callable[[Left], Fit]]:
        """The words of the command, and what makes a fit of what it leaves."""
        files = Files()
        flags = {**self.flags, **more}
        given = [str(self.data)] if is_problem(self.data) else files.runs(self.data)
        target: Path = files.path / "models"
        target.mkdir()
        # A problem names several models, flights one.
        output = f"{target}/" if is_problem(self.data) else str(target / "pilot.toml")

        def finish(left: Left) -> Fit:
            # Which keeps the files until then.
            written = files.path / "models"
            found = sorted(path for path in written.rglob("*") if path.is_file())
            models = [path for path in found if path.suffix == ".toml"]
            texts = {path.stem: cleaned(path.read_text(encoding="utf-8")) for path in models}
            return Fit(left, texts, self)

        return words(*given, json=True, output=output, **flags), finish

    def __getstate__(self) -> dict[str, Any]:
        # Runs as they are; of a problem the path.
        return {"data": self.data, "flags": self.flags}


def is_problem(data: Any) -> bool:
    return isinstance(data, str | Path) and str(data).endswith(".toml")


def fit(
    runs: Any,
    *,
    vehicle: PathLike | None = None,
    order: int | None = None,
    initial_state: str | None = None,
    start: Mapping[str, float] | None = None,
    covariance: str | None = None,
    time_limit: float | None = None,
    progress: Progress = False,
    **options: object,
) -> Fit:
    """Identifies a pilot from recorded flights, or whatever a problem file seeks.

    Parameters
    ----------
    runs : path, Run, DataFrame, dict of arrays, or a list of these
        Flights with the signals time [s], target [m], position [m] and, if it was recorded, stick; or one problem file.
    vehicle : path, optional
        File of the vehicle that was flown; the default vehicle if it is None or "quadcopter".
    order : int, optional
        Order of the pilot.
    initial_state : {"free", "at-rest"}, optional
        How the flights begin.
    start : dict, optional
        Values of parameters at which the search begins.
    covariance : {"plain", "sidpac", "ar", "cr3"}, optional
        How the intervals are made.
    time_limit : float, optional
        After this time [s] the best so far is the result.
    progress : bool or callable
        As in `simulate`.
    **options
        All other flags of `pilotage fit`, with underscores: `random_starts=20`, `leave_one_out=True`.

    Returns
    -------
    Fit
        Also one that did not converge: look at `converged`, `verdict` and `diagnostics`.

    Raises
    ------
    InputError
        If runs, vehicle or problem cannot be used.
    Interrupted
        With the best so far as its `result`.
    """
    given = {"order": order, "initial_state": initial_state, "covariance": covariance, "time_limit": time_limit}
    return recipe(runs, {"vehicle": vehicle, "start": start, **given, **options}).run(progress)


def recipe(runs: Any, given: Mapping[str, Any]) -> Recipe:
    """Of the arguments of `fit`."""
    flags = dict(given)
    if flags.get("vehicle") == "quadcopter":
        del flags["vehicle"]
    flags["start"] = ",".join(pairs(flags.get("start"))) or None
    return Recipe(runs, flags)


@dataclass(repr=False)
class Fits:
    """Fits of several problems.

    Attributes
    ----------
    names : list of str
        The keys that were given, the paths, or numbers from 0.
    fits : list of (Fit or None)
        None where a problem could not be fitted.
    reasons : list of (str or None)
        Why.
    """

    names: list[str]
    fits: list[Fit | None]
    reasons: list[str | None]

    def __len__(self) -> int:
        return len(self.fits)

    def __getitem__(self, key: int | str) -> Fit | None:
        """The fit of this number or name."""
        return self.fits[self.names.index(key) if isinstance(key, str) else key]

    def __repr__(self) -> str:
        each = zip(self.names, self.fits, self.reasons, strict=True)
        return "\n".join(f"{name}: {fit.verdict if fit else reason}" for name, fit, reason in each)

    def to_frame(self) -> Any:
        """A pandas.DataFrame with a row for each problem: whether it converged, the estimates, and why there are none."""
        import pandas

        rows = [
            {"converged": bool(fit and fit.converged), **(fit.values if fit else {}), "reason": reason}
            for fit, reason in zip(self.fits, self.reasons, strict=True)
        ]
        return pandas.DataFrame(rows, index=pandas.Index(self.names, name="problem"))


def fit_many(
    problems: Mapping[str, Any] | Sequence[Any],
    *,
    client: Client | None = None,
    progress: Progress = False,
    **options: Any,
) -> Fits:
    """Fits several problems, each by itself: on all cores, or on all workers of a cluster.

    Parameters
    ----------
    problems : dict or list
        For each problem what `fit` takes: a problem file, runs, or a list of runs.
    client : distributed.Client, optional
        A Dask cluster. The fits are the same, bit by bit, as on this machine.
    progress : bool or callable
        As in `simulate`.
    **options
        Of `fit`, for all of them.

    Returns
    -------
    Fits
        One that cannot be made is a row with its reason.
    """
    named = isinstance(problems, Mapping)
    given = list(problems.values()) if isinstance(problems, Mapping) else list(problems)
    names = list(problems) if named else [str(own) if is_problem(own) else str(k) for k, own in enumerate(given)]
    found = Fits([str(name) for name in names], [None] * len(given), [None] * len(given))
    ready: dict[int, tuple[list[str], Callable[[Left], Fit]]] = {}
    for k, own in enumerate(given):
        try:
            ready[k] = recipe(own, options).ready()
        except (Error, OSError) as error:
            found.reasons[k] = str(error)
    with following(progress) as told:
        try:
            for count, (k, run) in enumerate(each(client, {k: own[0] for k, own in ready.items()}), 1):
                try:
                    found.fits[k] = ready[k][1](listen(run))
                except Error as error:
                    found.reasons[k] = error.message
                if told is not None:
                    told(count, len(ready))
        except KeyboardInterrupt:
            stopped = Interrupted("stopped by Ctrl-C")
            stopped.result = found
            raise stopped from None
    return found


def each(
    client: Client | None, arguments: Mapping[int, list[str]]
) -> Iterable[tuple[int, Callable[[], _pilotage._Left]]]:
    """The numbers of fits, as they end, with what they left: here, or on a cluster."""
    every = {k: ["fit", *own] for k, own in arguments.items()}
    if client is not None:
        from . import _cluster

        numbers = list(every)
        for k, done in _cluster.run(client, list(every.values())):
            yield numbers[k], lambda done=done: _cluster.result(done)  # type: ignore[misc]
        return
    pool = ThreadPoolExecutor(len(os.sched_getaffinity(0)))
    try:
        futures = {pool.submit(_pilotage.call, own): k for k, own in every.items()}
        for future in as_completed(futures):
            yield futures[future], future.result
    finally:
        # Of those that have begun nobody waits for the end.
        pool.shutdown(wait=False, cancel_futures=True)


def profile(fit: Fit, *parameters: str, progress: Progress = False, **options: object) -> dict[str, Table]:
    """Profiles of the objective: each parameter held at values around its estimate, all others fitted again.

    Parameters
    ----------
    fit : Fit
    *parameters : str
        Names of parameters; all of them if none is given.
    progress : bool or callable
        As in `simulate`.
    **options
        Flags of `pilotage fit`.

    Returns
    -------
    dict of Table
        For each parameter `objective` and `root` (the signed root of its rise) over the values, which are the `time` of
        the table; `low`, `high` and `class` are in its attribute `interval`.
    """
    again = fit._recipe.run(progress, profile=",".join(parameters) or True, **options)
    found: dict[str, Table] = {}
    for name, own in again.json["parameters"].items():
        if "profile" not in own:
            continue
        labelled = own["profile"]
        each = {name: labelled} if "points" in labelled else {
            f"{name} ({label})": one for label, one in labelled.items()
        }
        for full, one in each.items():
            points = one["points"]
            columns = {key: numbers([point[key] for point in points]) for key in ("objective", "root")}
            table = Profile(numbers([point["value"] for point in points]), columns)
            table.interval = {key: one[key] for key in ("low", "high", "class")}
            found[full] = table
    if not found:
        raise Error(f"there are no profiles: {again.verdict}")
    return found


class Profile(Table):
    """A profile of the objective; its `time` are the values of the parameter."""

    interval: dict[str, Any]


def bootstrap(
    fit: Fit,
    n: int = 200,
    *,
    seed: int = 1,
    client: Client | None = None,
    progress: Progress = False,
    **options: object,
) -> Any:
    """Refits replicates of the runs.

    Parameters
    ----------
    fit : Fit
    n : int
        Number of replicates.
    seed : int
        Of the random numbers; those of a replicate depend on it and on the replicate's number alone.
    client : distributed.Client, optional
        A Dask cluster. The result is the same, bit by bit, as on this machine.
    progress : bool or callable
        As in `simulate`.
    **options
        Flags of `pilotage fit`.

    Returns
    -------
    pandas.DataFrame or structured array
        value, sd, low and high of each parameter, from the spread of the refits.
    """
    flags: dict[str, Any] = {**options, "bootstrap": n, "seed": seed}
    if client is None:
        again = fit._recipe.run(progress, **flags)
    else:
        # What is refitted already is not fitted again.
        files = Files()
        again = fit._recipe.run(**flags, resume=refits(client, fit, n, flags, files, progress))
    parameters = again.json["parameters"]
    return estimates({name: {**own, **own.get("bootstrap", {})} for name, own in parameters.items()})


def refits(
    client: Client, fit: Fit, n: int, flags: Mapping[str, Any], files: Files, progress: Progress
) -> Path:
    """Refits replicates on a cluster; gives the file of all of them."""
    from . import _cluster

    if "resume" in flags or "shard" in flags:
        raise InputError("`resume` and `shard` are not for a cluster", "leave them out")
    # Each part makes the fit first, so that there are few.
    number = min(n, max(_cluster.slots(client), n // 100))
    parts = [files.path / f"part-{own}.csv" for own in range(1, number + 1)]
    ready = [
        fit._recipe.ready(**flags, resume=part, shard=f"{own}/{number}") for own, part in enumerate(parts, 1)
    ]
    with following(progress) as told:
        count = 0
        for k, run in each(client, {k: own[0] for k, own in enumerate(ready)}):
            listen(run)
            count += len(range(k, n, number))
            if told is not None:
                told(count, n)
    whole = files.path / "refits.csv"
    whole.write_bytes(b"".join(part.read_bytes() for part in parts))
    return whole


def starting(tables: Mapping[str, Table], prefix: str) -> dict[str, Table]:
    return {name.removeprefix(prefix): own for name, own in tables.items() if name.startswith(prefix)}


def numbers(values: Sequence[Any]) -> NDArray[np.float64]:
    """An array; what JSON has as null is NaN."""
    return np.array(values, dtype=object).astype(np.float64)


Row = tuple[str, float, float, float, float, str, str]
COLUMNS = ("name", "value", "sd", "low", "high", "class", "unit")


def rows(parameters: Mapping[str, Any]) -> list[Row]:
    """A row for each value: parameters with values for runs or subjects have several."""
    found: list[Row] = []
    for name, own in parameters.items():
        value = own["value"]
        labels: list[str | None] = list(value) if isinstance(value, dict) else [None]
        for label in labels:
            cells = [own.get(key) if label is None else labelled(own.get(key), label) for key in COLUMNS[1:6]]
            full = name if label is None else f"{name} ({label})"
            real = [np.nan if cell is None else float(cell) for cell in cells[:4]]
            found.append((full, real[0], real[1], real[2], real[3], cells[4] or "", own.get("unit") or ""))
    return found


def labelled(cell: Any, label: str) -> Any:
    return cell.get(label) if isinstance(cell, dict) else cell


def estimates(parameters: Mapping[str, Any]) -> Any:
    """A frame, or without pandas a structured array."""
    found = rows(parameters)
    try:
        import pandas
    except ImportError:
        wide = max((len(row[0]) for row in found), default=1)
        kinds = [("name", f"U{wide}"), *((own, "f8") for own in COLUMNS[1:5]), ("class", "U12"), ("unit", "U32")]
        return np.array(found, dtype=kinds)
    return pandas.DataFrame.from_records(found, columns=list(COLUMNS), index="name")


def without_time(json: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in json.items() if key not in ("seconds", "notes")}
