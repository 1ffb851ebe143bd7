"""Writes the reference tables in tests/data: 1,000 random tables and smaller sets.

Needs numpy, scipy, pandas, pingouin, statsmodels, matplotlib. Each file's header names versions and
methods.
Run: python reference.py
"""

import pathlib
import warnings

import matplotlib
import matplotlib.cbook
import numpy as np
import pandas as pd
import pingouin
import scipy
import statsmodels
import statsmodels.api as sm
from scipy import optimize, special, stats

HERE = pathlib.Path(__file__).parent / "data"
VERSIONS = (f"numpy {np.__version__}, scipy {scipy.__version__}, pingouin {pingouin.__version__}, "
            f"statsmodels {statsmodels.__version__}, matplotlib {matplotlib.__version__}")
SIDES = ["two-sided", "greater", "less"]
ZEROS = ["wilcox", "pratt", "zsplit"]
rng = np.random.default_rng(20240917)
warnings.filterwarnings("ignore")


def text(values):
    return " ".join(repr(float(v)).removesuffix(".0") for v in np.atleast_1d(values))


def write(name, method, header, rows):
    lines = [f"# {VERSIONS}", *(f"# {line}" for line in method), ",".join(header)]
    lines += [",".join(v if isinstance(v, str) else text(v) for v in row) for row in rows]
    (HERE / name).write_text("\n".join(lines) + "\n")


def table(index):
    """Two thirds are Likert ratings, 1 to 7; the others have three decimals. Effects: none to complete."""
    n, k = int(rng.integers(5, 41)), int(rng.integers(3, 7))
    effect = rng.choice([0.0, 0.3, 1.0, 3.0]) * rng.normal(size=k)
    x = rng.normal(size=(n, k)) * rng.choice([0.5, 1.0]) + effect + 0.5 * rng.normal(size=(n, 1))
    if index % 5 == 0:
        x = np.exp(x)
    return np.round(x, 3) if index % 3 == 0 else np.clip(np.round(4 + 1.5 * x), 1, 7)


def tables():
    rows = []
    while len(rows) < 1000:
        index = len(rows)
        x = table(index)
        n, k = x.shape
        a, b = x[:, 0], x[:, 1]
        # These degenerate tables have no finite reference values.
        if np.all(a == b) or np.all(a == a[0]) or np.all(x == x[:, :1]):
            continue
        side, zeros = SIDES[index % 3], ZEROS[index // 3 % 3]

        box = matplotlib.cbook.boxplot_stats(a)[0]
        five = [box[key] for key in ["med", "q1", "q3", "whislo", "whishi"]]
        described = [box["mean"], a.std(ddof=1), *five]
        skew = "" if n < 8 or stats.skew(a) == 0 else stats.skewtest(a, alternative=side)

        def wilcoxon(**options):
            return stats.wilcoxon(a, b, zero_method=zeros, alternative=side, **options)

        p = [wilcoxon(method=m, correction=c).pvalue
             for m, c in [("exact", False), ("asymptotic", False), ("asymptotic", True), ("auto", True)]]
        enumerated = ""
        if n <= 12:
            enumerated = wilcoxon(method=stats.PermutationMethod(n_resamples=np.inf)).pvalue
        pair = pingouin.wilcoxon(a, b, alternative="two-sided").iloc[0]
        chi = stats.friedmanchisquare(*x.T)
        f = pingouin.friedman(pd.DataFrame(x), method="f").iloc[0]
        friedman = [chi.statistic, chi.pvalue, f["W"], f["F"], f["ddof1"], f["ddof2"], f["p_unc"]]
        assert np.isfinite(described + p + friedman[:3]).all()
        rows.append([" | ".join(text(column) for column in x.T), side, zeros, described,
                     np.sort(box["fliers"]) if len(box["fliers"]) else "", skew,
                     wilcoxon(method="exact").statistic, p, enumerated, [pair["CLES"], pair["RBC"]],
                     friedman])
    method = [
        "columns: conditions, divided by |. describe, skew: of the first. Others: first against second.",
        "describe: matplotlib.cbook.boxplot_stats and numpy.std(ddof=1).",
        "skew: scipy skewtest. Blank if n < 8 or the skewness is exactly 0.",
        'wilcoxon: scipy, method="exact"; "asymptotic" without and with correction; "auto" with correction.',
        "enumerated: scipy wilcoxon, PermutationMethod(n_resamples=inf), if n <= 12.",
        "effects: CLES and RBC of pingouin.wilcoxon, two-sided.",
        "friedman: chi-square and p of scipy friedmanchisquare.",
        'friedman, then: W, F, ddof1, ddof2 and p of pingouin.friedman(method="f").',
    ]
    header = ["columns", "side", "zeros", "describe", "outliers", "skew", "statistic", "wilcoxon",
              "enumerated", "effects", "friedman"]
    write("tables.csv", method, header, rows)


def proportions():
    rows = []
    for index in range(400):
        n = int(rng.integers(1, 60)) if index % 4 else int(rng.integers(60, 3000))
        k = int(rng.integers(0, n + 1))
        p0 = [0.5, 0.5, 1 / 3, round(float(rng.uniform(0, 1)), 3)][index % 4]
        side, confidence = SIDES[index % 3], [0.95, 0.9, 0.99, 0.5, 0.999999][index % 5]
        test = stats.binomtest(k, n, p0, alternative=side)
        both = stats.binomtest(k, n)
        ci = both.proportion_ci(confidence_level=confidence, method="wilson")
        rows.append([k, n, p0, side, test.pvalue, confidence, [ci.low, ci.high]])
    write("proportions.csv",
          ['p: scipy.stats.binomtest. wilson: its proportion_ci(method="wilson"), two-sided.'],
          ["k", "n", "p0", "side", "p", "confidence", "wilson"], rows)


def corrections():
    rows = []
    for _ in range(100):
        p = rng.uniform(size=int(rng.integers(1, 30))) ** rng.choice([1, 3, 10])
        p[rng.uniform(size=p.size) < 0.2] = p[0]
        kept = p.copy()
        p[rng.uniform(size=p.size) < 0.1] = np.nan
        p[0] = kept[0]
        bonferroni, holm = (pingouin.multicomp(p, method=m)[1] for m in ["bonf", "holm"])
        known = ~np.isnan(p)
        check = sm.stats.multipletests(p[known], method="holm")[1]
        assert np.allclose(holm[known], check, rtol=1e-12, atol=0)
        rows.append([p, bonferroni, holm])
    write("corrections.csv",
          ['pingouin.multicomp, methods "bonf" and "holm". statsmodels gives the same for holm.'],
          ["p", "bonferroni", "holm"], rows)


def bradley_terry(wins):
    """Abilities, covariance and likelihood ratio by a logistic regression on one row a pair."""
    k = len(wins)
    pairs = [(i, j) for i in range(k) for j in range(i) if wins[i, j] + wins[j, i] > 0]
    design = np.array([np.eye(k)[i] - np.eye(k)[j] for i, j in pairs])
    counts = np.array([[wins[i, j], wins[j, i]] for i, j in pairs])
    model = sm.GLM(counts, design[:, 1:], family=sm.families.Binomial())
    fit = model.fit(tol=1e-12, tol_criterion="params", maxiter=200)
    # Item 0 is the zero of the regression. This matrix moves the zero to the mean.
    center = (np.eye(k) - 1 / k)[:, 1:]
    abilities, covariance = center @ fit.params, center @ fit.cov_params() @ center.T

    def loss(b):
        d = design[:, 1:] @ b
        return -np.sum(counts * special.log_expit(np.stack([d, -d], axis=1)))

    def slope(b):
        d = design[:, 1:] @ b
        return -design[:, 1:].T @ (counts[:, 0] - counts.sum(axis=1) * special.expit(d))

    def curvature(b):
        p = special.expit(design[:, 1:] @ b)
        return design[:, 1:].T @ (design[:, 1:] * (counts.sum(axis=1) * p * (1 - p))[:, None])

    newton = optimize.minimize(loss, np.zeros(k - 1), jac=slope, hess=curvature, method="trust-exact",
                               options={"gtol": 1e-11})
    newton.x -= np.linalg.solve(curvature(newton.x), slope(newton.x))
    assert np.allclose(center @ newton.x, abilities, rtol=0, atol=1e-9)
    inverse = center @ np.linalg.inv(curvature(newton.x)) @ center.T
    assert np.allclose(inverse, covariance, rtol=1e-8, atol=1e-10)
    if np.all(counts == np.round(counts)):
        single = np.repeat(np.concatenate([design, design])[:, 1:], counts.T.ravel().astype(int), axis=0)
        won = np.repeat([1, 0], counts.sum(axis=0).astype(int))
        logit = sm.Logit(won, single).fit(disp=0, method="newton", tol=1e-14, maxiter=200)
        assert np.allclose(logit.params, fit.params, rtol=0, atol=1e-9)
        assert np.allclose(logit.cov_params(), fit.cov_params(), rtol=1e-8, atol=1e-10)
    ratio = 2 * (loss(np.zeros(k - 1)) - loss(newton.x))
    return abilities, covariance, [ratio, stats.chi2.sf(ratio, k - 1)]


def preferences():
    rows = []
    while len(rows) < 80:
        k = int(rng.integers(2, 8))
        ability = rng.normal(size=k) * rng.choice([0.3, 1.0, 2.0])
        wins = np.zeros((k, k))
        for i in range(k):
            for j in range(i):
                n = int(rng.integers(0, 41))
                wins[i, j] = rng.binomial(n, special.expit(ability[i] - ability[j]))
                wins[j, i] = n - wins[i, j]
                if len(rows) % 3 == 0 and wins[i, j] >= 1:
                    wins[[i, j], [j, i]] += [-0.5, 0.5]
        strong = np.linalg.matrix_power(np.eye(k) + (wins > 0), k) > 0
        if not strong.all():
            continue
        abilities, covariance, ratio = bradley_terry(wins)
        penalised = bradley_terry(wins + 0.5 * (1 - np.eye(k)))
        rows.append([k, wins.ravel(), abilities, covariance.ravel(), ratio, penalised[0],
                     penalised[1].ravel()])
    write("preferences.csv",
          ["statsmodels GLM(Binomial), no intercept, one row a pair.",
           "reference.py finds the same with scipy's trust-exact Newton method and, for whole counts, "
           "with statsmodels Logit.",
           "ratio: likelihood ratio, and p of chi-square(k - 1).",
           "penalised: the same after half a win is added to all cells off the diagonal."],
          ["k", "wins", "abilities", "covariance", "ratio", "penalised", "penalised_covariance"], rows)


if __name__ == "__main__":
    HERE.mkdir(exist_ok=True)
    tables()
    proportions()
    corrections()
    preferences()
