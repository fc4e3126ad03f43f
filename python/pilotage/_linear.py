"""Systems as linear ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._call import call, pairs, words
from ._fit import numbers

if TYPE_CHECKING:
    from ._system import Source, System


class Linearization:
    """dx/dt = A x + B u, y = C x + D u.

    Attributes
    ----------
    A, B, C, D : ndarray of float
        Shapes (n, n), (n, m), (p, n), (p, m).
    states, inputs, outputs : list of str
        Names, `instance.variable`.
    poles : ndarray of complex, shape (n,)
        [1/s]
    stability : str
        `stable`, `unstable`, or what else the command says.
    loops : list of dict
        For each loop that was cut: its crossings with margins, and its response (docs/json.md).
    json : dict
        All that `pilotage linearize --json` prints.
    """

    def __init__(self, json: dict[str, Any]) -> None:
        self.json = json
        self.states: list[str] = json["states"]
        self.inputs: list[str] = json["inputs"]
        self.outputs: list[str] = json["outputs"]
        n, m, p = len(self.states), len(self.inputs), len(self.outputs)
        self.A = matrix(json["A"], n, n)
        self.B = matrix(json["B"], n, m)
        self.C = matrix(json["C"], p, n)
        self.D = matrix(json["D"], p, m)
        # Of each pair the command has one.
        half = np.array([complex(own["real"], own["imaginary"]) for own in json["poles"]], complex)
        self.poles = np.concatenate([half, half[half.imag != 0].conj()])
        self.stability: str = json["stability"]
        self.loops: list[dict[str, Any]] = json["loops"]
        self.notes: list[str] = json["notes"]

    def __repr__(self) -> str:
        sizes = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"Linearization({sizes}, {self.stability})"

    def to_control(self) -> Any:
        """A control.StateSpace with the same names, but for the points: `instance_variable`."""
        import control

        kinds = {"states": self.states, "inputs": self.inputs, "outputs": self.outputs}
        names = {kind: [name.replace(".", "_") for name in own] for kind, own in kinds.items()}
        return control.ss(self.A, self.B, self.C, self.D, **names)


def linearize(
    system: System | Source,
    *,
    loop: tuple[str, str] | Sequence[tuple[str, str]] = (),
    at: float | None = None,
    step: float | None = None,
    set: dict[str, object] | None = None,
    isolate: bool = True,
    **options: object,
) -> Linearization:
    """Linearizes a system about its state at a time.

    Parameters
    ----------
    system : System, path, Model or Fit
    loop : pair of str, or several
        Connections (output, input) at which the loop is cut: its margins are then known.
    at : float, optional
        Time [s]; the start if it is None.
    step : float, optional
        Communication step until then [s].
    set : dict, optional
        Values of parameters and inputs.
    isolate : bool
        Whether FMUs run in processes of their own.
    **options
        All other flags of `pilotage linearize`, such as `in_steps=0.05`.

    Returns
    -------
    Linearization
    """
    from ._system import as_system

    given = as_system(system)
    named, wiring = given.words()
    pair = [loop] if len(loop) == 2 and isinstance(loop[0], str) else list(loop)
    left = call(
        "linearize",
        words(
            *named,
            json=True,
            loop=[f"{a}={b}" for a, b in pair],
            at=at,
            step=step,
            set=pairs({**given.settings, **(set or {})}),
            isolate="all" if isolate else None,
            **wiring,
            **options,
        ),
    )
    return Linearization(left.json())


def matrix(rows: list[list[float]], n: int, m: int) -> NDArray[np.float64]:
    return numbers(rows).reshape(n, m)
