#!/usr/bin/env python3
"""PyVBMC and BOBE beside `Settings::for_budget` on the problems of `studies specialists`, PyVBMC on PS and PEEK too.

    pip install pyvbmc==1.5.0 scipy
    cargo build --release -p studies
    python3 crates/studies/peers/specialists.py [--seeds N] [--only NAME]

    pip install BOBE==0.1.0
    python3 crates/studies/peers/specialists.py --package bobe [--seeds N]

PyVBMC runs with its defaults from a random point until it says that it is done; the calls it took, its evidence, its own standard
deviation of it, and its posterior moments are held against the exact answers. Half a minute to two minutes a run.

BOBE runs with its defaults on its banana until it has made 32 calls, and then takes its evidence by nested sampling of its surrogate;
two to four minutes a run.

Writes results/benchmarks/specialists/pyvbmc.md or bobe.md.
"""

import argparse
import contextlib
import datetime
import importlib.metadata
import io
import json
import logging
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]


def valley(x):
    return -((x[0] ** 2 - x[1]) ** 2) - (x[0] - 1) ** 2 / 100


def banana(x):
    return -0.25 * (5 * (0.2 - x[0])) ** 2 - (20 * (x[1] / 4 - x[0] ** 4)) ** 2


def himmelblau(x):
    return -0.5 * (0.1 * (x[0] + x[1] ** 2 - 7) ** 2 + (x[0] ** 2 + x[1] - 11) ** 2)


def rosenbrock(x):
    return -((1 - x[0]) ** 2) - 100 * (x[1] - x[0] ** 2) ** 2


def ring(x):
    return -0.5 * ((np.hypot(x[0] - 0.5, x[1] - 0.5) - 0.2) / 0.02) ** 2


# Name: log likelihood, sd of a normal prior or bounds of a uniform one, exact ln Z, means, sds (as in src/specialists.rs).
PLANES = {
    "Rosenbrock's valley, prior sd 3": (valley, 3.0, -2.2598471, [0.026341, 1.248229], [1.147555, 1.563508]),
    "Rosenbrock's valley, prior variance 3": (valley, 3**0.5, -1.5140739, [0.014933, 0.640129], [0.864057, 0.982668]),
    "banana": (banana, [(-1, 1), (-1, 2)], -3.1848192, [0.191290, 0.122152], [0.272280, 0.302605]),
    "Himmelblau": (himmelblau, [(-4, 4), (-4, 4)], -3.1834265, [0.915369, 0.322257], [3.126685, 2.315466]),
    "Rosenbrock": (rosenbrock, [(-1, 4), (-1, 7)], -4.8591332, [0.986182, 1.430526], [0.676763, 1.426467]),
    "ring": (ring, [(0, 1), (0, 1)], -2.7646453, [0.5, 0.5], [0.143527, 0.143527]),
}


def of_material(name):
    """Log likelihood and bounds in log10 of the parameters, with the exact answer by `studies exact`."""
    import peers

    model = peers.Model(name)
    exact = json.loads(subprocess.check_output([ROOT / "target/release/studies", "exact", "-m", name]))
    bounds = list(zip(model.low, model.high))
    return lambda x: float(model.ln_likelihood(np.atleast_2d(x))[0]), bounds, exact["log_evidence"], exact["mean"], exact["sd"]


def run(problem, seed):
    from pyvbmc import VBMC

    ln_likelihood, prior, exact, mean, sd = problem
    d = len(mean)
    rng = np.random.default_rng(seed)
    np.random.seed(seed)
    if isinstance(prior, float):
        lower, upper = np.full((1, d), -np.inf), np.full((1, d), np.inf)
        inner = np.full((1, d), -prior), np.full((1, d), prior)
        ln_prior = lambda x: -0.5 * np.sum(x**2) / prior**2 - d * np.log(prior * np.sqrt(2 * np.pi))
    else:
        lower, upper = np.array(prior, dtype=float).T.reshape(2, 1, d)
        margin = 0.05 * (upper - lower)
        inner = lower + margin, upper - margin
        ln_prior = lambda x: -np.sum(np.log(upper - lower))
    begin = time.process_time()
    with contextlib.redirect_stdout(io.StringIO()):
        vbmc = VBMC(
            lambda x: ln_likelihood(np.ravel(x)) + ln_prior(np.ravel(x)),
            rng.uniform(*inner), lower, upper, *inner, options={"display": "off"},
        )
        posterior, results = vbmc.optimize()
    moments, covariance = posterior.moments(10**6, cov_flag=True)
    off = np.abs((np.ravel(moments) - mean) / sd).max()
    wide = np.abs(np.sqrt(np.diag(covariance)) / sd - 1).max()
    return results["func_count"], results["elbo"] - exact, results["elbo_sd"], off, wide, time.process_time() - begin


def run_bobe(problem, seed, calls):
    """Calls made, error of ln Z, half of the range that BOBE states for it."""
    from BOBE import BOBE

    ln_likelihood, bounds, exact, _, _ = problem
    made = []

    def counted(x):
        made.append(1)
        return float(ln_likelihood(np.ravel(x)))

    with tempfile.TemporaryDirectory() as folder:
        sampler = BOBE(
            counted, param_list=["x", "y"], param_bounds=np.array(bounds, dtype=float).T,
            likelihood_name="problem", save=False, save_dir=folder, seed=seed, verbosity="WARNING",
        )
        # A threshold that it cannot meet, so that it makes all calls.
        ln_z = sampler.run(min_evals=calls, max_evals=calls, logz_threshold=1e-4, do_final_ns=True)["logz"]
    return len(made), ln_z["mean"] - exact, 0.5 * (ln_z["upper"] - ln_z["lower"])


def page(title, package, options, seeds, stated, columns):
    """The lines of a page up to its first row."""
    version = importlib.metadata.version(package)
    return [
        f"# {title}",
        "",
        f"- made by: crates/studies/peers/specialists.py{options}",
        f"- {package} {version}, numpy {np.__version__}; date: {datetime.date.today()}",
        "",
        f"{seeds} seeds, every one in a row. `stated` is {stated}. Compare report.md.",
        "",
        f"| {' | '.join(columns)} |",
        "|---" * len(columns) + "|",
    ]


def of_bobe(seeds):
    lines = page(
        "BOBE on its banana, at 32 calls", "BOBE", " --package bobe", seeds, "half of the range that BOBE gives for ln Z",
        ["problem", "calls", "ln Z off", "stated"],
    )
    off = []
    for seed in range(1, seeds + 1):
        calls, ln_z, stated = run_bobe(PLANES["banana"], seed, 32)
        off.append(abs(ln_z))
        lines.append(f"| banana | {calls} | {ln_z:.4f} | {stated:.4f} |")
        print(lines[-1], flush=True)
    lines += ["", f"ln Z is off by {np.median(off):.3f} in the median of the seeds, by more than 0.055 in {sum(o > 0.055 for o in off)} of {seeds}."]
    write("bobe.md", lines)


def of_pyvbmc(seeds, only):
    lines = page(
        "PyVBMC on the same problems", "PyVBMC", "", seeds, "PyVBMC's own standard deviation of its bound of ln Z",
        ["problem", "calls", "ln Z off", "stated", "worst mean [posterior sd]", "worst sd, relative", "seconds"],
    )
    for name in [*PLANES, "ps", "peek"]:
        if only not in name:
            continue
        problem = PLANES.get(name) or of_material(name)
        for seed in range(1, seeds + 1):
            calls, ln_z, stated, off, wide, seconds = run(problem, seed)
            lines.append(f"| {name} | {calls} | {ln_z:.4f} | {stated:.4f} | {off:.3f} | {wide:.3f} | {seconds:.0f} |")
            print(lines[-1], flush=True)
    write("pyvbmc.md", lines)


def write(name, lines):
    folder = ROOT / "results/benchmarks/specialists"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text("\n".join(lines) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--only", default="")
    parser.add_argument("--package", choices=["pyvbmc", "bobe"], default="pyvbmc")
    arguments = parser.parse_args()
    logging.disable(logging.CRITICAL)
    if arguments.package == "pyvbmc":
        of_pyvbmc(arguments.seeds, arguments.only)
    elif arguments.only:
        parser.error("--only is for pyvbmc: BOBE runs on its banana")
    else:
        of_bobe(arguments.seeds)


if __name__ == "__main__":
    main()
