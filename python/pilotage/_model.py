"""Model files: equations as text."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._call import Left, PathLike, call, pairs, text, words
from ._tables import Files, Table

if TYPE_CHECKING:
    from ._system import Result


class Model:
    """A model: ten lines of text, a file, or one that is built in.

    Parameters
    ----------
    source : str or path
        The text of a model file (docs/models.md), its path, or the name of a built-in model.
    order : int, optional
        Of a built-in model that has one.

    Raises
    ------
    InputError
        If names, units or equations are wrong, with the line.
    """

    def __init__(self, source: PathLike, order: int | None = None) -> None:
        given = text(source)
        self.text: str | None = given if "\n" in given else None
        self.file = "" if self.text is not None else given
        self.order = order
        self._checked: dict[str, Any] = self._run("check").json()
        self.name: str = Path(self._checked["file"]).stem

    def __repr__(self) -> str:
        equations = "\n".join(f"  {own}" for own in self._checked["equations"])
        return f"Model {self.name}\n{equations}"

    def check(self) -> dict[str, Any]:
        """How the model was read: variables, units, equations, and the linear model at the start values."""
        return self._checked

    def step(
        self,
        input: list[str] | None = None,
        *,
        size: float = 1.0,
        set: Mapping[str, float] | None = None,
        stop_time: float | None = None,
    ) -> Table:
        """Step responses.

        Parameters
        ----------
        input : list of str, optional
            The inputs with a step; each in turn if it is None.
        size : float
            Of the step, in the unit of the input.
        set : dict, optional
            Parameters and start values.
        stop_time : float, optional
            End [s]; six time constants if it is None.

        Returns
        -------
        Table
            A column for each response.
        """
        left = self._run("step", input=input, size=size, set=pairs(set), stop_time=stop_time)
        return left.tables["responses"]

    def simulate(
        self,
        *,
        stop_time: float = 10.0,
        step: float | None = None,
        set: Mapping[str, object] | None = None,
        input: Any = None,
    ) -> Result:
        """Simulates the model and records all of its signals.

        Parameters
        ----------
        stop_time : float
            End [s].
        step : float, optional
            Interval of the rows [s]; a thousandth of the time if it is None.
        set : dict, optional
            Parameters, inputs and start values.
        input : Run, DataFrame, dict of arrays or path, optional
            Inputs over time.

        Returns
        -------
        Result
        """
        from ._system import result

        files = Files()
        given = files.runs(input)[0] if input is not None else None
        left = self._run("simulate", stop_time=stop_time, step=step, set=pairs(set), input=given)
        found = result(left)
        head = f"{next(iter(found)).partition('.')[0]}."
        short = found.starting(head)
        own = type(found)(short.time, short, short.units)
        own.status, own.notes = found.status, found.notes
        return own

    def _run(self, command: str, **flags: object) -> Left:
        files = Files()
        file = self.file if self.text is None else files.text("model.toml", self.text)
        return call(f"model {command}", words(file, json=True, order=self.order, **flags))
