"""Many runs of a system with other values, and what their measures depend on (docs/sweep.md)."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ._call import Left, PathLike, Progress, call, cleaned, following, listen, pairs, text, words
from ._errors import InputError
from ._system import Source, System, as_system
from ._tables import Array, Files, real

if TYPE_CHECKING:
    import pandas
    from distributed import Client


@dataclass(eq=False, repr=False)
class Study:
    """The samples of a study.

    Attributes
    ----------
    values : dict of ndarray of float, shape (n,)
        What was varied, by name.
    measures : dict of ndarray of float, shape (n,)
        What was measured; NaN where a sample failed or has no such number.
    reasons : list of (str or None)
        Why a sample failed.
    summary : dict
        What sweep.json has: quantiles, rank correlations or Sobol' indices with intervals.
    """

    values: dict[str, Array]
    measures: dict[str, Array]
    reasons: list[str | None]
    summary: dict[str, Any]

    def __len__(self) -> int:
        return len(self.reasons)

    def __eq__(self, other: object) -> bool:
        """Whether both have the same bits."""
        if not isinstance(other, Study):
            return NotImplemented
        mine, theirs = ((*own.values.items(), *own.measures.items()) for own in (self, other))
        same = len(mine) == len(theirs) and all(
            a == b and np.array_equal(x, y, equal_nan=True) for (a, x), (b, y) in zip(mine, theirs, strict=True)
        )
        return same and self.reasons == other.reasons

    def __repr__(self) -> str:
        lines = [f"Study of {len(self)} samples, {sum(own is not None for own in self.reasons)} failed; 5 %, 50 % and 95 % of"]
        for own in self.summary.get("measures", []):
            quantiles = own["quantiles"] or {}
            found = [quantiles.get(part) for part in ("0.05", "0.5", "0.95")]
            values = ", ".join(f"{value:.5g}" for value in found if value is not None)
            lines.append(f"  {own['name']}: {values or 'no values'}")
        return "\n".join(lines)

    def to_frame(self) -> pandas.DataFrame:
        """A DataFrame with a row for each sample; needs pandas."""
        import pandas

        return pandas.DataFrame({**self.values, **self.measures, "reason": self.reasons})


def sweep(
    system: System | Source,
    vary: Mapping[str, object] | None = None,
    *,
    step: float | None = None,
    stop_time: float | None = None,
    measure: Mapping[str, str] | Sequence[str] | None = None,
    table: Any = None,
    set: Mapping[str, object] | None = None,
    output: PathLike | None = None,
    isolate: bool | list[str] = True,
    client: Client | None = None,
    progress: Progress = False,
    **options: object,
) -> Study:
    """Simulates a system many times, on all cores, or on all workers of a cluster.

    Parameters
    ----------
    system : System, path, Model or Fit
        A system, a system file, or a single model or FMU.
    vary : dict, optional
        For each name a list of values, `"0.8:1.6:9"`, a law such as `"normal(1.2, 0.1)"`, or for an instance `"fit"`.
    step, stop_time : float, optional
        Communication step and end [s]; what the system suggests, else a 500th of the run.
    measure : dict or list of str, optional
        Expressions such as `"rms(vehicle.z - 10)"`, with names in a dict; the last values of all outputs if it is None.
    table : DataFrame, dict of arrays or path, optional
        The samples, instead of `vary`.
    set : dict, optional
        Values of parameters and inputs for all runs.
    output : path, optional
        Folder of the page and the tables; a study that was stopped goes on in it, also on a cluster.
    isolate : bool or list of str
        Whether FMUs run in processes of their own, or which. Many short runs are faster without.
    client : distributed.Client, optional
        A Dask cluster. The study has the same bytes as on this machine.
    progress : bool or callable
        As in `simulate`.
    **options
        Flags of `pilotage sweep`: `method="saltelli"`, `samples=256`, `seed=2`, `algorithm="strong"`, `scenario="lost.toml"`,
        `trajectories=True`, which `output` is to have.

    Returns
    -------
    Study

    Raises
    ------
    InputError, FmuError
    Interrupted
        The samples that are done are in `output`, if it was given.
    """
    system = as_system(system)
    files = Files()
    folder = Path(output) if output is not None else files.path / "sweep"
    named, wiring = system.words()
    given = {**system.settings, **(set or {})}
    flags = {
        **wiring,
        "set": pairs(given),
        "vary": [varied(name, own) for name, own in (vary or {}).items()],
        "table": samples(table, files),
        "measure": measures(measure),
        "step": step,
        "stop_time": stop_time,
        "isolate": "all" if isolate is True else ",".join(isolate or []) or None,
        "json": True,
        **options,
    }
    if client is None:
        left = call("sweep", words(*named, **flags, output=folder), progress=progress)
    else:
        for own in ("shard", "time_limit"):
            if flags.pop(own, None) is not None:
                raise InputError(f"`{own}` is not for a cluster", "leave it out")
        force = bool(flags.pop("force", False))
        parts = folder / "parts"
        if not force and folder.is_dir() and any(own != parts for own in folder.iterdir()):
            raise InputError(f"the folder {folder} is not empty", "name another one, or overwrite with force=True")
        if force:
            shutil.rmtree(parts, ignore_errors=True)
        on_cluster(client, lambda **more: words(*named, **flags, **more), files.path, parts, progress)
        left = call("merge", words(parts, output=folder, force=True, json=True))
        shutil.rmtree(parts)
    return study(left, folder)


# A part of a study is to last so long [s].
LEAST = 0.2
# So many parts that the first one has the first sample alone.
MOST = 1 << 40


def on_cluster(
    client: Client, flags: Callable[..., list[str]], folder: Path, parts: Path, progress: Progress
) -> None:
    """Simulates the samples in parts, which another folder keeps; goes on with those that it has."""
    from . import _cluster

    def words_of(own: int, of: int) -> list[str]:
        return ["sweep", *flags(shard=f"{own}/{of}", output=folder / f"{own}-{of}")]

    def rows(own: int, of: int) -> Path:
        return next((folder / f"{own}-{of}").glob("*.txt"))

    with following(progress) as told:
        # What the first sample costs tells how many make a part.
        ((_, first),) = _cluster.run(client, [words_of(1, MOST)])
        said = listen(lambda: _cluster.result(first)).json()
        count, total = said["of"], said["of"] * said["seconds"]
        besides = getattr(first, "seconds", 0.0) - said["seconds"]
        # What a part costs besides its samples is to be little, but each worker is to have three.
        least = max(LEAST, min(10 * besides, total / (3 * _cluster.slots(client))))
        number = min(count, max(2, int(total / least)))
        known = sorted(parts.glob("shard-*-of-*.txt"))
        if known:
            if plan(known[0]) != plan(rows(1, MOST)):
                raise InputError(f"another study was stopped in {parts.parent}", "force=True begins anew")
            number = int(known[0].stem.rpartition("-")[2])
        parts.mkdir(parents=True, exist_ok=True)
        names = {own.name for own in known}
        missing = [own for own in range(1, number + 1) if f"shard-{own}-of-{number}.txt" not in names]
        samples_done = count - sum(len(range(own - 1, count, number)) for own in missing)
        for k, done in _cluster.run(client, [words_of(own, number) for own in missing]):
            samples_done += listen(lambda done=done: _cluster.result(done)).json()["samples"]  # type: ignore[misc]
            file = rows(missing[k], number)
            # Trajectories first: rows without theirs would count as done.
            traces = file.with_suffix(".bin")
            if traces.is_file():
                shutil.move(traces, parts / traces.name)
            shutil.move(file, parts / file.name)
            if told is not None:
                told(samples_done, count)


def plan(part: Path) -> str:
    """The first line of a part: all that its numbers depend on."""
    with part.open(encoding="utf-8") as text_of:
        return text_of.readline()


def merge(parts: Sequence[PathLike], output: PathLike) -> Study:
    """Joins the folders that `sweep(..., shard="1/3", output=...)` made on one machine or several."""
    return study(call("merge", words(*parts, output=output, json=True)), Path(output))


def varied(name: str, own: object) -> str:
    """Name and values as the command reads them."""
    if isinstance(own, str):
        is_law = own == "fit" or "(" in own
        return f"{name}{'~' if is_law else '='}{own}"
    values = np.atleast_1d(np.asarray(own))
    return f"{name}={','.join(text(value) for value in values.tolist())}"


def measures(given: Mapping[str, str] | Sequence[str] | None) -> list[str]:
    """Expressions, with their names."""
    match given:
        case None:
            return []
        case str():
            return [given]
        case Mapping():
            return [f"{name} = {own}" for name, own in given.items()]
        case _:
            return list(given)


def samples(given: Any, files: Files) -> str | None:
    """The file of a table of samples."""
    if given is None or isinstance(given, str | Path):
        return None if given is None else text(given)
    columns = {str(name): real(given[name], str(name)) for name in given}
    file = files.path / "samples.csv"
    with file.open("w", newline="", encoding="utf-8") as to:
        rows = csv.writer(to)
        rows.writerow(columns)
        rows.writerows(map(text, row) for row in zip(*columns.values(), strict=True))
    return str(file)


def study(left: Left, folder: Path) -> Study:
    """What the command wrote. A part of a study prints no summary, and has no table yet."""
    file = folder / "sweep.csv"
    if not file.is_file():
        return Study({}, {}, [], {})
    summary = left.json()
    with file.open(newline="", encoding="utf-8") as text_of:
        header, *rows = csv.reader(text_of)
    columns = list(zip(*rows, strict=True)) if rows else [()] * len(header)
    numbers = [np.array([float(cell or "nan") for cell in own]) for own in columns[1:-2]]
    count = len(summary["varied"])
    pairs_of = list(zip(header[1:-2], numbers, strict=True))
    return Study(dict(pairs_of[:count]), dict(pairs_of[count:]), [cleaned(cell) or None for cell in columns[-1]], dict(summary))
