"""Checks fits that are linear in their parameters with statsmodels and SciPy; prints the largest relative differences.

usage: regression.py PLAIN.json CR3.json HUBER.json RUN.csv...
The first three: `pilotage fit --json` of y = a + b t + c t²/2 with sd = 0.1, by normal and by Huber's noise.
"""

import json
import sys

import numpy as np
import statsmodels.api as sm
from scipy.optimize import least_squares
from statsmodels.robust.norms import HuberT
from statsmodels.stats.diagnostic import acorr_ljungbox

SD, THRESHOLD = 0.1, 1.345

plain, cr3, huber = (json.load(open(path)) for path in sys.argv[1:4])
runs = [np.loadtxt(path, delimiter=",", skiprows=1) for path in sys.argv[4:]]
t, y = np.concatenate(runs).T
X = np.column_stack([np.ones_like(t), t, t**2 / 2])
groups = np.repeat(np.arange(len(runs)), [len(run) for run in runs])


def values(fit):
    return np.array([own["value"] for own in fit["parameters"].values()])


def covariance(fit):
    return np.array(fit["uncertainty"]["covariance"])


def error(found, expected):
    return float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))


def ljung_box():
    errors = []
    for own, run in zip(plain["runs"], runs, strict=True):
        found = own["measured"]["y"]["ljung_box"]
        time, seen = run.T
        residuals = seen - np.column_stack([np.ones_like(time), time, time**2 / 2]) @ values(plain)
        told = acorr_ljungbox(residuals, lags=[found["lags"]])
        errors.append(abs(found["statistic"] - told["lb_stat"].iloc[0]))
        errors.append(abs(found["p"] - told["lb_pvalue"].iloc[0]))
    return float(max(errors))


ols = sm.OLS(y, X).fit()
# Mancl and DeRouen's covariance of clusters; the jackknife has it times (G - 1)/G.
clusters = sm.GEE(y, X, groups=groups).fit(cov_type="bias_reduced").cov_params()
rlm = sm.RLM(y, X, M=HuberT(THRESHOLD))
rlm = rlm.fit(scale_est=lambda model, residuals: SD, update_scale=False, cov="H1", tol=1e-13, maxiter=1000)
slope = np.abs(rlm.sresid) <= THRESHOLD
assert 0 < np.sum(~slope) < len(y) / 2, "some are outliers"
# What statsmodels multiplies with for few values.
few = 1 + X.shape[1] / len(y) * np.var(slope) / np.mean(slope) ** 2
least = least_squares(
    lambda p: (y - X @ p) / SD, ols.params, loss="huber", f_scale=THRESHOLD, xtol=1e-15, ftol=1e-15, gtol=1e-13
)

print(json.dumps({
    "squares": error(values(plain), ols.params),
    "plain": error(covariance(plain), ols.cov_params()),
    "clusters": error(covariance(cr3), (1 - 1 / len(runs)) * clusters),
    "ljung-box": ljung_box(),
    "huber": error(values(huber), rlm.params),
    "huber, scipy": error(values(huber), least.x),
    # SciPy's cost is half the sum.
    "objective, scipy": abs(huber["objective"] / (2 * least.cost) - 1),
    "huber's covariance": error(covariance(huber), rlm.cov_params() / few**2),
}))
