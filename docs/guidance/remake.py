"""Remakes the figures and tables of docs/guidance.md. From the repository's root, with Python's standard library alone:

    python3 docs/guidance/remake.py            flies and fits everything (some minutes on one core), writes all
    python3 docs/guidance/remake.py tasks arms the same with these experiments alone
    python3 docs/guidance/remake.py --page     writes page and figures from results.json
    python3 docs/guidance/remake.py --check    flies and fits everything, compares with results.json, page and figures
    python3 docs/guidance/remake.py --quick    the same with one seed of the short experiments (seconds)

The experiments (experiments.py) fly the synthetic human with fixed seeds and write what the fits find into
results.json. Tables and figures are made of that file alone; in the page, tables stand between `<!-- name -->` and
`<!-- /name -->`. The command is $PILOTAGE, else the newest that cargo built in target/, else cargo builds it. The exit
code is 1 where something differs.
"""

import argparse
import cmath
import json
import math
import re
import sys
import tempfile
from collections import Counter
from pathlib import Path
from statistics import correlation, fmean, stdev

import experiments
from draw import chart
from experiments import (ARMS, BANDWIDTHS, DELAYS, EXPERIMENTS, LENGTHS, MESHES, ORDERS, QUICK, RATES, REMNANTS,
                         TASKS)
from flights import HERE, HUMAN, crossover, human, pade, pilotage

PAGE = HERE.parent / "guidance.md"
RESULTS = HERE / "results.json"
PILOTS = {"third order": "linear", "compensatory": "tasks", "pursuit": "tasks"}
METHODS = {"response": "response", "stick": "stick, driven by the recording", "closed stick": "stick, in closed loop"}
DIGITS = {"crossover": 3, "margin": 1, "lead": 2, "delay": 3, "rms": 3, "gain": 4, "arm": 3, "effective": 3, "alone": 2}
UNITS = {"crossover": "rad/s", "margin": "°", "lead": "s", "delay": "s", "rms": "m", "gain": "1/m", "arm": "s",
         "effective": "s", "alone": "m"}
NAMES = {"margin": "phase margin", "rms": "rms residual", "arm": "lag of the arm", "effective": "effective delay",
         "alone": "flown alone, rms"}
TRADE = 0.01  # relative, between a repeated experiment and results.json


# ---- running


def run(names, seeds=None):
    """The results of these experiments: for each case a list with what every seed found."""
    results = {}
    for name in names:
        experiment, all_seeds = EXPERIMENTS[name]
        cases = results.setdefault(name, {})
        for seed in range(1, (seeds or all_seeds) + 1):
            with tempfile.TemporaryDirectory() as folder:
                for case, found in experiment(seed, Path(folder)):
                    cases.setdefault(case, []).append({key: rounded(value) for key, value in found.items()})
            print(f"{name}: seed {seed}", file=sys.stderr)
    return results


def rounded(value):
    return float(f"{value:.5g}") if isinstance(value, float) else value


def differences(new, old):
    """What does not agree, seed by seed."""
    for name, cases in new.items():
        for case, seeds in cases.items():
            for seed, (found, before) in enumerate(zip(seeds, old[name][case]), 1):
                for key in found:
                    if not agree(found[key], before.get(key)):
                        yield f"{name}, {case}, seed {seed}: {key} is {found[key]}, was {before.get(key)}"


def agree(a, b):
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(agree(x, y) for x, y in zip(a, b))
    if isinstance(a, float) and isinstance(b, float):
        return abs(a - b) <= TRADE * max(abs(a), abs(b), 0.1) or math.isnan(a) and math.isnan(b)
    return a == b


def disagreement():
    """What `linearize` says of the human's loop, where that is not what the transfer functions here say."""
    values = [f"pilot.{name}={-value if name == 'gain' else value}" for name, value in HUMAN.items()]
    printed = pilotage("linearize", f"pilot={experiments.COMPENSATORY}", "vehicle=quadcopter", "--connect",
                       "pilot.stick=vehicle.stick", "--connect", "vehicle.z=pilot.position", "--loop",
                       "pilot.stick=vehicle.stick", *(part for value in values for part in ("--set", value)))
    found = re.search(r"gain 1 at +(\S+) rad/s: phase margin (\S+) deg", printed)
    width, margin = crossover(human(HUMAN))
    said = [float(number) for number in found.groups()]
    if abs(said[0] - width) > 1e-3 or abs(said[1] - margin) > 0.1:
        yield f"the human's crossover and margin are {width}, {margin} here, and {said} of linearize"


# ---- tables


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def spread(seeds, key):
    """Mean and standard deviation over the seeds, and how many ended on a bound."""
    values, digits = [seed[key] for seed in seeds], DIGITS[key]
    return f"{fmean(values):.{digits}f} ± {stdev(values):.{digits}f}" + on_bound(seeds, key)


def on_bound(seeds, key):
    ends = sum(key in seed.get("bounds", []) for seed in seeds)
    return f" ({ends} of {len(seeds)} on a bound)" if ends else ""


def heads(keys):
    return [f"{NAMES.get(key, key)} [{UNITS[key]}]" for key in keys]


def of_cases(cases, keys, first, truth=None):
    """A row for each case."""
    rows = [[name, *(spread(seeds, key) for key in keys)] for name, seeds in cases.items()]
    if truth:
        rows.insert(0, ["*the human*", *(f"{truth[key]:.{DIGITS[key]}f}" if key in truth else "" for key in keys)])
    return table([first, *heads(keys)], rows)


def the_human():
    width, margin = crossover(human(HUMAN))
    return HUMAN | {"crossover": width, "margin": margin}


def of_tasks(results):
    rows = [["*the human*", *[f"{the_human()['crossover']:.3f}"] * 3, "", ""]]
    for task in TASKS:
        pair = [results["tasks"][f"{task}, {pilot}"] for pilot in ("compensatory", "pursuit")]
        widths = [spread(seeds, "crossover") for seeds in [results["linear"][task], *pair]]
        rows.append([task, *widths, *(f"{fmean(seed['rms'] for seed in seeds):.2f}" for seeds in pair)])
    columns = [f"{pilot} [rad/s]" for pilot in PILOTS]
    return table(["target", *columns, "rms residual, compensatory [m]", "pursuit [m]"], rows)


def of_right_structure(results):
    right = {"constant": "pursuit", "steps": "pursuit", "ramps": "compensatory", "sines": "compensatory"}
    cases = {f"{task}, {pilot}": results["tasks"][f"{task}, {pilot}"] for task, pilot in right.items()}
    return of_cases(cases, ["crossover", "margin", "lead", "delay"], "target, pilot", the_human())


def of_jump(results):
    rows = []
    for name, [found] in results["jump"].items():
        keys = ["rms", "crossover", "gain", "lead", "delay"]
        truth = the_human() | {"rms": 0.0}
        values = [f"{(found if 'gain' in found else truth)[key]:.{DIGITS[key]}f}" for key in keys]
        rows.append([f"*the {name}*" if name == "human" else name, *values, f"{max(map(abs, found['stick'])):.2f}"])
    return table(["pilot", *heads(["rms", "crossover", "gain", "lead", "delay"]), "largest stick [1]"], rows)


def of_remnants(results):
    truth, rows = the_human(), []
    for remnant in REMNANTS:
        for method, words in METHODS.items():
            seeds = results["remnants"][f"{remnant}, {method}"]
            share = f"{remnant} ({100 * fmean(seed['share'] for seed in seeds):.1f} %)" if method == "response" else ""
            rows.append([share, words, *(error(seeds, key, truth[key]) for key in ("crossover", "margin", "lead", "delay"))])
    return table(["remnant (of the stick's power)", "compared", *heads(["crossover", "margin", "lead", "delay"])], rows)


def error(seeds, key, truth):
    """As `spread`, of what is found minus what is true."""
    values, digits = [seed[key] - truth for seed in seeds], DIGITS[key]
    return f"{fmean(values):+.{digits}f} ± {stdev(values):.{digits}f}" + on_bound(seeds, key)


def of_objectives(results):
    rows = []
    for case, seeds in results["objectives"].items():
        unstable = sum(not seed["stable"] for seed in seeds)
        rows.append([*case.split(", "), *(spread(seeds, key) for key in ("crossover", "margin", "alone")),
                     f"{unstable} of {len(seeds)}"])
    return table(["remnant", "compared", *heads(["crossover", "margin", "alone"]), "loops unstable"], rows)


def phase_error(order, angle):
    """Phase [deg] that Pade's approximation has too much (positive: it lags too little)."""
    exact = cmath.exp(-1j * angle)
    error = math.degrees(cmath.phase(pade(order, 1j * angle) / exact))
    return (error + 1) % 360 - 1  # from 0 to 360, and what rounding leaves below 0


def limit(order, error):
    """Largest angle [rad] up to which that phase error [deg] is not exceeded."""
    return next(k / 1000 for k in range(1, 10**5) if phase_error(order, k / 1000) > error)


def of_pade():
    angles = [0.5, 1, 1.5, 2, 3, 4, 6]
    rows = [[f"{angle}", *(f"{phase_error(order, angle):.2f}" for order in ORDERS)] for angle in angles]
    for error in (1, 5):
        rows.append([f"*{error}° at*", *(f"{limit(order, error):.1f} rad" for order in ORDERS)])
    return table(["ω τ [rad]", *(f"order {order} [°]" for order in ORDERS)], rows)


def of_delays(results):
    rows = []
    for case, (_, delay, *_) in DELAYS.items():
        cells = [spread(results["delays"][f"{case}, {order}"], "delay") for order in (1, 2, 3, 5)]
        misfit = [fmean(seed["rms"] for seed in results["delays"][f"{case}, {order}"]) for order in (1, 3)]
        rows.append([case, *cells, *(f"{rms:.3f}" for rms in misfit)])
    orders = [f"order {order} [s]" for order in (1, 2, 3, 5)]
    return table(["vehicle, the human's delay", *orders, "rms residual, order 1 [m]", "order 3 [m]"], rows)


def of_arms(results):
    known = {"delay": 0.15, "arm": 0.14, "effective": 0.29}
    known |= dict(zip(("crossover", "margin"), crossover(human(HUMAN | {"gain": 0.25, "lead": 0}), experiments.integrator)))
    keys = ["delay", "arm", "effective", "crossover", "margin", "rms"]
    return of_cases({name: results["arms"][name] for name in ARMS}, keys, "pilot", known)


def of_rates(results):
    rows = []
    for rate in RATES:
        cases = [results["rates"][f"{rate}, {mesh}"] for mesh in MESHES]
        rows.append([f"{rate}", *(spread(seeds, key) for seeds in cases for key in ("crossover", "delay"))])
    return table(["samples a second", *(f"{head}, mesh {mesh}" for mesh in MESHES for head in heads(["crossover", "delay"]))],
                 rows)


def of_doubts(results):
    """How many of the seeds' fits had each diagnostic."""
    rows = []
    for task in TASKS:
        cells = []
        for seeds in [results["linear"][task], *(results["tasks"][f"{task}, {pilot}"] for pilot in ("compensatory", "pursuit"))]:
            counts = Counter(code for seed in seeds for code in seed["doubts"])
            cells.append(", ".join(f"`{code}` {count}" for code, count in sorted(counts.items())) or "none")
        rows.append([task, *cells])
    return table(["target", *PILOTS], rows)


def of_trade(results):
    seeds = results["remnants"]["0.4, response"]
    r = correlation([seed["lead"] for seed in seeds], [seed["delay"] for seed in seeds])
    return f"At a remnant of 0.4, lead and delay of the response fits have a correlation of {r:.2f} over the seeds."


def of_fits(results):
    fits = [seed for cases in results.values() for seeds in cases.values() for seed in seeds if "status" in seed]
    # A loop that is unstable makes a result meaningless, and is an answer here.
    failed = sum(seed["status"] not in ("converged", "unstable-loop") for seed in fits)
    return f"The page stands on {len(fits)} fits, of which {failed} did not converge."


def tables(results):
    keys, truth = ["crossover", "margin", "lead", "delay"], the_human()
    bands = {f"{band} rad/s, {size} m": results["bandwidths"][f"{band}"] for band, size in BANDWIDTHS}
    lengths = {name: results["lengths"][name] for name in (f"{runs} × {time} s" for runs, time in LENGTHS)}
    return {
        "tasks": of_tasks(results), "structures": of_right_structure(results), "jump": of_jump(results),
        "lengths": of_cases(lengths, keys, "runs", truth),
        "bandwidths": of_cases(bands, keys, "bandwidth, amplitude of the slow sines", truth),
        "remnants": of_remnants(results), "objectives": of_objectives(results), "pade": of_pade(),
        "delays": of_delays(results), "arms": of_arms(results), "rates": of_rates(results),
        "doubts": of_doubts(results), "trade": of_trade(results), "fits": of_fits(results),
    }


# ---- figures


def ticks(values):
    return [(value, f"{value:g}") for value in values]


def figures(results):
    return {"tasks.svg": task_figure(results), "jump.svg": jump_figure(results), "pade.svg": pade_figure(),
            "remnants.svg": remnant_figure(results)}


def task_figure(results):
    series = []
    for k, (pilot, source) in enumerate(PILOTS.items()):
        cases = [results[source][task if source == "linear" else f"{task}, {pilot}"] for task in TASKS]
        series.append((pilot, [(place + 0.2 * (k - 1) + 0.015 * (n - 4), seed["crossover"])
                               for place, seeds in enumerate(cases) for n, seed in enumerate(seeds)], []))
    return chart("Crossover found, by target and pilot", "A dot is a fit of one seed's flights. Pilots that differentiate "
                 "the error find little more than half of it where targets jump.", ("target", -0.5, 3.5, list(enumerate(TASKS))),
                 ("crossover [rad/s]", 0.2, 1.0, ticks([0.2, 0.4, 0.6, 0.8, 1])), series,
                 (the_human()["crossover"], "the human's"))


def jump_figure(results):
    series = []
    for name, [found] in results["jump"].items():
        series.append((name, [], [(k / 10, value) for k, value in enumerate(found["stick"])]))
    return chart("The stick after the target jumps by 10 m", "Pilots that differentiate the error jerk the stick; the human "
                 "and the pursuit pilot do not.", ("time [s]", 0, 6, ticks(range(7))),
                 ("stick, forward [1]", -2.2, 2.2, ticks([-2, -1, 0, 1, 2])), series)


def pade_figure():
    angles = [0.05 * k for k in range(121)]
    series = [(f"order {order}", [], [(angle, phase_error(order, angle)) for angle in angles if
               phase_error(order, angle) < 30]) for order in ORDERS]
    return chart("Phase that Padé's approximation lacks", "Error of phase over frequency times delay, for orders 1 to 5.",
                 ("frequency × delay [rad]", 0, 6, ticks(range(7))), ("phase error [°]", 0, 30, ticks([0, 10, 20, 30])), series)


def remnant_figure(results):
    series = []
    for k, (method, words) in enumerate(METHODS.items()):
        cases = [results["remnants"][f"{remnant}, {method}"] for remnant in REMNANTS]
        dots = [(place + 0.2 * (k - 1), seed["delay"]) for place, seeds in enumerate(cases) for seed in seeds]
        series.append((words.split(", ")[-1], dots, []))
    return chart("Delay found, by remnant and what is compared", "A dot is a fit of one seed's flights; one "
                 "beyond the axis stands on its end.",
                 ("remnant", -0.5, len(REMNANTS) - 0.5, [(k, f"{remnant:g}") for k, remnant in enumerate(REMNANTS)]),
                 ("delay [s]", 0, 0.4, ticks([0, 0.1, 0.2, 0.3, 0.4])), series, (HUMAN["delay"], "the human's"))


# ---- page


def filled(page, parts):
    """The page with its tables; each must have its place."""
    for name, text in parts.items():
        pattern = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.S)
        page, count = pattern.subn(lambda found: f"{found[1]}{text}\n{found[2]}", page)
        if count != 1:
            raise SystemExit(f"{PAGE.name} has {count} places for the table `{name}`")
    return page


def contents(results):
    """Every file that is made of the results, with what belongs into it."""
    files = {HERE / name: text for name, text in figures(results).items()}
    return files | {PAGE: filled(PAGE.read_text(encoding="utf-8"), tables(results))}


def store(results):
    """Writes the results, a line for each case."""
    cases = {name: [f"  {json.dumps(case, ensure_ascii=False)}: {json.dumps(seeds)}" for case, seeds in cases.items()]
             for name, cases in results.items()}
    blocks = [f'"{name}": {{\n' + ",\n".join(lines) + "\n}" for name, lines in cases.items()]
    RESULTS.write_text("{\n" + ",\n".join(blocks) + "\n}\n", encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for flag in ("page", "check", "quick"):
        parser.add_argument(f"--{flag}", action="store_true")
    parser.add_argument("names", nargs="*", help="experiments: all, or these")
    options = parser.parse_args()
    if unknown := set(options.names) - set(EXPERIMENTS):
        parser.error(f"no experiment {', '.join(unknown)}; there are {', '.join(EXPERIMENTS)}")
    if options.check or options.quick:
        results = json.loads(RESULTS.read_text())
        stale = [f"{file.name} is not what results.json says" for file, text in contents(results).items()
                 if not file.is_file() or file.read_text(encoding="utf-8") != text]
        new = run(QUICK, 1) if options.quick else run(EXPERIMENTS)
        wrong = [*stale, *disagreement(), *differences(new, results)]
        print("\n".join(wrong) or f"as written: {sum(map(len, new.values()))} cases")
        sys.exit(bool(wrong))
    if not options.page:
        old = json.loads(RESULTS.read_text(encoding="utf-8")) if options.names else {}
        store(old | run(options.names or EXPERIMENTS))
    for file, text in contents(json.loads(RESULTS.read_text(encoding="utf-8"))).items():
        file.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
