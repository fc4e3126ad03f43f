"""Makes the flights of examples/problems/learning: a crossover pilot whose gain grows while it flies, with a true delay. Needs NumPy.

    python3 tests/python/learning.py
"""

from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent.parent.parent / "examples" / "problems" / "learning"
FIRST, LAST, RATE, MIDDLE = 0.12, 0.24, 0.3, 45.0
LAG, DELAY, SPEED = 0.1, 0.25, 10.0
STEP, SUB, LENGTH = 0.1, 20, 90.0
LINES = 2 * np.pi / LENGTH * np.array([5, 11, 17, 29, 41, 61, 83])


def main():
    rng = np.random.default_rng(7)
    h = STEP / SUB
    late = round(DELAY / h)
    for run in (1, 2):
        phase = rng.uniform(0, 2 * np.pi, LINES.size)
        time = np.arange(round(LENGTH / STEP) * SUB + 1) * h
        rows = time[::SUB]
        # Lines of the target as it is recorded: along lines from sample to sample.
        sampled = (np.sin(np.outer(rows, LINES) + phase) / (1 + LINES)).sum(1)
        target = np.interp(time, rows, sampled - sampled[0])
        gain = FIRST + (LAST - FIRST) / (1 + np.exp(-RATE * (time - MIDDLE)))
        z, arm = np.zeros(time.size), 0.0
        for k in range(time.size - 1):
            seen = target[k - late] - z[k - late] if k >= late else 0.0
            # The error held over a step of 5 ms, the lag and the vehicle exactly.
            wish, decay = gain[k] * seen, np.exp(-h / LAG)
            moved = wish * h + (arm - wish) * LAG * (1 - decay)
            z[k + 1], arm = z[k] + SPEED * moved, wish + (arm - wish) * decay
        position = z[::SUB] + 0.02 * rng.standard_normal(rows.size)
        lines = (f"{t:.1f},{a:.4f},{b:.3f}" for t, a, b in zip(rows, target[::SUB], position))
        (FOLDER / f"run{run}.csv").write_text("\n".join(["time [s],target [m],position [m]", *lines]) + "\n")


if __name__ == "__main__":
    main()
