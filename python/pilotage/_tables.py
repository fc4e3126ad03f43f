"""Tables over time: arrays with names and units."""

from __future__ import annotations

import re
import shutil
import tempfile
import weakref
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from . import _pilotage
from ._call import FOLDER, PathLike
from ._errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]


class Table(Mapping[str, Array]):
    """Signals over a common time axis. `table["stick"]` is an array, `table.time` its times.

    Attributes
    ----------
    time : ndarray of float, shape (n,)
        Times [s]; of a frequency response the frequencies [rad/s].
    units : dict of str
        The unit of each signal, "" if it has none.
    """

    def __init__(
        self,
        time: Array,
        columns: Mapping[str, Array],
        units: Mapping[str, str] | None = None,
    ) -> None:
        self.time = time
        self._columns = dict(columns)
        self.units = {name: (units or {}).get(name, "") for name in self._columns}

    @classmethod
    def of(cls, native: _pilotage._Table) -> Self:
        """Of what native code gives; the memory is not copied."""
        time, columns = native
        arrays = {name: np.frombuffer(data) for name, _, data in columns}
        return cls(np.frombuffer(time), arrays, {name: unit for name, unit, _ in columns})

    def __getitem__(self, name: str) -> Array:
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Table):
            return NotImplemented
        return (
            self.units == other.units
            and np.array_equal(self.time, other.time)
            and all(np.array_equal(self[name], other[name], equal_nan=True) for name in self)
        )

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        names = ", ".join(heads(self.units))
        return f"{type(self).__name__}({len(self.time)} rows: {names})"

    def _repr_html_(self) -> str | None:
        try:
            return str(self.to_frame()._repr_html_())
        except ImportError:
            return None

    def starting(self, prefix: str) -> Table:
        """The signals whose names begin so, without that beginning."""
        own = {name.removeprefix(prefix): name for name in self if name.startswith(prefix)}
        columns = {short: self[name] for short, name in own.items()}
        return Table(self.time, columns, {short: self.units[name] for short, name in own.items()})

    def to_frame(self) -> Any:
        """A pandas.DataFrame, indexed by time; units are in `frame.attrs["units"]`."""
        import pandas

        frame = pandas.DataFrame(dict(self), index=pandas.Index(self.time, name="time"))
        frame.attrs["units"] = dict(self.units)
        return frame

    def to_numpy(self) -> NDArray[np.void]:
        """A structured array, with `time` first, as FMPy has it."""
        names = ["time", *self]
        rows = np.empty(len(self.time), dtype=[(name, np.float64) for name in names])
        rows["time"] = self.time
        for name, values in self.items():
            rows[name] = values
        return rows

    def plot(self, *names: str, ax: Axes | None = None) -> Axes:
        """Draws signals over time; all of them if none is named.

        Parameters
        ----------
        *names : str
        ax : matplotlib.axes.Axes, optional

        Returns
        -------
        matplotlib.axes.Axes
        """
        if ax is None:
            from matplotlib import pyplot

            ax = pyplot.subplots()[1]
        for name in names or self:
            ax.plot(self.time, self[name], label=head(name, self.units[name]))
        ax.set_xlabel("time [s]")
        ax.legend()
        return ax


class Run(Table):
    """A recorded run, or an input over time: a `Table` with a name and the comments of its file."""

    name: str = "run"
    comments: Sequence[str] = ()

    def write(self, path: PathLike) -> None:
        """Writes it as CSV, from which it reads back bit by bit."""
        columns = [(name, self.units[name], data(values)) for name, values in self.items()]
        try:
            _pilotage.write_table(path, list(self.comments), data(self.time), columns)
        except ValueError as error:
            raise InputError(str(error)) from None


def read_run(path: PathLike) -> Run:
    """Reads a recorded run.

    Parameters
    ----------
    path : path
        A CSV file with a column `time [s]` and others, with units in brackets.

    Returns
    -------
    Run

    Raises
    ------
    InputError
        With the place in the file.
    """
    try:
        comments, table = _pilotage.read_table(path)
    except ValueError as error:
        raise InputError(str(error)) from None
    run = Run.of(table)
    run.name, run.comments = Path(path).stem, comments
    return run


def as_run(given: Any, name: str = "run") -> Run:
    """A run of a path, a `Table`, a pandas.DataFrame, a structured array or a dict of arrays.

    Units stand in the names (`"position [m]"`) or in `attrs["units"]`. Times are the column `time`, or the index of a
    frame.
    """
    match given:
        case Run():
            return given
        case str() | Path():
            return read_run(given)
        case Table():
            columns: dict[str, Any] = {"time": given.time, **given}
            units = given.units
        case np.ndarray() if given.dtype.names:
            columns, units = {own: given[own] for own in given.dtype.names}, {}
        case Mapping():
            columns, units = dict(given), {}
        case _ if hasattr(given, "columns") and hasattr(given, "index"):
            columns = {str(own): given[own].to_numpy() for own in given.columns}
            if len(columns) < len(given.columns):
                raise InputError(f"{name} has two columns of one name")
            units = dict(given.attrs.get("units", {}))
            if not any(parts(own)[0] == "time" for own in columns):
                if type(given.index).__name__ == "RangeIndex":
                    hint = "add it in seconds, as a column or as the index"
                    raise InputError(f"{name} has no column `time`, and its index numbers the rows", hint)
                columns = {"time": given.index.to_numpy(), **columns}
        case _:
            raise InputError(
                f"{name} is {type(given).__name__}, and no path, DataFrame, structured array or dict of arrays"
            )
    time, arrays, known = None, {}, {}
    for own, values in columns.items():
        short, unit = parts(own)
        array = real(values, f"{name}: `{own}`")
        if short in arrays or (short == "time" and time is not None):
            raise InputError(f"{name} has `{short}` twice, in several units")
        if short == "time":
            if unit not in ("", "s"):
                raise InputError(f"{name}: the time is in {unit}", "give it in s")
            time = array
        else:
            arrays[short], known[short] = array, unit or units.get(own, units.get(short, ""))
    if time is None:
        raise InputError(f"{name} has no column `time`", 'name it `time` or `time [s]`, in seconds')
    run = Run(time, arrays, known)
    run.name = name
    return run


class Files:
    """Runs and texts as files in a folder of their own, as long as this is there."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix=FOLDER))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)

    def runs(self, given: Any) -> list[str]:
        """The files of one run or of several; paths stay as they are."""
        several = isinstance(given, Sequence) and not isinstance(given, str)
        all_of = list(given) if several else [given]
        names: set[str] = set()
        files = []
        for k, own in enumerate(all_of, 1):
            if isinstance(own, str | Path):
                files.append(str(own))
                continue
            run = as_run(own, getattr(own, "name", None) or f"run{k}")
            stem = re.sub(r"[^\w.+-]", "_", run.name)
            name = stem if stem not in names else f"{stem}-{k}"
            names.add(name)
            file = self.path / f"{name}.csv"
            run.write(file)
            files.append(str(file))
        return files

    def text(self, name: str, content: str) -> Path:
        """The file of a text."""
        file = self.path / name
        file.write_text(content, encoding="utf-8")
        return file


def data(values: Array) -> bytes:
    """The bytes of an array."""
    return np.ascontiguousarray(values, dtype=np.float64).tobytes()


def real(values: Any, what: str) -> Array:
    given = np.asarray(values)
    if given.dtype.kind in "mMc":
        raise InputError(f"{what} is {given.dtype}; expected real numbers", "give times in seconds, as numbers")
    if np.ma.isMaskedArray(values):
        values = np.ma.filled(values.astype(np.float64), np.nan)
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what} is not all numbers") from None
    if array.ndim != 1:
        raise InputError(f"{what} has {array.ndim} dimensions; expected one")
    return array


def parts(head: str) -> tuple[str, str]:
    """Name and unit of `name [unit]`."""
    # Without a space before it, as in `x[1]`, it is an element of an array.
    found = re.fullmatch(r"(.*\S)\s+\[([^\[\]]*)\]", head.strip())
    return (found[1], found[2]) if found else (head.strip(), "")


def head(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def heads(units: Mapping[str, str]) -> list[str]:
    return [head(name, unit) for name, unit in units.items()]
