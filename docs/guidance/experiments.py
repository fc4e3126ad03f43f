"""The experiments of docs/guidance.md. Each flies with a seed and yields what the fits of those flights find."""

import csv
import math

from flights import ARM, HERE, HUMAN, crossover, double_integrator, fit, fit_linear, fly, human, integrator, pilotage

COMPENSATORY, PURSUIT = "extended_crossover", HERE / "pursuit.toml"
SINES = {"target": "sines", "amplitude": 2, "bandwidth": 0.6}
CONSTANT = {"targets": "10,20", "runs": 3, "duration": 15}
MOVING = {"runs": 2, "duration": 45}
TASKS = {
    "constant": CONSTANT,
    "steps": {"target": "steps", "amplitude": 10, "count": 4, **MOVING},
    "ramps": {"target": "ramps", "amplitude": 15, "count": 6, **MOVING},
    "sines": SINES | MOVING,
}
LENGTHS = [(1, 15), (1, 30), (1, 60), (1, 120), (2, 60), (4, 30), (8, 15)]  # runs, and their duration [s]
BANDWIDTHS = [(0.15, 4), (0.3, 3), (0.6, 2), (1.2, 1)]  # [rad/s], and amplitude [m]: sticks up to about a half
REMNANTS = [0, 0.05, 0.1, 0.4, 1]
MUCH = 0.4  # remnant
ORDERS = [1, 2, 3, 4, 5]
RATES = [5, 10, 20, 50]  # samples a second
MESHES = {"at the samples": 'mesh = "samples"', "refined": "mesh_tolerance = 1e-5"}
# Vehicles with one pole at the origin, and two; the human's delay, gain and lead there.
DELAYS = {
    "K/s, 0.15 s": ("integrator", 0.15, 0.25, 0, 2),
    "K/s, 0.3 s": ("integrator", 0.3, 0.2, 0, 2),
    "K/s, 0.6 s": ("integrator", 0.6, 0.12, 0, 2),
    "K/s², 0.3 s": ("double_integrator", 0.3, 0.0698, 2.84, 1.5),
}
PLANTS = {"integrator": integrator, "double_integrator": double_integrator}
# What is free, and what is fixed, of the pilots that tell delay and arm apart in different ways.
ARMS = {
    "arm known": (COMPENSATORY, {"gain": 0.2, "delay": 0.2}, ARM | {"lead": 0}),
    "arm free": (COMPENSATORY, {"gain": 0.2, "delay": 0.2, "omega_nm": 11, "zeta_nm": 0.35}, {"lead": 0}),
    "lag of first order": ("crossover", {"gain": 0.2, "delay": 0.2, "lag": 0.1}, {}),
    "delay alone": (COMPENSATORY, {"gain": 0.2, "delay": 0.2}, {"omega_nm": 100, "zeta_nm": 0.7, "lead": 0}),
}


def described(found, fixed=ARM, vehicle=None):
    """What was found, with crossover and margin."""
    pilot = human({"lead": 0} | ARM | fixed | found)
    found["crossover"], found["margin"] = crossover(pilot, vehicle) if vehicle else crossover(pilot)
    return found


def variant(folder, name, old, new):
    """A file like the built-in compensatory pilot's, with something replaced."""
    shown = pilotage("models", "show", COMPENSATORY)
    assert old in shown, old
    folder.mkdir(exist_ok=True, parents=True)
    file = folder / f"{name}.toml"
    file.write_text(shown.replace(old, new))
    return file


def unlimited(folder):
    """The compensatory pilot whose stick has no stops: what it does when a target jumps is not cut off."""
    return variant(folder, "unlimited", ", limit = [-1, 1]", "")


def tasks(seed, folder):
    """The same time in the air for each kind of target; both structures."""
    for task, options in TASKS.items():
        runs = fly(folder / task, seed=seed, **options)
        # On a straight line a jump would begin a sample too early.
        hold = "zero-order" if task == "steps" else "linear"
        for name, pilot in [("compensatory", unlimited(folder)), ("pursuit", PURSUIT)]:
            yield f"{task}, {name}", described(fit(runs, pilot=pilot, hold=hold))


def linear(seed, folder):
    """The paper's pilot of third order."""
    for task, options in TASKS.items():
        yield task, fit_linear(fly(folder / task, seed=seed, **options))["response"]


def lengths(seed, folder):
    """Few long runs or many short ones, of a human with much remnant."""
    for runs, duration in LENGTHS:
        flown = fly(folder / f"{runs}x{duration}", seed=seed, runs=runs, duration=duration, remnant=MUCH, **SINES)
        yield f"{runs} × {duration} s", described(fit(flown))


def bandwidths(seed, folder):
    """How fast the fastest of the large sines is; much remnant."""
    for bandwidth, amplitude in BANDWIDTHS:
        options = SINES | MOVING | {"bandwidth": bandwidth, "amplitude": amplitude, "remnant": MUCH}
        yield f"{bandwidth}", described(fit(fly(folder / f"{bandwidth}", seed=seed, **options)))


def jump(seed, folder):
    """A flight to 10 m without remnant, and pilots fitted to it, flying alone; the sticks over 6 s."""
    runs = fly(folder, seed=seed, targets=10, runs=1, duration=15, remnant=0, variation=0)
    yield "human", {"stick": sticks(runs[0], "stick [1]")}
    pilots = {"compensatory": unlimited(folder), "compensatory, with stops": COMPENSATORY, "pursuit": PURSUIT}
    for name, pilot in pilots.items():
        found = described(fit(runs, pilot=pilot))
        wires = ["pilot.stick=vehicle.stick", "vehicle.z=pilot.position"]
        wires += ["vehicle.v=pilot.speed"] if pilot == PURSUIT else []
        flown = folder / "flown.csv"
        pilotage("cosim", f"pilot={folder / 'fitted.toml'}", "vehicle=quadcopter", "--set", "pilot.target=10",
                 *(part for wire in wires for part in ("--connect", wire)), "--stop-time", 6, "--step", 0.05,
                 "--algorithm", "strong", "-o", flown, "--force")
        yield name, found | {"stick": sticks(flown, "pilot.stick [1]")}


def sticks(file, column):
    """The stick, forward positive [1], of each tenth of a second up to 6 s; samples are 0.05 s apart."""
    return [round(-float(row[column]), 4) for row in rows(file)[:121:2]]


def rows(file):
    return list(csv.DictReader(line for line in file.read_text().splitlines() if not line.startswith("#")))


def remnants(seed, folder):
    """Three ways to compare with the recording, and how much of the stick is remnant."""
    for remnant in REMNANTS:
        runs = fly(folder / f"{remnant}", seed=seed, variation=0, remnant=remnant, **SINES, **MOVING)
        share = excess(runs, fly(folder / "0", seed=seed, variation=0, remnant=0, **SINES, **MOVING))
        for method, deviation in [("response", 0.1), ("stick", 0.01), ("closed stick", 0.01)]:
            yield f"{remnant}, {method}", described(fit(runs, method=method, sd=deviation)) | {"share": share}


def excess(runs, clean):
    """Power of the remnant's part of the sticks, relative to that of the sticks."""
    moved, calm = ([float(row["stick [1]"]) for run in files for row in rows(run)] for files in (runs, clean))
    return sum((a - b) ** 2 for a, b in zip(moved, calm)) / sum(a * a for a in moved)


def objectives(seed, folder):
    """The paper's task and pilot, fitted both ways, and flown alone."""
    for remnant in [0, 0.05, 0.1]:
        runs = fly(folder / f"{remnant}", seed=seed, variation=0, remnant=remnant, **CONSTANT)
        for objective, found in fit_linear(runs, objective="both").items():
            yield f"{remnant}, {objective}", found


def delays(seed, folder):
    """Padé's orders, the arm known."""
    for case, (vehicle, delay, gain, lead, bandwidth) in DELAYS.items():
        runs = delayed(folder / vehicle / f"{delay}", seed, vehicle, delay, gain, lead, bandwidth)
        free = {"gain": gain, "delay": 0.2} | ({"lead": 2.5} if lead else {})
        fixed = ARM if lead else ARM | {"lead": 0}
        for order in ORDERS:
            model = variant(folder, f"order{order}", "delay(error, delay, 3)", f"delay(error, delay, {order})")
            found = fit(runs, pilot=model, vehicle=vehicle, free=free, fixed=fixed, sd=0.02)
            yield f"{case}, {order}", described(found, fixed | {"order": order}, PLANTS[vehicle])


def delayed(folder, seed, vehicle, delay, gain, lead, bandwidth):
    return fly(folder, seed=seed, vehicle=vehicle, target="sines", amplitude=0.5, bandwidth=bandwidth, variation=0,
               delay=delay, gain=gain, lead=lead, **MOVING)


def arms(seed, folder):
    """Delay and arm of the same flights, told apart in four ways."""
    runs = delayed(folder, seed, *DELAYS["K/s, 0.15 s"])
    for name, (pilot, free, fixed) in ARMS.items():
        found = fit(runs, pilot=pilot, vehicle="integrator", free=free, fixed=fixed, sd=0.02)
        arm = fixed | found
        late = arm["lag"] if "lag" in arm else 2 * arm["zeta_nm"] / arm["omega_nm"]
        # The lag of first order as an arm of second order with a fast second pole.
        shape = {"omega_nm": math.sqrt(1e4 / late), "zeta_nm": math.sqrt(1e4 * late) / 2} if "lag" in arm else fixed
        yield name, described(found, shape, integrator) | {"arm": late, "effective": found["delay"] + late}


def rates(seed, folder):
    """Samples a second, with a mesh of the samples alone, and with one that is refined."""
    _, delay, gain, lead, _ = DELAYS["K/s, 0.15 s"]
    for rate in RATES:
        runs = fly(folder / f"{rate}", seed=seed, vehicle="integrator", target="sines", amplitude=0.5, bandwidth=1.5,
                   variation=0, delay=delay, gain=gain, lead=lead, rate=rate, **MOVING)
        for name, mesh in MESHES.items():
            _, free, fixed = ARMS["arm known"]
            found = fit(runs, vehicle="integrator", free=free, fixed=fixed, sd=0.02, mesh=mesh)
            yield f"{rate}, {name}", described(found, {"lead": 0}, integrator)


EXPERIMENTS = {experiment.__name__: (experiment, seeds) for experiment, seeds in [
    (tasks, 8), (linear, 8), (lengths, 8), (bandwidths, 8), (jump, 1), (remnants, 8), (objectives, 8), (delays, 4),
    (arms, 8), (rates, 4),
]}
QUICK = ["tasks", "jump", "bandwidths"]
