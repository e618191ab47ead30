"""GrainLearning's tutorials through this module, both answers side by side. The data are those of its scripts, the code is ours."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ROOT

import calibrate as cal

X = np.arange(100.0)
BOX = {"a": cal.Uniform(0.001, 1), "b": cal.Uniform(0.001, 10)}


def linear(a, b):
    """Its linear model."""
    return a * X + b


def hyperbola(a, b):
    """Its hyperbola."""
    return X / (a * 100 + b * X)


MODELS = {"linear": (linear, 0.2 * X + 5.0), "hyperbola": (hyperbola, X / (0.2 * 100 + 5.0 * X))}


def theirs(name: str, iterations: int):
    """The tutorial by the package itself."""
    package = pytest.importorskip("grainlearning", reason="SKIPPED: grainlearning is not installed")
    model, measured = MODELS[name]

    def simulate(calibration) -> None:
        sets = calibration.system.param_data
        calibration.system.set_sim_data([np.array(model(a, b), ndmin=2) for a, b in sets])

    calibration = package.BayesianCalibration.from_dict(
        {
            "num_iter": iterations,
            "callback": simulate,
            "save_fig": -1,
            "system": {
                "param_names": ["a", "b"], "param_min": [0.001, 0.001], "param_max": [1, 10], "num_samples": 20,
                "obs_names": ["f"], "ctrl_name": "u", "obs_data": measured, "ctrl_data": X, "sim_name": name,
                **({"sigma_tol": 0.01} if name == "linear" else {}),
            },
            "inference": {
                "Bayes_filter": {"ess_target": 0.3, **({} if name == "linear" else {"scale_cov_with_max": True})},
                "sampling": {"max_num_components": 1, "n_init": 1, "random_state": 0, "slice_sampling": name == "linear"},
                "initial_sampling": "halton",
            },
        }
    )
    calibration.run()
    return calibration


@pytest.mark.parametrize("name", ["linear", "hyperbola"])
def test_a_tutorial_of_regression_finds_the_truth_within_what_grainlearning_says(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    model, measured = MODELS[name]
    scale = 0.01 * float(np.ptp(measured))
    run = cal.calibrate(model, BOX, cal.Observations(X, measured, noise=cal.Inferred(s0=scale), name="f", x_name="u"), samples=300)
    ours = {parameter: run.marginal(parameter) for parameter in "ab"}
    assert abs(ours["a"].median - 0.2) < 3 * ours["a"].sd and abs(ours["b"].median - 5.0) < 3 * ours["b"].sd
    calibration = theirs(name, 10 if name == "linear" else 8)
    best = dict(zip("ab", calibration.get_most_prob_params()))
    with capsys.disabled():
        for parameter, truth in (("a", 0.2), ("b", 5.0)):
            own = ours[parameter]
            print(f"\n{name} {parameter}: truth {truth}, GrainLearning {best[parameter]:.4g}, here {own.mean:.4g} +- {own.sd:.2g}", end="")
            assert own.sd < 0.01 * truth and abs(own.mean - truth) < 0.01 * truth
            assert abs(best[parameter] - own.mean) < 0.1 * truth


def test_its_first_iteration_has_its_weights() -> None:
    package = pytest.importorskip("grainlearning", reason="SKIPPED: grainlearning is not installed")
    assert package is not None
    calibration = theirs("hyperbola", 1)
    system, bayes = calibration.system, calibration.inference.Bayes_filter
    sets = np.asarray(system.param_data)[:20]
    bayes.data_assimilation_loop(calibration.inference.sigma_list[-1], system)
    weights = np.asarray(bayes.get_posterior_at_time()).ravel()
    sigma = float(np.sqrt(np.asarray(bayes.cov_matrices[0]).item()))
    given = dict(zip("ab", sets.T))
    runs = cal.StoredRuns(given, np.array([hyperbola(a, b) for a, b in sets]))
    run = cal.calibrate(runs, BOX, cal.Observations(X, MODELS["hyperbola"][1], noise=cal.Fixed(sigma)))
    assert np.allclose(run.weights, weights, rtol=1e-6, atol=1e-12)


def test_stored_runs_of_a_table_of_its_are_weighted_as_its_file_says() -> None:
    folder = ROOT / "experiments" / "external" / "grainlearning"
    table = np.genfromtxt(folder / "hyperbola-samples.txt", skip_header=1, usecols=(3, 4))
    lines = (folder / "hyperbola-weights.txt").read_text().splitlines()
    sigma, weights = float(lines[0].split()[-1]), np.array(lines[1:], dtype=float)
    u, f = np.loadtxt(folder / "hyperbola-obs.txt", unpack=True)
    outputs = np.array([u / (a * 100 + b * u) for a, b in table])
    run = cal.calibrate(cal.StoredRuns(dict(zip("ab", table.T)), outputs), BOX, cal.Observations(u, f, noise=cal.Fixed(sigma)))
    assert np.allclose(run.weights, weights, rtol=1e-8, atol=1e-15)
