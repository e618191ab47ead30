"""What a notebook meets."""

from __future__ import annotations

import io
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import LINE, T, Y, line, measured

import calibrate as cal


def test_the_example_of_the_guide_runs_as_it_is_written() -> None:
    u = np.linspace(0.1, 1.0, 10)
    force = 2e3 * u * 0.4 + 5.0 * np.cos(7 * u)

    def f(k, mu):
        return k * u * mu

    run = cal.calibrate(
        simulator=f,
        parameters={"k": cal.LogUniform(1e2, 1e6, unit="N/m"), "mu": cal.Uniform(0, 1)},
        observations=cal.Observations(u, force, noise=cal.Inferred(s0=5.0), name="force", unit="N", x_name="u", x_unit="m"),
        samples=300,
        seed=1,
    )
    assert "f: 10 observations, 300 simulations" in run.summary()
    assert repr(run.summary()) == str(run.summary())
    assert run.posterior["k"].shape == (4096,) and run.posterior.units == {"k": "N/m", "mu": "1"}
    assert run.samples["mu"].shape == run.weights.shape == (300,)
    assert run.posterior.to_array().shape == (4096, 2) and list(run.posterior) == ["k", "mu"]
    assert run.weights.sum() == pytest.approx(1.0)
    assert run.trust.verdict in ("converged", "rough", "untrusted") and run.trust.ess > 1
    assert run.sigma is not None and run.sigma.shape == (4096,) and np.all(run.sigma > 0)
    assert run.plot_corner()._repr_png_().startswith(b"\x89PNG")
    # k and mu count as their product alone.
    product = run.posterior["k"] * run.posterior["mu"]
    assert product.mean() == pytest.approx(800, rel=0.05)


def test_a_run_is_a_folder_that_the_command_reads_too(line_run: cal.Run, run_command, tmp_path: Path) -> None:
    saved = line_run.save(tmp_path / "line")
    assert "line: 5 observations" in run_command("inspect", saved, cwd=tmp_path)
    again = cal.read(saved)
    assert again.record == line_run.record and np.array_equal(again.posterior["a"], line_run.posterior["a"])
    assert again.summary() == line_run.summary() and again.map == line_run.map
    assert np.array_equal(again.simulated, line_run.simulated)
    assert np.allclose(again.simulated, line_run.samples["a"][:, None] + line_run.samples["b"][:, None] * T)
    with pytest.raises(cal.InputMistake, match="there"):
        line_run.save(saved)
    assert set(line_run.figures) >= {"corner", "fit", "residuals", "recursion", "convergence"}
    for plot in (line_run.plot_fit, line_run.plot_residuals, line_run.plot_recursion, line_run.plot_convergence):
        assert plot().svg.is_file()
    assert line_run.plot_fit().save(tmp_path / "fit.svg").read_text().lstrip().startswith("<")


def test_a_command_that_would_simulate_again_says_that_it_cannot_call_the_function(line_run: cal.Run, command: Path, tmp_path: Path) -> None:
    import subprocess

    saved = line_run.save(tmp_path / "line")
    for arguments in (["--continue-from", saved, "--samples", "600"],):
        done = subprocess.run([command, *map(str, arguments)], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 2 and "a function of the program that calibrated it" in done.stderr, done.stderr


def test_several_quantities_come_by_name_or_one_after_the_other() -> None:
    double = cal.Observations(None, [2.7, 4.4], noise=cal.Inferred(s0=0.1))

    def by_name(a, b):
        return {"double": [2 * (a + b) + 1, 2 * (a + 2 * b)], "y": a + b * T}

    def in_a_row(a, b):
        return np.concatenate([a + b * T, [2 * (a + b) + 1, 2 * (a + 2 * b)]])

    both = {"y": measured(), "double": double}
    runs = [cal.calibrate(f, LINE, both, samples=100, seed=2) for f in (by_name, in_a_row)]
    assert np.array_equal(runs[0].samples["a"], runs[1].samples["a"]) and runs[0].simulated.shape == (100, 7)
    assert "of 2 observables" in runs[0].summary()


def test_every_prior_and_noise_can_be_calibrated_with() -> None:
    priors = [cal.Uniform(-4, 4), cal.Normal(0, 2), cal.TruncatedNormal(0, 2, -3, 3), cal.LogUniform(0.01, 10), cal.LogNormal(0.5, 0.5)]
    noises = [
        cal.Inferred(0.05), cal.Correlated(0.05), cal.Correlated(0.05, scale="linear"), cal.Robust(0.05),
        cal.Fixed(0.05), cal.Fixed([0.05, 0.06, 0.05, 0.05, 0.05]), cal.EssTarget(0.5),
    ]
    for k, noise in enumerate(noises):
        prior = priors[k % len(priors)]
        assert prior.support[0] < prior.support[1]
        run = cal.calibrate(line, {"a": cal.Normal(0, 1), "b": prior}, measured(noise=noise), samples=64)
        assert 0.2 < run.marginal("b").median < 0.8, (noise, prior)
    run = cal.calibrate(line, LINE, cal.Observations(T, Y, noise=cal.Relative(0.1)), samples=64)
    assert 0.3 < run.marginal("b").median < 0.7


def test_neck_growth_is_that_of_the_command(run_command, tmp_path: Path) -> None:
    peek = cal.material("peek")
    (tmp_path / "times.csv").write_text("time_s\n" + "\n".join(map(repr, peek.time_s.tolist())) + "\n")
    text = run_command("simulate", "--material", "peek", "--table3", "--times", "times.csv", cwd=tmp_path)
    rows = [line for line in text.splitlines() if line and not line.startswith("#")]
    column = rows[0].split(",").index("contact_ratio")
    wanted = np.array([float(row.split(",")[column]) for row in rows[1:]])
    found = cal.neck_growth(peek.time_s, **peek.table3, powder=cal.PEEK)
    assert np.allclose(found, wanted, rtol=1e-12, atol=0)
    # In any order and shape, and a number for a number.
    assert np.array_equal(cal.neck_growth(peek.time_s[::-1], **peek.table3, powder=cal.PEEK), found[::-1])
    assert cal.neck_growth(peek.time_s[-1], **peek.table3, powder=cal.PEEK).shape == ()
    assert cal.neck_growth([], **peek.table3, powder=cal.PEEK).shape == (0,)


def test_an_own_powder_from_its_table_to_the_sintering_time(tmp_path: Path) -> None:
    ps = cal.material("ps")
    rows = "".join(f"{t!r},{ratio!r}\n" for t, ratio in zip(ps.time_s.tolist(), ps.contact_ratio.tolist()))
    (tmp_path / "neck.csv").write_text("time_s,contact_ratio\n" + rows)
    assert "neck.toml" in cal.init(tmp_path / "neck.csv", radius_m=ps.powder.radius_m, material="ps")
    own = cal.experiment(tmp_path / "neck.toml", prior=tmp_path / "neck-priors.toml")
    run = own.calibrate(samples=8192, window_s=(0.0, 100.0), out=tmp_path / "run")
    assert run.folder == tmp_path / "run" and (run.folder / "report.html").is_file()
    when = run.predict(contact_ratio=0.7, after_s=[1.0, 2.0], with_noise=True)
    low, high = when["sintering"][0]["time_s"]["eti95"]
    assert 0 < low < high and "a/R" in repr(when)


def test_progress_is_shown_in_a_terminal_and_nowhere_else(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    cal.calibrate(line, LINE, measured(), samples=32)
    cal.material("ps").calibrate(samples=64)
    assert capsys.readouterr() == ("", "")
    for tqdm in (True, False):
        if not tqdm:
            monkeypatch.setitem(sys.modules, "tqdm.auto", None)
        cal.calibrate(line, LINE, measured(), samples=32, progress=True)
        shown = capsys.readouterr()
        assert "simulations" in shown.err and shown.out == ""

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    cal.calibrate(line, LINE, measured(), samples=32)
    assert "simulations" in terminal.getvalue()


def test_warnings_are_pythons_warnings(tmp_path: Path) -> None:
    ps = cal.material("ps")
    rows = "".join(f"{t!r},{ratio!r},0.03\n" for t, ratio in zip(ps.time_s.tolist(), ps.contact_ratio.tolist()))
    (tmp_path / "neck.csv").write_text("time_s,contact_ratio,sigma\n" + rows)
    cal.init(tmp_path / "neck.csv", radius_m=ps.powder.radius_m, material="ps")
    own = cal.experiment(tmp_path / "neck.toml", prior=tmp_path / "neck-priors.toml")
    with pytest.warns(cal.CalibrationWarning, match="unused-sigma"):
        own.calibrate(samples=64)


def test_other_threads_of_python_go_on_while_the_library_works() -> None:
    ticks: list[float] = []
    done = threading.Event()

    def tick() -> None:
        while not done.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    began = time.monotonic()
    cal.material("ps").calibrate(samples=32768)
    took = time.monotonic() - began
    done.set()
    thread.join()
    assert len(ticks) > 20 and max(np.diff(ticks)) < max(0.5, 0.5 * took), "the lock was held"


def test_a_run_in_a_folder_that_holds_another_plan_moves_that_aside(tmp_path: Path) -> None:
    out = tmp_path / "run"
    cal.calibrate(line, LINE, measured(), samples=32, seed=1, out=out)
    cal.calibrate(line, LINE, measured(), samples=32, seed=2, out=out)
    assert (tmp_path / "run.1" / "posterior.json").is_file() and cal.read(out).record["plan"]["sampler"]["seed"] == 2


def test_temporary_folders_go_with_their_runs() -> None:
    run = cal.calibrate(line, LINE, measured(), samples=32)
    folder = run.folder
    assert folder.is_dir()
    del run
    import gc

    gc.collect()
    assert not folder.exists()
