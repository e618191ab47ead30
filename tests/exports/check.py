"""Reads the exports of runs by ArviZ (0.x: the JSON, and CmdStan's CSV by cmdstanpy; from 1.0 on: the Zarr store), and holds
them against the runs' own results.

    python check.py RUN EXPORTS [PICTURES]

RUN is the folder of a calibration, EXPORTS that of its exports. A folder `compare` beside RUN is a comparison of the same
material, with our own prediction of each observation by the others.
"""

import csv
import importlib.metadata
import json
import math
import sys
import warnings
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import numpy as np

warnings.simplefilter("ignore", FutureWarning)
import arviz as az

OLD = importlib.metadata.version("arviz").startswith("0.")


def groups(exports):
    """The groups as datasets, and what ArviZ takes."""
    if OLD:
        data = az.from_json(exports / "posterior-idata.json")
        return {name: data[name] for name in data.groups()}, data, data.attrs
    import xarray

    with warnings.catch_warnings():
        # The store is whole: nothing has to be guessed, converted or excused.
        warnings.simplefilter("error")
        tree = xarray.open_datatree(exports / "posterior.zarr", engine="zarr")
        tree.load()
        for name in tree.children:
            xarray.open_zarr(exports / "posterior.zarr", group=name).load()
    return {name: node.dataset for name, node in tree.children.items()}, tree, tree.attrs


def near(found, wanted, error, what):
    assert abs(found - wanted) < error, f"{what}: {found} for {wanted}, beyond {error}"


def check_posterior(data, record):
    """Means, sds and quantiles of the draws are those of the summary within the Monte Carlo error of so many draws."""
    for one in record["parameters"]:
        name = one["parameter"]["name"]
        drawn = data["posterior"][name].values.ravel()
        drawn = np.log10(drawn) if one["coordinate"] == "log10" else drawn
        n, own = drawn.size, one["in_coordinate"]
        worth = max(record["ess"]["importance"], record["ess"].get("by_errors") or 0)
        assert n <= worth, f"{n} draws"
        sd = drawn.std(ddof=1)
        kurtosis = np.mean(((drawn - drawn.mean()) / sd) ** 4)
        near(drawn.mean(), own["mean"], 4 * own["sd"] / math.sqrt(n), f"mean of {name}")
        near(sd, own["sd"], 4 * sd * math.sqrt((kurtosis - 1) / (4 * n)), f"sd of {name}")
        for ends, share in [("eti50", 0.5), ("eti90", 0.9), ("eti95", 0.95)]:
            for end, p in [("lower", (1 - share) / 2), ("upper", (1 + share) / 2)]:
                below = np.mean(drawn < own[ends][end])
                near(below, p, 4 * math.sqrt(p * (1 - p) / n) + 1 / n, f"{end} of {ends} of {name}")
        prior = data["prior"][name].values.ravel()
        prior = np.log10(prior) if one["coordinate"] == "log10" else prior
        near(prior.mean(), one["prior_mean"], 4 * one["prior_sd"] / math.sqrt(prior.size), name)


def check_observables(data, record):
    """Noise, measurements and new measurements are those of the record; dimensions are named and have coordinates."""
    plans = [o for e in record["plan"]["experiments"] for o in e["observables"]]
    found = [o for e in record["experiments"] for o in e["observables"]]
    for plan, own in zip(plans, found):
        label = own["label"]
        assert np.array_equal(data["observed_data"][label].values, plan["values"])
        again = data["posterior_predictive"][label]
        (dim,) = again.dims[2:]
        control = again[dim].values
        if len(set(plan["control"])) == len(plan["control"]):
            assert np.array_equal(control, plan["control"]) and "time" in dim, dim
        else:
            repeated = data["constant_data"][f"{label}_{plan['control_column']}"].values
            assert np.array_equal(repeated, plan["control"])
        for band in own["predictive"]:
            values = again.values[0, :, band["index"]]
            inside = np.mean((values >= band["noisy90"][0]) & (values <= band["noisy90"][1]))
            error = 0.02 + 4 * math.sqrt(0.09 / values.size)
            near(inside, 0.9, error, f"{label}, observation {band['index']}")
        if own["sigma"] and not own["sigma"]["fixed"]:
            several = len(found) > 1
            sigma = data["posterior"][f"sigma_{label}" if several else "sigma"].values.ravel()
            error = 4 * sigma.std() / math.sqrt(sigma.size)
            near(sigma.mean(), own["sigma"]["mean"], error, f"sigma of {label}")
    assert np.isfinite(data["sample_stats"]["lp"].values).all()


def check_attributes(data, attributes, record):
    for name, wanted in [
        ("importance_ess", record["ess"]["importance"]),
        ("pareto_khat", record["khat"]),
        ("log_evidence", record["log_evidence"]["value"]),
        ("log_evidence_se", record["log_evidence"]["se"]),
        ("seed", record["plan"]["sampler"]["seed"]),
    ]:
        assert attributes[name] == wanted, (name, attributes[name], wanted)
    if OLD:
        return
    for one in record["parameters"]:
        unit = data["posterior"][one["parameter"]["name"]].attrs["units"]
        assert unit == one["parameter"]["unit"], unit
    for group in data.values():
        for dim in group.dims:
            assert dim in group.coords, dim
        for variable in group.variables.values():
            assert variable.dtype in (np.float64, np.int64), variable


def leave_one_out(given, label):
    """ArviZ's prediction of each observation by the others: its elpd, standard error, and both per observation."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = az.loo(given, pointwise=True, var_name=label)
    get = (lambda old, new: found[old]) if OLD else (lambda old, new: getattr(found, new))
    points = get("loo_i", "elpd_i").values.ravel()
    return get("elpd_loo", "elpd"), get("se", "se"), points, found.pareto_k.values.ravel()


def line_exactly(record):
    """ln p(y_i | all others) of a straight line with known noise and normal priors."""
    (observable,) = record["plan"]["experiments"][0]["observables"]
    t, y = np.array(observable["control"]), np.array(observable["values"])
    x, s, prior = np.column_stack([np.ones_like(t), t]), observable["noise"]["sigma"]["absolute"], 2.0
    points = []
    for i in range(t.size):
        others = np.arange(t.size) != i
        v = np.linalg.inv(x[others].T @ x[others] / s**2 + np.eye(2) / prior**2)
        m = v @ x[others].T @ y[others] / s**2
        variance = s**2 + x[i] @ v @ x[i]
        points.append(-0.5 * math.log(2 * math.pi * variance) - (y[i] - x[i] @ m) ** 2 / (2 * variance))
    v = np.linalg.inv(x.T @ x / s**2 + np.eye(2) / prior**2)
    m = v @ x.T @ y / s**2
    return np.array(points), m, np.sqrt(np.diag(v))


def check_left_out(given, data, record, run):
    """az.loo agrees with what we compute, and with the exact answer where there is one."""
    name = record["plan"]["name"]
    for label in data["log_likelihood"].data_vars:
        elpd, se, points, khat = leave_one_out(given, label)
        print(f"  az.loo of {label}: {elpd:.2f} +- {se:.2f}, largest k-hat {khat.max():.2f}")
        good = khat < 0.7
        ours = None
        if name == "line":
            ours, mean, sd = line_exactly(record)
            for one, m, s in zip(["a", "b"], mean, sd):
                drawn = data["posterior"][one].values.ravel()
                near(drawn.mean(), m, 4 * s / math.sqrt(drawn.size), f"exact mean of {one}")
                near(drawn.std(), s, 4 * s / math.sqrt(2 * drawn.size), f"exact sd of {one}")
        elif (run.parent / "compare" / "compare.json").exists():
            report = json.loads((run.parent / "compare" / "compare.json").read_text())
            noise = record["plan"]["experiments"][0]["observables"][0]["noise"]["kind"]
            noise = {"inferred": "independent"}.get(noise, noise)
            entries = [e for c in report["comparisons"] if c["name"] == name for e in c["entries"]]
            wanted = ("three-stage", noise)
            for entry in (e for e in entries if (e["kinetics"], e["noise"]) == wanted):
                ours = np.array([p["ln_density"] for p in entry["leave_one_out"]["points"]])
                # The tail that an observation needs can be missing from the draws, and its k-hat there low by chance: the
                # comparison's, of all weighted samples, counts too.
                good &= np.array([p["khat"] for p in entry["leave_one_out"]["points"]]) < 0.7
        if ours is not None:
            print(f"  ours: {ours.sum():.2f}; at the {good.sum()} of k-hat < 0.7: {points[good].sum():.2f}, {ours[good].sum():.2f}")
            near(elpd, ours.sum(), se, f"elpd of {label}")
            # Beyond the spread over data sets: the same data, but for Monte Carlo error of so many draws.
            draws = data["posterior"].sizes["draw"]
            near(points[good].sum(), ours[good].sum(), 8 / math.sqrt(draws) * math.sqrt(good.sum()), label)


def check_cmdstan(data, record, exports):
    """cmdstanpy reads the same draws, and makes the same of the log likelihoods."""
    import logging

    import cmdstanpy

    logging.getLogger("cmdstanpy").setLevel(logging.ERROR)
    fit = cmdstanpy.from_csv(str(exports / "posterior-stan.csv"))
    for name in data["posterior"].data_vars:
        stan = fit.stan_variable(name.replace(".", "_").replace("-", "_"))
        assert np.array_equal(stan, data["posterior"][name].values.ravel()), name
    labels = [one["label"] for of in record["experiments"] for one in of["observables"]]
    ln = [data["log_likelihood"][label].values[0] for label in labels]
    assert np.array_equal(fit.stan_variable("log_lik"), np.concatenate(ln, axis=1))
    assert az.from_cmdstanpy(fit, log_likelihood="log_lik").posterior.sizes["draw"] == len(ln[0])


def check_netcdf(given, path):
    """What xarray writes of the store as NetCDF is the same."""
    import xarray

    given.to_netcdf(path, engine="h5netcdf")
    again = xarray.open_datatree(path, engine="h5netcdf")
    assert again.identical(given), again


def expected(data, given, path):
    """What R has to find in the same draws."""
    with open(path, "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["name", "mean", "sd", "q05", "q95"])
        for name, values in data["posterior"].data_vars.items():
            v = values.values.ravel()
            q = np.quantile(v, [0.05, 0.95])
            table.writerow([name.replace(".", "_"), *map(repr, map(float, [v.mean(), v.std(ddof=1), *q]))])
        labels = list(data["log_likelihood"].data_vars)
        if len(labels) == 1:
            table.writerow(["elpd_loo", repr(float(leave_one_out(given, labels[0])[0])), 0, 0, 0])


def pictures(given, data, folder, name):
    folder.mkdir(parents=True, exist_ok=True)
    import matplotlib.pyplot as plt

    parameters = list(data["posterior"].data_vars)
    if OLD:
        plots = {"posterior": lambda: az.plot_posterior(given), "ppc": lambda: az.plot_ppc(given)}
    else:
        plots = {
            "posterior": lambda: az.plot_dist(given),
            "trace": lambda: az.plot_trace_dist(given),
            "pair": lambda: az.plot_pair(given, var_names=parameters),
            "ppc": lambda: az.plot_ppc_dist(given),
            "forest": lambda: az.plot_forest(given),
            "prior": lambda: az.plot_prior_posterior(given),
        }
    for kind, plot in plots.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            plot()
        plt.savefig(folder / f"{name}-{kind}-{'0' if OLD else '1'}.png", dpi=90)
        plt.close("all")
    if not OLD:
        # xarray's own plots have names and units on their axes.
        label = next(iter(data["posterior_predictive"].data_vars))
        dim = data["posterior_predictive"][label].dims[2]
        fig, axis = plt.subplots()
        again = data["posterior_predictive"][label].squeeze("chain")
        again.isel(draw=slice(0, 50)).plot.line(x=dim, add_legend=False, ax=axis, color="0.7", lw=0.5)
        data["observed_data"][label].plot.line("k.", ax=axis)
        unit = data["posterior_predictive"][label][dim].attrs.get("units")
        assert unit is None or f"[{unit}]" in axis.get_xlabel(), axis.get_xlabel()
        fig.savefig(folder / f"{name}-xarray.png", dpi=90)
        plt.close(fig)


def main():
    run, exports = Path(sys.argv[1]), Path(sys.argv[2])
    record = json.loads((run / "posterior.json").read_text())
    data, given, attributes = groups(exports)
    print(f"{run.name}: ArviZ {importlib.metadata.version('arviz')}, {data['posterior'].sizes['draw']} draws")
    check_posterior(data, record)
    check_observables(data, record)
    check_attributes(data, attributes, record)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert set(data["posterior"].data_vars) <= set(az.summary(given).index)
    check_left_out(given, data, record, run)
    if OLD:
        check_cmdstan(data, record, exports)
    else:
        check_netcdf(given, exports / "run.nc")
    expected(data, given, exports / "expected.csv")
    if len(sys.argv) > 3:
        pictures(given, data, Path(sys.argv[3]), run.name)


main()
