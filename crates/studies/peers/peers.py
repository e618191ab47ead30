#!/usr/bin/env python3
"""GrainLearning, nautilus, dynesty and emcee beside `calibrate`: the same closed-form model, data, prior and noise.

    cargo build --release -p calibrate -p studies
    python3 crates/studies/peers/peers.py

makes a virtual environment (target/peers), installs requirements.txt into it, runs every method for several seeds, one
after the other on one core, and writes results/benchmarks/peers/report.md and table.csv. Errors are against `studies exact`
(quadrature). About five minutes per seed.
"""

import argparse
import csv
import datetime
import io
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
MATERIALS = {
    # R, E, gamma of Table 1, phi, experiment, priors (log-uniform): C1, tau_s, delta_c.
    "ps": (30.5e-6, 1.60e9, 35.0e-3, 1.08, "ps-r30", [(1e-6, 1e-1), (1e-2, 1.0), (1e-8, 3e-6)]),
    "pa12": (31.5e-6, 1.65e9, 40.7e-3, 2 ** (1 / 3), "pa12-r32", [(1e-8, 1e-2), (0.5, 50.0), (1e-8, 3e-6)]),
    "peek": (25.0e-6, 2.00e9, 41.0e-3, 2 ** (1 / 3), "peek-450pf-r25", [(1e-9, 1e-3), (3.0, 300.0), (1e-8, 3e-6)]),
}
NU0, S0 = 4.0, 0.05
ADHESION = 1e-3  # fa/(K1 R): the overlap that the contact starts with at least
ONE_CORE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "RAYON_NUM_THREADS": "1"}
SHARE = 0.4  # of nautilus's simulations with the same seed, for one run of calibrate
AT_SHARE = f"calibrate at {SHARE:.0%} of nautilus"
METHODS = ["calibrate 4096", "calibrate 16384", "GrainLearning", "nautilus", AT_SHARE, "dynesty", "emcee"]


class Model:
    """Three-stage neck growth (eqs. 3 to 5), its prior and noise; vectorised over rows of log10 (C1, tau_s, delta_c).

    Coded here on its own, as the peers are Python packages; `agree` holds it against `calibrate simulate` to 1e-12.
    """

    def __init__(self, material):
        import numpy as np

        self.np = np
        self.radius, young, self.gamma, phi, experiment, bounds = MATERIALS[material]
        rows = [line.split(",") for line in (ROOT / "experiments" / f"{experiment}.csv").read_text().splitlines()]
        rows = [row for row in rows if not row[0].startswith(("#", "time_s"))]
        self.time = np.array([float(row[0]) for row in rows])
        self.data = np.array([float(row[1]) for row in rows])
        self.low, self.high = np.log10(np.array(bounds)).T
        adhesive = np.cbrt(9 * np.pi / (2 * young) * (2 * self.gamma) / (2 * self.radius))
        self.x0 = max(ADHESION, adhesive**2)
        self.end = phi**2
        self.simulations = 0
        m = len(self.data)
        from scipy.special import gammaln

        self.constant = gammaln((NU0 + m) / 2) - gammaln(NU0 / 2) - m / 2 * np.log(np.pi * NU0 * S0**2)

    def curves(self, log10):
        np = self.np
        log10 = np.atleast_2d(log10)
        self.simulations += len(log10)
        c1, tau, delta = (10.0 ** log10[:, [k]] for k in range(3))
        b = 63 * np.pi**3 / 16 * (delta / self.radius) ** 2 * (2 * c1 * self.gamma / self.radius)
        knee = (63 * np.pi**3 * (delta / (8 * self.radius)) ** 2) ** 0.2
        knee = np.clip(knee**2, self.x0, self.end)
        start = self.x0**3.5
        time_of_knee = np.maximum(knee**3.5 - start, 0.0) / b
        zipping = (start + b * self.time) ** (2 / 7)
        stretching = knee + (self.time - time_of_knee) / tau
        x = np.where(self.time < time_of_knee, np.minimum(zipping, knee), stretching)
        return np.sqrt(np.minimum(x, self.end))

    def ln_likelihood(self, log10):
        """Multivariate Student t: sigma^2 ~ Inverse-Gamma(nu0/2, nu0 s0^2/2) integrated out."""
        np = self.np
        squares = ((self.curves(log10) - self.data) ** 2).sum(axis=1)
        return self.constant - (NU0 + len(self.data)) / 2 * np.log1p(squares / (NU0 * S0**2))

    def of_cube(self, u):
        return self.low + (self.high - self.low) * u


def moments(np, points, weights=None):
    mean = np.average(points, axis=0, weights=weights)
    return mean.tolist(), np.sqrt(np.average((points - mean) ** 2, axis=0, weights=weights)).tolist()


def grain_learning(model, seed):
    """Its defaults (ess_target 0.3, one component), eight iterations as in its documentation, 2048 samples each."""
    import contextlib

    import numpy as np
    from grainlearning import BayesianCalibration
    from grainlearning.dynamic_systems import DynamicSystem

    np.random.seed(seed)
    # Noise relative to each measured value is its default, and impossible where one is zero.
    zero = bool((model.data == 0).any())

    def simulate(calibration):
        calibration.system.set_sim_data(model.curves(calibration.system.param_data)[:, None, :])

    calibration = BayesianCalibration.from_dict({
        "num_iter": 8,
        "callback": simulate,
        "system": {
            "system_type": DynamicSystem,
            "param_min": model.low.tolist(),
            "param_max": model.high.tolist(),
            "param_names": ["c1", "tau_s", "delta_c"],
            "num_samples": 2048,
            "obs_data": model.data.tolist(),
            "obs_names": ["contact_ratio"],
            "ctrl_data": model.time.tolist(),
            "ctrl_name": "time_s",
            "sim_name": "neck",
        },
        "inference": {"Bayes_filter": {"ess_target": 0.3, "scale_cov_with_max": zero}, "sampling": {"max_num_components": 1, "random_state": None}},
        "save_fig": -1,
    })
    with contextlib.redirect_stdout(io.StringIO()):
        calibration.run()
    weights = calibration.inference.Bayes_filter.get_posterior_at_time(-1)
    return *moments(np, calibration.system.param_data, weights), None


def nautilus(model, seed):
    """Its defaults: 2000 live points, effective sample size 10 000, exploration discarded or not as it does."""
    import numpy as np
    from nautilus import Sampler

    sampler = Sampler(model.of_cube, model.ln_likelihood, n_dim=3, vectorized=True, pass_dict=False, seed=seed)
    sampler.run(verbose=False)
    points, ln_weights, _ = sampler.posterior()
    return *moments(np, points, np.exp(ln_weights - ln_weights.max())), float(sampler.log_z)


def dynesty(model, seed):
    """The dynamic sampler with its defaults."""
    import numpy as np
    from dynesty import DynamicNestedSampler

    sampler = DynamicNestedSampler(
        lambda x: float(model.ln_likelihood(x)[0]), model.of_cube, 3, rstate=np.random.default_rng(seed)
    )
    sampler.run_nested(print_progress=False)
    found = sampler.results
    return *moments(np, found.samples, np.exp(found.logwt - found.logwt.max())), float(found.logz[-1])


def emcee(model, seed):
    """The stretch move with 32 walkers from the prior, 1024 steps, the first half left out; no evidence."""
    import numpy as np
    from emcee import EnsembleSampler

    np.random.seed(seed)
    inside = lambda x: ((x >= model.low) & (x <= model.high)).all(axis=1)

    def ln_posterior(x):
        ln = np.full(len(x), -np.inf)
        kept = inside(x)
        if kept.any():
            ln[kept] = model.ln_likelihood(x[kept])
        return ln

    sampler = EnsembleSampler(32, 3, ln_posterior, vectorize=True)
    sampler.run_mcmc(model.of_cube(np.random.default_rng(seed).random((32, 3))), 1024)
    return *moments(np, sampler.get_chain(discard=512, flat=True)), None


def one(method, material, seed):
    """One run in this process; prints what it found."""
    model = Model(material)
    start = time.process_time()
    import warnings

    warnings.simplefilter("ignore")
    mean, sd, log_evidence = {
        "GrainLearning": grain_learning, "nautilus": nautilus, "dynesty": dynesty, "emcee": emcee,
    }[method](model, seed)
    json.dump({
        "mean": mean, "sd": sd, "log_evidence": log_evidence, "simulations": model.simulations,
        "seconds": time.process_time() - start,
    }, sys.stdout)


def agree(programs):
    """Largest difference of this model's curves from those of `calibrate simulate`."""
    import numpy as np

    random = np.random.default_rng(1)
    worst = 0.0
    for material, (*_, experiment, _) in MATERIALS.items():
        model = Model(material)
        for _ in range(20):
            log10 = model.of_cube(random.random(3))
            parameters = [f"{10.0**value!r}".replace("np.float64(", "").rstrip(")") for value in log10]
            text = subprocess.run([
                programs / "calibrate", "simulate", "--material", material, "--times", str(ROOT / "experiments" / f"{experiment}.csv"),
                "--c1", parameters[0], "--tau-s", parameters[1], "--delta-c", parameters[2], "--quiet",
            ], check=True, capture_output=True, text=True).stdout
            rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
            theirs = np.array([float(row["contact_ratio"]) for row in rows])
            worst = max(worst, float(np.abs(model.curves(log10)[0] - theirs).max()))
    print(worst)


def measured(command):
    """Output of a command, wall time and peak memory of its process [MB]."""
    with tempfile.TemporaryFile() as out:
        start = time.perf_counter()
        process = subprocess.Popen(command, stdout=out, env={**os.environ, **ONE_CORE})
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        wall = time.perf_counter() - start
        if process.returncode != 0:
            print(f"failed: {' '.join(map(str, command))}", file=sys.stderr)
            return None
        out.seek(0)
        return json.loads(out.read()), wall, usage.ru_maxrss / 1024


def environment(folder):
    python = folder / "bin" / "python"
    stamp = folder / "installed.txt"
    wanted = (Path(__file__).parent / "requirements.txt").read_text()
    if not stamp.exists() or stamp.read_text() != wanted:
        venv.create(folder, with_pip=True)
        subprocess.run(
            [python, "-m", "pip", "install", "--quiet", "-r", Path(__file__).parent / "requirements.txt"], check=True
        )
        stamp.write_text(wanted)
    return python


def three(value):
    return "" if value is None else f"{value:.3g}"


def spread(values):
    """Median, and least to most."""
    return f"{three(statistics.median(values))} ({three(min(values))} to {three(max(values))})"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    parser.add_argument("--programs", type=Path, default=target / "release", help="folder of calibrate and studies")
    parser.add_argument("--venv", type=Path, default=ROOT / "target" / "peers")
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "benchmarks" / "peers")
    parser.add_argument("--materials", nargs="+", default=list(MATERIALS), choices=list(MATERIALS))
    parser.add_argument("--methods", nargs="+", default=METHODS, choices=METHODS)
    parser.add_argument("--one", nargs=3, metavar=("METHOD", "MATERIAL", "SEED"), help=argparse.SUPPRESS)
    parser.add_argument("--agree", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        return one(args.one[0], args.one[1], int(args.one[2]))
    if args.agree:
        return agree(args.programs)

    began, of_revision = time.perf_counter(), revision()
    python = environment(args.venv)
    this = [python, __file__, "--programs", args.programs]
    difference = float(subprocess.run([*this, "--agree"], check=True, capture_output=True, text=True).stdout)
    if not difference < 1e-12:
        raise SystemExit(f"the model differs from `calibrate simulate` by {difference:.2e}; 1e-12 is allowed")
    rows, found = [], {}
    for material in args.materials:
        found_exactly = measured([args.programs / "studies", "exact", "--material", material])
        if found_exactly is None:
            raise SystemExit("no exact posterior to compare with")
        exact, _, _ = found_exactly
        runs = {method: [] for method in args.methods}
        for seed in range(1, args.seeds + 1):
            for method in args.methods:
                samples = None
                if method == AT_SHARE:
                    # Its run with this seed is the newest of nautilus's.
                    theirs = runs["nautilus"][-1] if runs.get("nautilus") else None
                    if theirs is None:
                        continue
                    samples = int(SHARE * theirs[0]["simulations"])
                elif method.startswith("calibrate"):
                    samples = int(method.split()[1])
                if samples is None:
                    command = [*this, "--one", method, material, str(seed)]
                else:
                    command = [args.programs / "studies", "exact", "--material", material, "-n", str(samples), "-s", str(seed)]
                print(f"{material} {method} seed {seed}", file=sys.stderr)
                runs[method].append(measured(command))
        for method in args.methods:
            # A method that breaks down on a seed is counted, and judged on the others.
            of = [run for run in runs[method] if run is not None]
            broken = f"{len(runs[method]) - len(of)} of {len(runs[method])}"
            if not of:
                rows.append([material, method, *[""] * 11, broken])
                continue
            rms = lambda errors: max(statistics.fmean(e * e for e in column) ** 0.5 for column in zip(*errors))
            worst = lambda errors: spread([max(map(abs, row)) for row in errors])
            means = [[(a - b) / s for a, b, s in zip(r["mean"], exact["mean"], exact["sd"])] for r, _, _ in of]
            sds = [[a / s - 1 for a, s in zip(r["sd"], exact["sd"])] for r, _, _ in of]
            evidences = []
            if of[0][0]["log_evidence"] is not None:
                evidences = [[r["log_evidence"] - exact["log_evidence"]] for r, _, _ in of]
            mean, sd = rms(means), rms(sds)
            evidence = rms(evidences) if evidences else None
            median = lambda values: statistics.median(values)
            seconds = [r["seconds"] for r, _, _ in of]
            # Widths of the posterior found over the exact one: how much too narrow or wide, not only that it is.
            width = [statistics.median(r["sd"][j] / exact["sd"][j] for r, _, _ in of) for j in range(3)]
            found[material, method] = (mean, sd, evidence, median([r["simulations"] for r, _, _ in of]), median(seconds))
            rows.append([
                material, method, three(mean), worst(means), three(sd), worst(sds), three(evidence),
                worst(evidences) if evidences else "", f"{found[material, method][3]:.0f}", spread(seconds),
                three(median([wall for _, wall, _ in of])), three(median([memory for _, _, memory in of])),
                f"{min(width):.3f} to {max(width):.3f}", broken,
            ])
    columns = [
        "material", "method", "rms error of mean [sd]", "of mean, median (least to most)", "rms error of sd",
        "of sd, median (least to most)", "rms error of log evidence", "of log evidence, median (least to most)", "simulations", "seconds",
        "whole process [s]", "peak memory [MB]", "sd found/exact", "broke down",
    ]
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    reach = []
    compared = {AT_SHARE, "nautilus"} <= set(args.methods)
    for material in args.materials if compared else []:
        if not {(material, AT_SHARE), (material, "nautilus")} <= set(found):
            reach.append(f"- {material}: nautilus broke down on every seed")
            continue
        ours, theirs = found[material, AT_SHARE], found[material, "nautilus"]
        ratios = [a / b for a, b in zip(ours, theirs)]
        within = max(ratios[:3]) <= 1.25 and ratios[3] <= SHARE and ratios[4] <= 0.01
        reach.append(
            f"- {material}: {ratios[0]:.2f}, {ratios[1]:.2f} and {ratios[2]:.2f} of nautilus's error of mean, sd and log evidence "
            f"with {ratios[3]:.3f} of its simulations and {ratios[4]:.4f} of its time: "
            f"{'reached' if within else 'missed'} (wanted: at most 1.25, 0.4, 0.01)"
        )
    head = [
        f"made by: {Path(__file__).relative_to(ROOT)} --seeds {args.seeds}",
        f"machine: {machine()}",
        f"revision: {of_revision}",
        f"date: {datetime.date.today()}",
        f"run time: {time.perf_counter() - began:.0f} s",
    ]
    args.out.mkdir(parents=True, exist_ok=True)
    with (args.out / "table.csv").open("w", newline="") as file:
        file.writelines(f"# {line}\n" for line in head)
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)
    text = "\n".join(f"- {line}" for line in head)
    (args.out / "report.md").write_text(f"""# Peers

{text}

Same model (curves agree with `calibrate simulate` to {difference:.1e}), data, prior and noise; {args.seeds} seeds of every method in turn, each
in a process of its own on one core. Errors against quadrature in log10 of the parameters: the mean in posterior standard deviations,
the sd relative, the log evidence absolute; root mean square over the seeds of the worst parameter, then median, least and most of the
seeds' worst parameter. Seconds: processor time without start of the program; `whole process`: wall time with it, median. Peak memory: the whole process. Versions:
{", ".join(line for line in (Path(__file__).parent / "requirements.txt").read_text().split() if "==" in line)}.

Every package with its defaults: nautilus 2000 live points and 10 000 effective draws; dynesty's dynamic sampler; emcee 32
walkers, 1024 steps, half left out; GrainLearning effective sample size 0.3, one Gaussian, eight iterations of 2048 (its
residuals are relative to each measured value, or to the largest where one is zero, its noise is tuned, its proposals are not corrected for: its spread is no posterior's). `{AT_SHARE}`: as many simulations as
{SHARE:.0%} of those that nautilus took with the same seed.

{chr(10).join(lines)}

## calibrate against nautilus, with {SHARE:.0%} of its simulations for the same seed

{chr(10).join(reach)}
""")
    print("\n".join(reach))


def machine():
    info = Path("/proc/cpuinfo")
    name = platform.processor() or platform.machine()
    if info.exists():
        names = [line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")]
        name = names[0] if names else name
    return f"{name}, {os.cpu_count()} cores, {platform.system().lower()}, Python {platform.python_version()}"


def revision():
    git = lambda *arguments: subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True).stdout.strip()
    changed = git("status", "--porcelain", "--untracked-files=no", "--", "crates")
    return git("rev-parse", "--short", "HEAD") + (" with changes" if changed else "")


if __name__ == "__main__":
    main()
