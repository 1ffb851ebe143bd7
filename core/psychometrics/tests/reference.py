"""Writes reference.json beside this file, with values of independent programs for tests/reference.rs.

QUEST+ runs come from the package questplus, fits from scipy.optimize, distributions from scipy.stats.
Run: pip install numpy scipy questplus && python reference.py
"""

import json
import pathlib
import platform
from importlib.metadata import version

import numpy as np
import questplus
from scipy import optimize, special, stats

rng = np.random.default_rng(1)


def quest(func, scale, stimuli, names, grids, truth, trials):
    """One run: level, expected entropy, answer, posterior mean and mode of every trial."""
    settings = dict(
        stim_domain={"intensity": stimuli},
        param_domain=dict(zip(names, grids)),
        outcome_domain={"response": ["Correct", "Incorrect"]},
        func=func,
        stim_scale=scale,
    )
    means = questplus.QuestPlus(**settings, param_estimation_method="mean")
    rows = []
    for _ in range(trials):
        stimulus = means.next_stim
        p = truth(stimulus["intensity"])
        correct = bool(rng.random() < p)
        entropy = float(means.entropy)
        means.update(stim=stimulus, outcome={"response": "Correct" if correct else "Incorrect"})
        mean = [means.param_estimate[n] for n in names]
        means.param_estimation_method = "mode"
        mode = [means.param_estimate[n] for n in names]
        means.param_estimation_method = "mean"
        weights = [means.marginal_posterior[n] for n in names]
        sd = [float(np.sqrt((w * (g - m) ** 2).sum())) for w, g, m in zip(weights, grids, mean)]
        level = stimulus["intensity"]
        rows.append(dict(level=level, entropy=entropy, correct=correct, mean=mean, mode=mode, sd=sd))
    return rows


def distribution(shape, axis, x, t, b):
    """F of a psychometric function, written with scipy's functions."""
    if shape == "logistic":
        return special.expit(b * (x - t))
    if shape == "gaussian":
        return stats.norm.cdf(x, t, 1 / b)
    scale = {"log10": 1.0, "decibel": 20.0}
    ratio = x / t if axis == "linear" else 10 ** ((x - t) / scale[axis])
    return -np.expm1(-(ratio**b))


def fit(shape, axis, guess, lapse, rows):
    """Most likely threshold and slope with 95 % intervals, and lapse rate up to `lapse` if above 0."""
    x, k, n = (np.array(column, dtype=float) for column in zip(*rows))
    fitted = lapse > 0

    def deviance(parameters):
        t, log_b = parameters[:2]
        extra = parameters[2] if fitted else 0.0
        f = distribution(shape, axis, x, t, np.exp(log_b))
        p = np.clip(guess + (1 - guess - extra) * f, 1e-300, 1 - 1e-16)
        return -2 * (special.xlogy(k, p) + special.xlogy(n - k, 1 - p)).sum()

    def least(function, starts, limits):
        options = dict(xatol=1e-12, fatol=1e-14, maxiter=20000, maxfev=20000)

        def simplex(start):
            return optimize.minimize(function, start, method="Nelder-Mead", bounds=limits, options=options)

        best = min(map(simplex, starts), key=lambda r: r.fun)
        # A simplex stops where the value no longer changes: a new one from there goes on.
        for _ in range(3):
            best = simplex(best.x)
        return best

    width = np.ptp(x) if axis != "linear" or shape != "weibull" else np.log(x[-1] / x[0])
    starts = [
        [t, np.log(b / width)] + ([lapse / 2] if fitted else [])
        for t in np.linspace(x[0], x[-1], 5)
        for b in ([3, 10, 30] if shape != "weibull" or axis == "linear" else [1 * width, 4 * width])
    ]
    limits = [(x[0] - 100, x[-1] + 100), (-10, 10)] + ([(0, lapse)] if fitted else [])
    if shape == "weibull" and axis == "linear":
        limits[0] = (1e-6, 100)
    best = least(deviance, starts, limits)

    def end(index, direction):
        def drop(value):
            def inner(rest):
                return deviance(np.insert(rest, index, value))

            others = [limit for i, limit in enumerate(limits) if i != index]
            return least(inner, [np.delete(best.x, index)], others).fun - best.fun - stats.chi2.ppf(0.95, 1)

        step = 0.01
        while drop(best.x[index] + direction * step) < 0:
            step *= 2
        return optimize.brentq(lambda s: drop(best.x[index] + direction * s), 0, step, xtol=1e-9)

    ends = [[best.x[i] + d * end(i, d) for d in (-1, 1)] for i in (0, 1)]
    saturated = 2 * (special.xlogy(k, k / n) + special.xlogy(n - k, 1 - k / n)).sum()
    total = float(best.fun + saturated)
    degrees = len(rows) - (3 if fitted else 2)
    return dict(
        shape=shape,
        axis=axis,
        guess=guess,
        lapse_up_to=lapse if fitted else None,
        rows=[dict(level=float(a), correct=int(b), total=int(c)) for a, b, c in rows],
        threshold=float(best.x[0]),
        slope=float(np.exp(best.x[1])),
        lapse=float(best.x[2]) if fitted else 0.0,
        threshold_interval=[float(e) for e in ends[0]],
        slope_interval=[float(np.exp(e)) for e in ends[1]],
        log_likelihood=float(-best.fun / 2),
        deviance=total,
        p_value=float(stats.chi2.sf(total, degrees)),
    )


def drawn(shape, axis, guess, lapse, t, b, levels, n):
    p = guess + (1 - guess - lapse) * distribution(shape, axis, np.array(levels, dtype=float), t, b)
    return [(x, rng.binomial(n, q), n) for x, q in zip(levels, p)]


out = dict(
    made_with=[f"python {platform.python_version()}"]
    + [f"{name} {version(name)}" for name in ("numpy", "scipy", "questplus")],
    functions=[
        dict(shape=s, axis=a, level=x, threshold=t, slope=b, f=float(distribution(s, a, x, t, b)))
        for s, a, x, t, b in [
            ("weibull", "linear", 1.7, 1.2, 2.5),
            ("weibull", "log10", -1.1, -0.9, 3.5),
            ("weibull", "decibel", -31.0, -20.0, 3.5),
            ("logistic", "decibel", 3.0, -1.0, 0.7),
            ("gaussian", "linear", -7.0, 1.0, 0.9),
            ("gaussian", "linear", 1.4, 1.0, 0.9),
        ]
    ],
    weibull=quest(
        "weibull",
        "dB",
        np.arange(-40.0, 1.0),
        ["threshold", "slope", "lower_asymptote", "lapse_rate"],
        [np.arange(-39.0, 0.0, 2.0), np.array([2.0, 3.5, 5.0]), np.array([0.5]), np.array([0.0, 0.02, 0.05])],
        lambda x: 0.5 + 0.48 * distribution("weibull", "decibel", x, -18.3, 3.5),
        60,
    ),
    gaussian=quest(
        "norm_cdf",
        "linear",
        np.linspace(-2.0, 2.0, 33),
        ["mean", "sd", "lower_asymptote", "lapse_rate"],
        [np.linspace(-1.5, 1.5, 25), np.array([2.0, 1.0, 0.5, 0.25]), np.array([0.0]), np.array([0.01])],
        lambda x: 0.99 * stats.norm.cdf(x, 0.37, 0.5),
        60,
    ),
    fits=[
        fit(shape, axis, guess, bound, drawn(shape, axis, guess, lapse, t, b, levels, n))
        for shape, axis, guess, bound, lapse, t, b, levels, n in [
            ("weibull", "linear", 0.5, 0.0, 0.0, 1.2, 3, [0.4, 0.7, 1, 1.4, 2, 3], 40),
            ("weibull", "decibel", 0.5, 0.06, 0.03, -20, 3.5, range(-30, -9, 3), 60),
            ("weibull", "log10", 1 / 3, 0.0, 0.0, -1, 2, np.arange(-1.8, 0, 0.2), 20),
            ("logistic", "linear", 0.0, 0.0, 0.0, 5, 1.5, range(2, 9), 30),
            ("logistic", "decibel", 0.25, 0.1, 0.05, 0, 0.8, range(-8, 10, 2), 80),
            ("gaussian", "linear", 0.0, 0.0, 0.0, 1, 2, [0, 0.4, 0.8, 1.2, 1.6, 2], 50),
            ("gaussian", "linear", 0.0, 0.05, 0.0, 1, 2, np.arange(0, 2.6, 0.3), 50),
        ]
    ],
)
# One item of a list a line.
lists = ["%s: [\n%s\n]" % (json.dumps(k), ",\n".join(map(json.dumps, v))) for k, v in out.items()]
text = "{\n%s\n}\n" % ",\n".join(lists)
pathlib.Path(__file__).with_suffix(".json").write_text(text)
