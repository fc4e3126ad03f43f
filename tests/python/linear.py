"""Checks what `pilotage linearize` prints with NumPy alone; prints the largest relative differences.

usage: linear.py LINEAR.json MATRICES.csv
poles: eigenvalues of A. table: the CSV file against the JSON. sampled: every pole that the loop has in steps
solves the difference equations of parts that hold their inputs.
"""

import csv
import json
import sys

import numpy as np

linear = json.load(open(sys.argv[1]))
A, B, C, D = (np.array(linear[name], dtype=float) for name in "ABCD")


def poles(listed):
    upper = [complex(pole["real"], pole["imaginary"]) for pole in listed]
    return np.array(upper + [pole.conjugate() for pole in upper if pole.imag > 0])


def furthest(found, expected):
    """Largest distance from one of `found` to the nearest of `expected`, and the other way round."""
    table = abs(found[:, None] - expected[None, :])
    return max((table.min(axis=1) / abs(found)).max(), (table.min(axis=0) / abs(expected)).max())


def table():
    with open(sys.argv[2], newline="") as file:
        head, *rows = list(csv.reader(file))
    assert head[1:] == linear["states"] + linear["inputs"], head
    names = [f"der({state})" for state in linear["states"]] + linear["outputs"]
    assert [row[0] for row in rows] == names
    numbers = np.array([[float(cell) for cell in row[1:]] for row in rows])
    return abs(numbers - np.block([[A, B], [C, D]])).max()


def held():
    """Poles of the Jacobi scheme. A of the whole is cut into pilot and vehicle where the stick and the
    position go over; each is stepped exactly with its input held, by the series of its exponential."""
    states = linear["states"]
    step = linear["inSteps"]["step"]
    parts = [[i for i, s in enumerate(states) if s.startswith(p)] for p in ("pilot.", "quadcopter.")]
    stick = C[linear["outputs"].index("pilot.stick")]
    position = C[linear["outputs"].index("quadcopter.z")]
    pilot, vehicle = parts
    # What each part gets from the other is its input's column times the output's row.
    coupling = [
        np.linalg.lstsq(position[vehicle][None, :].T, A[np.ix_(pilot, vehicle)].T, rcond=None)[0][0],
        np.linalg.lstsq(stick[pilot][None, :].T, A[np.ix_(vehicle, pilot)].T, rcond=None)[0][0],
    ]
    whole = np.zeros_like(A)
    for own, other, column, row in (
        (pilot, vehicle, coupling[0], position[vehicle]),
        (vehicle, pilot, coupling[1], stick[pilot]),
    ):
        n = len(own)
        exponent = np.zeros((n + 1, n + 1))
        exponent[:n, :n], exponent[:n, n] = A[np.ix_(own, own)] * step, column * step
        term = total = np.eye(n + 1)
        for k in range(1, 60):
            term = term @ exponent / k
            total = total + term
        whole[np.ix_(own, own)] = total[:n, :n]
        whole[np.ix_(own, other)] = np.outer(total[:n, n], row)
    return np.log(np.linalg.eigvals(whole).astype(complex)) / step


print(
    json.dumps(
        {
            "poles": furthest(poles(linear["poles"]), np.linalg.eigvals(A)),
            "table": table(),
            "sampled": furthest(poles(linear["inSteps"]["poles"]), held()),
        }
    )
)
