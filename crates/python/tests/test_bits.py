"""The same seed gives the bits of the Rust library, whichever way the simulator is called."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import LINE, ROOT, T, Y, line, measured, same_files

import calibrate as cal

PROGRAM = """#!/bin/sh
exec {python} - "$1" "$2" <<'PYTHON'
import sys
a, b = map(float, sys.argv[1:])
with open("out.csv", "w") as file:
    file.write("t,y\\n")
    for t in {times}:
        file.write(f"{{t!r}},{{a + b * t!r}}\\n")
PYTHON
"""

PLAN = """name = "line"
[parameters]
a = { distribution = "normal", mean = 0.0, sd = 1.0 }
b = { distribution = "uniform", lower = -4.0, upper = 4.0 }
[experiments.line.simulator]
kind = "command"
argv = ["./line.sh", "{a}", "{b}"]
[experiments.line.observables.y]
table = "line.csv"
control = "t"
noise = { kind = "fixed", sigma = 0.05 }
result = { file = "out.csv", control = "t", value = "y" }
[sampler]
samples = 64
seed = 3
"""


def test_a_material_has_the_bits_of_the_command(run_command, tmp_path: Path) -> None:
    for name, samples in (("ps", 8192), ("peek", 2048)):
        own = cal.material(name).calibrate(samples=samples, seed=5)
        run_command("--material", name, "-n", samples, "--seed", 5, "--out", "by-command", "--quiet", cwd=tmp_path)
        same_files(own.folder, tmp_path / "by-command", ["posterior.json", "samples.csv", "draws.csv", "table.md", "corner.svg"])


def test_several_experiments_of_one_powder_have_the_bits_of_the_command(run_command, tmp_path: Path) -> None:
    own = cal.experiment("pa12-r30", "pa12-r32").calibrate(samples=256, seed=5)
    words = ["--experiment", "pa12-r30", "--experiment", "pa12-r32"]
    run_command(*words, "-n", 256, "--seed", 5, "--out", "by-command", "--quiet", cwd=tmp_path)
    same_files(own.folder, tmp_path / "by-command", ["posterior.json", "samples.csv", "draws.csv", "fit-together.svg"])
    assert own.parameters == ["c1", "tau_s", "delta_c"] and "fit-together" in own.figures
    asked = ["--of", "pa12-r32", "--contact-ratio", 0.6, "--json"]
    by_command = run_command("predict", "--posterior", "by-command", *asked, cwd=tmp_path)
    assert own.predict(0.6, of="pa12-r32") == json.loads(by_command)


def test_predictions_of_pulses_are_those_of_the_command(run_command, tmp_path: Path) -> None:
    plan = (ROOT / "experiments" / "heat" / "ps-power.toml").read_text()
    (tmp_path / "pulses.toml").write_text(plan.replace("samples = 16384", "samples = 256"))
    run_command("--plan", "pulses.toml", "--out", "pulses", "--quiet", cwd=tmp_path)
    asked = {"of": "e23", "pulse_energy": 25, "energy_for": 1, "probability": 0.9}
    options = [word for name, value in asked.items() for word in (f"--{name.replace('_', '-')}", value)]
    by_command = run_command("predict", "--posterior", "pulses", *options, "--json", cwd=tmp_path)
    found = cal.read(tmp_path / "pulses").predict(**asked)  # type: ignore[arg-type]
    assert found == json.loads(by_command) and found["enough"]["probability"] == 0.9
    (tmp_path / "heat.toml").write_text('[heat]\nhistory = "pulse"\nmobility = "threshold-power"\npulse_energy = 25\nreference_energy = 29\n')
    under = cal.read(tmp_path / "pulses").predict(of="e23", heat=tmp_path / "heat.toml")
    assert under["freezes"] == found["freezes"]


def test_a_python_function_has_the_bits_of_a_program(run_command, tmp_path: Path) -> None:
    rows = "".join(f"{t!r},{y!r}\n" for t, y in zip(T.tolist(), Y.tolist()))
    (tmp_path / "line.csv").write_text("t,y\n" + rows)
    (tmp_path / "line.sh").write_text(PROGRAM.format(python="/usr/bin/env python3", times=T.tolist()))
    (tmp_path / "line.sh").chmod(0o755)
    (tmp_path / "plan.toml").write_text(PLAN)
    run_command("--plan", "plan.toml", "--out", "by-program", "--quiet", cwd=tmp_path)
    own = cal.calibrate(line, LINE, measured(), samples=64, seed=3)
    same_files(own.folder, tmp_path / "by-program", ["samples.csv", "draws.csv", "table.csv"])
    of_program = json.loads((tmp_path / "by-program" / "posterior.json").read_text())
    for key in ("parameters", "log_evidence", "map", "trust", "ess", "stages"):
        assert own.record[key] == of_program[key], key


def batch(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The line for many parameter sets."""
    return a[:, None] + b[:, None] * T


def by_mapping(given: dict[str, float]) -> dict[str, np.ndarray]:
    """The line by one mapping, named."""
    return {"y": given["a"] + given["b"] * T}


@pytest.mark.parametrize("how", [{"vectorized": True}, {"processes": 2}, {"threads": 1}, {"mapping": True}])
def test_however_it_is_called_it_has_the_same_bits(line_run: cal.Run, how: dict[str, object]) -> None:
    function = batch if how.get("vectorized") else by_mapping if how.pop("mapping", False) else line
    other = cal.calibrate(function, LINE, measured(), samples=300, seed=3, **how)  # type: ignore[arg-type]
    same_files(line_run.folder, other.folder, ["samples.csv", "draws.csv"])


def test_the_posterior_is_the_one_in_closed_form() -> None:
    run = cal.calibrate(line, {"a": cal.Normal(0.0, 1.0), "b": cal.Normal(0.0, 2.0)}, measured(), samples=8192, seed=1)
    design = np.column_stack([np.ones_like(T), T])
    precision = design.T @ design / 0.05**2 + np.diag([1.0, 0.25])
    covariance = np.linalg.inv(precision)
    mean = covariance @ design.T @ Y / 0.05**2
    for j, name in enumerate("ab"):
        found = run.marginal(name)
        sd = covariance[j, j] ** 0.5
        assert abs(found.mean - mean[j]) < 0.1 * sd and abs(found.sd / sd - 1) < 0.1
        # The weighted samples say the same, and so do the draws.
        weighted = np.average(run.samples[name], weights=run.weights)
        assert weighted == pytest.approx(found.mean, rel=1e-9, abs=1e-9)
        assert abs(run.posterior[name].mean() - mean[j]) < 0.15 * sd


def test_stored_runs_are_weighted_as_they_are() -> None:
    rng = np.random.default_rng(1)
    sets = {"a": rng.normal(0, 1, 400), "b": rng.uniform(-4, 4, 400)}
    outputs = batch(sets["a"], sets["b"])
    outputs[7] = np.nan
    noise = cal.Fixed(0.5)
    run = cal.calibrate(cal.StoredRuns(sets, outputs), LINE, measured(noise=noise))
    assert np.array_equal(run.samples["a"], sets["a"]) and run.weights[7] == 0
    ln_likelihood = -0.5 * np.sum(((outputs - Y) / 0.5) ** 2, axis=1)
    wanted = np.exp(np.where(np.isnan(ln_likelihood), -np.inf, ln_likelihood))
    # The few largest are smoothed; all others are the likelihoods.
    small = np.argsort(wanted)[:300]
    small = small[wanted[small] > 1e-300]
    ratio = run.weights[small] / wanted[small]
    assert len(small) > 100 and np.allclose(ratio, ratio[0], rtol=1e-9)
    again = cal.calibrate(line, LINE, measured(noise=noise), design=sets)
    ratio = again.weights[small] / run.weights[small]
    assert np.allclose(ratio, ratio[0], rtol=1e-9)
    assert run.failures == {"a value that is not finite": 1}
