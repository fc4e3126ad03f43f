"""The nonlinear program of a problem file in CasADi, with the unknowns in pilotage's order:

    z = [X1 | X2 | ... | theta]    a run: its nodes in time order, all states of a node together; scaled
    g = [defects | limited signals]    each run by run; defects interval by interval

Ranges of parameters are bounds of unknowns here, which an interior-point method takes best; there they are
constraints, in the order low, high of each parameter.
"""

import casadi as ca
import numpy as np
from nlp import CLEARANCE, SCHEMES, kkt

LIMIT = 1.0  # of the stick, to both sides


def columns(path):
    """The columns of a run by name, NaN where a cell is empty."""
    header = path.open().readline().split(",")
    table = np.genfromtxt(path, delimiter=",", skip_header=1)
    return {name.split()[0]: column for name, column in zip(header, table.T)}


def functions(case, states, parameters, inputs):
    """Derivatives, and signals as their dictionary's columns: measured, then limited ones."""
    x, p, u = ca.SX.sym("x", len(states)), ca.SX.sym("p", len(parameters)), ca.SX.sym("u", inputs)
    named = dict(zip(states, ca.vertsplit(x))), dict(zip(parameters, ca.vertsplit(p)))
    rates, signals = case.equations(named[0], ca.vertsplit(u), named[1])
    rate = ca.vertcat(*[rates[name] for name in states])
    shown = ca.vertcat(*[signals[name] for name in [*case.measured, *case.limited]])
    return ca.Function("f", [x, u, p], [rate]), ca.Function("h", [x, u, p], [shown])


class Posed:
    """The scaled program: `nlp` and `limits` for CasADi's nlpsol. Scales are parameters of it, so that it is built once
    for all starts."""

    def __init__(self, case, folder, answer):
        self.case, self.states = case, answer["states"]
        self.abscissae, self.weights = SCHEMES[case.scheme]
        self.targets = [f"target{suffix}" for suffix in ["", "2"][: len(case.humans)]]
        self.f, self.h = functions(case, self.states, answer["parameters"], len(self.targets))
        self.known = [k for k, name in enumerate(self.states) if name not in case.free]
        self.ranges = [case.sought[name] for name in answer["parameters"]]
        self.scale = ca.MX.sym("scale", len(self.states))
        scale_theta = ca.MX.sym("scale_theta", len(self.ranges))
        bar = ca.MX.sym("theta", len(self.ranges))
        self.theta = bar * scale_theta
        recordings = [columns(folder / f"run{number + 1}.csv") for number in range(case.runs)]
        runs = [self.run(f"x{j}", recording) for j, recording in enumerate(recordings)]
        x, objective, defects, limited, self.fixed = zip(*runs)
        self.defects = [defect.numel() for defect in defects]
        self.limited = sum(own.numel() for own in limited)
        self.nlp = {
            "x": ca.vertcat(*map(ca.vec, x), bar),
            "p": ca.vertcat(self.scale, scale_theta),
            "f": answer["factor"] * sum(objective),
            "g": ca.vertcat(*defects, *limited),
        }
        self.set_scales(answer["scales"])

    def set_scales(self, scales):
        """Takes other scales of states and parameters."""
        self.scale_theta = np.array(scales["parameters"])
        low, high = self.theta_bounds()
        zero, most = np.zeros(sum(self.defects)), np.full(self.limited, LIMIT)
        self.limits = {
            "lbx": np.concatenate([*[-own for own in self.fixed], low]),
            "ubx": np.concatenate([*self.fixed, high]),
            "lbg": np.concatenate([zero, -most]),
            "ubg": np.concatenate([zero, most]),
            "p": np.concatenate([scales["states"], scales["parameters"]]),
        }

    def sizes(self):
        """What pilotage divides the ranges' constraints by: low and high end of each parameter."""
        size = lambda end, scale: max(abs(scale - end), 1e-3)
        pairs = zip(self.ranges, self.scale_theta)
        return [(size(own.low, scale), size(own.high, scale)) for own, scale in pairs]

    def theta_bounds(self):
        """Scaled ranges, from which a solution keeps pilotage's clearance."""
        ends = []
        for own, scale, (low, high) in zip(self.ranges, self.scale_theta, self.sizes()):
            low = own.low + CLEARANCE * low if np.isfinite(own.low) else own.low
            high = own.high - CLEARANCE * high if np.isfinite(own.high) else own.high
            ends.append((low / scale, high / scale))
        return np.array(ends).T

    def run(self, name, recording):
        """Unknowns, squares, defects, limited signals, and zero where an unknown is known."""
        s, n, size = len(self.weights), len(recording["time"]) - 1, len(self.states)
        x = ca.MX.sym(name, size, 1 + s * n)
        physical = ca.diag(self.scale) @ x
        target = np.array([recording[column] for column in self.targets])
        theta = ca.repmat(self.theta, 1, n)
        at = [c * target[:, 1:] + (1 - c) * target[:, :-1] for c in self.abscissae]
        nodes = [physical[:, i : i + s * (n - 1) + 1 : s] for i in range(s + 1)]
        rates = [self.f.map(n)(node, ca.DM(inputs), theta) for node, inputs in zip(nodes, at)]
        h = ca.repmat(ca.DM(np.diff(recording["time"])).T, size, 1)
        defects = []
        for i, row in enumerate(self.weights):
            change = sum(a * rate for a, rate in zip(row, rates) if a != 0)
            defects.append(ca.diag(1 / self.scale) @ (nodes[i + 1] - nodes[0] - change * h))
        samples = physical[:, ::s], ca.DM(target), ca.repmat(self.theta, 1, n + 1)
        shown = self.h.map(n + 1)(*samples)
        squares = 0
        for k, (column, sd) in enumerate(self.case.measured.values()):
            seen = np.isfinite(recording[column])
            recorded = ca.DM(np.where(seen, recording[column], 0)).T
            mask = ca.DM(seen.astype(float)).T
            squares += ca.sumsqr(mask * (recorded - shown[k, :])) / sd**2
        fixed = np.full(x.numel(), np.inf)
        fixed[self.known] = 0
        limited = ca.vec(shown[len(self.case.measured) :, :].T)
        return x, squares, ca.vec(ca.vertcat(*defects)), limited, fixed

    def multipliers(self, equality, inequality):
        """CasADi's multipliers of g and of z from those of pilotage, whose equalities begin in each run with its
        known initial states, and whose inequalities end with the ranges of the parameters."""
        lam_x, lam_g, rest = np.zeros(self.nlp["x"].numel()), [], np.array(equality)
        fixed = np.flatnonzero(self.limits["lbx"] == self.limits["ubx"])
        known = len(self.known)
        for j, defects in enumerate(self.defects):
            lam_x[fixed[j * known : (j + 1) * known]] = rest[:known]
            lam_g.append(rest[known : known + defects])
            rest = rest[known + defects :]
        ranges = [np.isfinite([own.low, own.high]) for own in self.ranges]
        limited = len(inequality) - np.sum(ranges)
        of_ranges = iter(inequality[limited:])
        first = len(lam_x) - len(self.ranges)
        for k, (ends, sizes) in enumerate(zip(ranges, self.sizes())):
            for sign, is_there, size in zip((1, -1), ends, sizes):
                if is_there:
                    lam_x[first + k] += sign * next(of_ranges) * self.scale_theta[k] / size
        return np.concatenate([*lam_g, inequality[:limited]]), lam_x

    def kkt(self, x, lam_g, lam_x):
        return kkt(self.nlp, self.limits, x, lam_g, lam_x)
