"""What is wrong gets an exception that names place, value and remedy."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest
from conftest import LINE, T, Y, line, measured

import calibrate as cal


def refused(error: type[Exception], words: list[str], **options: object) -> str:
    """The message of a calibration that is refused."""
    given: dict[str, object] = {"simulator": line, "parameters": LINE, "observations": measured(), "samples": 32, **options}
    with pytest.raises(error) as raised:
        cal.calibrate(**given)  # type: ignore[arg-type]
    for word in words:
        assert word in str(raised.value), str(raised.value)
    return str(raised.value)


def test_mistakes_are_value_errors_and_failed_runs_runtime_errors() -> None:
    assert issubclass(cal.InputMistake, ValueError) and issubclass(cal.SimulatorMistake, cal.InputMistake)
    assert issubclass(cal.RunFailed, RuntimeError)


@pytest.mark.parametrize(
    ("words", "make"),
    [
        (["Observations y[2]", "found nan", "finite"], lambda: cal.Observations([0, 1, 2], [1, 2, float("nan")], noise=cal.Inferred(1))),
        (["Observations force x", "2 numbers", "3"], lambda: cal.Observations([0, 1], [1, 2, 3], noise=cal.Inferred(1), name="force")),
        (["Observations y", "shape (2, 2)", "one dimension"], lambda: cal.Observations(None, np.eye(2), noise=cal.Inferred(1))),
        (["Observations x", "no array of numbers"], lambda: cal.Observations(["a"], [1], noise=cal.Inferred(1))),
        (["noise", "found 0.1", "noise=Inferred"], lambda: cal.Observations([0], [1], noise=0.1)),  # type: ignore[arg-type]
        (["Uniform", "lower bound 2", "swap"], lambda: cal.Uniform(2, 1)),
        (["LogUniform", "lower is -1", "positive"], lambda: cal.LogUniform(-1, 1)),
        (["Normal sd", "inf"], lambda: cal.Normal(0, float("inf"))),
        (["StoredRuns outputs", "shape (3,)"], lambda: cal.StoredRuns({"a": [1, 2, 3]}, [1, 2, 3])),
        (["StoredRuns a", "(2,)", "(3,)"], lambda: cal.StoredRuns({"a": [1, 2]}, np.eye(3))),
        (["material", '"pss"', "did you mean ps?"], lambda: cal.material("pss")),
        (["t[1]", "nan"], lambda: cal.neck_growth([0, np.nan], c1=1, tau_s=1, delta_c=1, powder=cal.PS)),
        (["neck_growth", "c1"], lambda: cal.neck_growth([0, 1], c1=-1, tau_s=1, delta_c=1e-7, powder=cal.PS)),
        (["kinetics", '"frenkl"', "did you mean frenkel?"], lambda: cal.material("ps").calibrate(kinetics="frenkl")),
        (["samples", "found 3"], lambda: cal.material("ps").calibrate(samples=3)),
        (["experiment", "['pa12-r30', 'pa12-r32']", 'experiment("a.toml", "b.toml")'], lambda: cal.experiment(["pa12-r30", "pa12-r32"])),  # type: ignore[arg-type]
        (["pa12-r30", "once more"], lambda: cal.experiment("pa12-r30", "pa12-r30").calibrate()),
    ],
)
def test_what_is_given_is_checked_where_it_is_given(words: list[str], make) -> None:
    with pytest.raises(cal.InputMistake) as raised:
        make()
    for word in words:
        assert word in str(raised.value), str(raised.value)


def test_a_calibration_checks_its_arguments() -> None:
    refused(cal.InputMistake, ["simulator", "found 3", "function"], simulator=3)
    refused(cal.InputMistake, ["parameters b", "found 1", "prior"], parameters={"a": LINE["a"], "b": 1})
    refused(cal.InputMistake, ["parameters", "{}"], parameters={})
    refused(cal.InputMistake, ["observations", "Observations(x, y, noise=...)"], observations=[1, 2])
    refused(cal.InputMistake, ["samples", "found 3", "16"], samples=3)
    refused(cal.InputMistake, ["samples", "'many'", "whole number"], samples="many")
    refused(cal.InputMistake, ["seed", "-1"], seed=-1)
    refused(cal.InputMistake, ["processes", "0"], processes=0)
    refused(cal.InputMistake, ["observations y, field x[1]", "0 after 1"], observations=cal.Observations([1, 0], [1, 2], noise=cal.Inferred(1)))
    refused(cal.InputMistake, ["design", "a", "a, b"], design={"a": [1, 2]})
    refused(cal.InputMistake, ["design, field b[1]", "9"], design={"a": [0, 0], "b": [0, 9]})
    refused(cal.InputMistake, ["threads", "0", "at least 1"], threads=0)


def test_a_simulator_that_returns_the_wrong_shape_is_named_with_its_parameters() -> None:
    refused(cal.SimulatorMistake, ["simulator <lambda>"[:9], "sample 0 (a=", "shape (4,)", "(5,)", "x of the observations"], simulator=lambda a, b: T[1:])
    refused(cal.SimulatorMistake, ["sample 0", "shape ()", "(5,)"], simulator=lambda a, b: 1.0)
    refused(cal.SimulatorMistake, ["sample 0", "str", "no array of numbers"], simulator=lambda a, b: "much")
    refused(cal.SimulatorMistake, ["sample 0", "NoneType"], simulator=lambda a, b: None)
    refused(cal.SimulatorMistake, ["with y too"], simulator=lambda a, b: {"force": T})
    refused(cal.SimulatorMistake, ["samples 0 to ", "shape (5,)", "a row for each parameter set"], simulator=lambda a, b: T, vectorized=True)
    refused(cal.SimulatorMistake, ["signature (x, y)", "def "], simulator=lambda x, y: T)
    refused(cal.SimulatorMistake, ["sample 0", "shape (4,)"], simulator=short, processes=2)


def short(a: float, b: float) -> np.ndarray:
    """One value too few."""
    return T[1:]


def fails_above(a: float, b: float) -> np.ndarray:
    """Raises where b is large."""
    if b > 3:
        raise ZeroDivisionError(f"at b = {b}")
    if b < -3.5:
        return np.full(5, np.nan)
    return line(a, b)


@pytest.mark.parametrize("how", [{}, {"processes": 2}])
def test_exceptions_are_failures_by_cause(how: dict[str, object]) -> None:
    run = cal.calibrate(fails_above, LINE, measured(), samples=300, seed=3, **how)  # type: ignore[arg-type]
    causes = sorted(run.failures)
    assert [cause.split(",")[0] for cause in causes] == ["ZeroDivisionError in fails_above", "a value that is not finite"]
    failed = (run.samples["b"] > 3) | (run.samples["b"] < -3.5)
    assert failed.sum() == sum(run.failures.values()) > 0
    assert np.all(run.weights[failed] == 0) and np.all(np.isnan(run.simulated[run.samples["b"] > 3]))
    good = ~failed
    assert np.array_equal(run.simulated[good], run.samples["a"][good, None] + run.samples["b"][good, None] * T)


def test_a_batch_that_raises_fails_where_it_raises_alone() -> None:
    def batch(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        if np.any(b > 3):
            raise ValueError("too steep")
        return a[:, None] + b[:, None] * T

    run = cal.calibrate(batch, LINE, measured(), samples=300, seed=3, vectorized=True)
    assert sum(run.failures.values()) == (run.samples["b"] > 3).sum() > 0


def test_a_simulator_that_always_raises_ends_the_run_with_its_own_words() -> None:
    def broken(a: float, b: float) -> np.ndarray:
        return undefined_name  # type: ignore[name-defined]  # noqa: F821

    text = refused(cal.RunFailed, ["NameError in broken", "sample 0", "a=", "undefined_name"], simulator=broken)
    assert "failed" in text
    with pytest.raises(cal.RunFailed) as raised:
        cal.calibrate(broken, LINE, measured(), samples=32)
    assert isinstance(raised.value.__cause__, NameError)


def dies_above(a: float, b: float) -> np.ndarray:
    """Kills its process where b is large."""
    if b > 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return line(a, b)


def dies(a: float, b: float) -> np.ndarray:
    """Ends its process."""
    os._exit(7)


def test_a_parameter_set_that_kills_its_process_is_a_failure_and_others_go_on() -> None:
    run = cal.calibrate(dies_above, LINE, measured(), samples=64, seed=3, processes=2)
    assert list(run.failures) == ["its process ended by signal 9"]
    assert run.failures["its process ended by signal 9"] == (run.samples["b"] > 3).sum() > 0


def test_a_simulator_that_always_kills_its_process_ends_the_run() -> None:
    refused(cal.RunFailed, ["its process ended with exit code 7", "sample 0", "a="], simulator=dies, processes=2)


def test_an_interrupt_within_the_simulator_ends_the_run_at_once() -> None:
    calls = []

    def interrupts(a: float, b: float) -> np.ndarray:
        calls.append(a)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cal.calibrate(interrupts, LINE, measured())
    assert len(calls) == 1
    # What comes after it works.
    assert cal.calibrate(line, LINE, measured(), samples=32).parameters == ["a", "b"]


SLOW = """
import time, sys
import numpy as np
import calibrate as cal

def slow(a):
    print("called\\n", end="", flush=True)
    time.sleep(0.05)
    return [a]

try:
    {what}
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
FUNCTION = 'cal.calibrate(slow, {"a": cal.Uniform(0, 1)}, cal.Observations(None, [0.5], noise=cal.Fixed(0.1)), samples=2000%s)'


@pytest.mark.parametrize(
    "what",
    [FUNCTION % "", FUNCTION % ", processes=2", 'print("called", flush=True); cal.material("ps").calibrate(samples=100_000_000)'],
)
def test_ctrl_c_ends_a_run_in_a_moment(what: str) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(SLOW).replace("{what}", what)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "called\n"
    time.sleep(0.5)
    # As a terminal does: to all processes of the group.
    os.killpg(process.pid, signal.SIGINT)
    began = time.monotonic()
    out, err = process.communicate(timeout=60)
    assert out.endswith("interrupted\n"), err
    assert "Traceback" not in err, err
    assert time.monotonic() - began < 15
    # No process of the pool is left.
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)


def test_a_folder_that_is_no_run_is_refused(tmp_path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    refused(cal.InputMistake, [str(tmp_path)], out=tmp_path)
    assert (tmp_path / "notes.txt").read_text() == "mine"
    with pytest.raises(cal.InputMistake, match="posterior.json"):
        cal.read(tmp_path)


def test_parameters_that_are_not_there_are_named(line_run: cal.Run) -> None:
    for ask in (lambda: line_run.posterior["c"], lambda: line_run.marginal("c")):
        with pytest.raises(KeyError, match="a, b"):
            ask()
    with pytest.raises(cal.InputMistake, match="corner"):
        line_run.plot("cornr")
    with pytest.raises(cal.InputMistake, match="function"):
        line_run.predict(0.9)
    assert Y.shape == T.shape


def test_an_exit_is_a_failed_simulation_wherever_the_simulator_runs() -> None:
    def leaves(a: float, b: float) -> object:
        if a > 0.5:
            sys.exit(3)
        return line(a, b)

    inline = cal.calibrate(leaves, LINE, measured(), samples=64)
    pooled = cal.calibrate(leaves, LINE, measured(), samples=64, processes=2)
    assert list(inline.failures) == list(pooled.failures) and "SystemExit" in next(iter(inline.failures))


def test_what_a_pool_cannot_send_does_not_matter_where_the_values_are_right_and_is_refused_where_not() -> None:
    observations = {"y": measured()}
    run = cal.calibrate(lambda a, b: {"y": line(a, b), "more": lambda: 0}, LINE, observations, samples=32, processes=2)
    assert not run.failures
    refused(cal.SimulatorMistake, ["sample 0 (a=", "shape (3,)"], simulator=lambda a, b: np.zeros(3), processes=2)
    refused(cal.SimulatorMistake, ["sample 0 (a=", "no array of numbers"], simulator=lambda a, b: (lambda: 0), processes=2)


def test_the_words_of_an_exception_are_shortened_and_need_not_be_there() -> None:
    class Mute(Exception):
        def __str__(self) -> str:
            raise ValueError("no words")

    def mute(a: float, b: float) -> object:
        raise Mute

    def loud(a: float, b: float) -> object:
        raise ValueError("x" * 1_000_000)

    refused(cal.RunFailed, ["Mute: (its text cannot be had)"], simulator=mute)
    assert len(refused(cal.RunFailed, ["ValueError: xxx"], simulator=loud)) < 5000


@pytest.mark.parametrize("bad", [np.ma.masked_array(Y, T < T[2]), Y + 1j])
def test_masked_and_complex_values_are_refused_and_not_cut_down(bad: object) -> None:
    with pytest.raises(cal.InputMistake, match="Observations y"):
        cal.Observations(T, bad, noise=cal.Inferred(1.0))  # type: ignore[arg-type]
    refused(cal.SimulatorMistake, ["sample 0 (a="], simulator=lambda a, b: bad)
    with pytest.raises(cal.InputMistake, match="StoredRuns outputs"):
        cal.StoredRuns({"a": [1.0]}, bad)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ess", float("nan")),
        ("ess", "x"),
        ("max_failed_share", "x"),
        ("seed", None),
        ("seed", 2**64),
        ("samples", 1e30),
        ("samples", "64"),
        ("name", 3),
        ("title", 3),
        ("processes", 1.5),
        ("design", [1, 2]),
    ],
)
def test_an_argument_of_the_wrong_kind_is_named(name: str, value: object) -> None:
    refused(cal.InputMistake, [f"{name}: found "], **{name: value})


def test_numbers_of_numpy_are_numbers() -> None:
    assert cal.calibrate(line, LINE, measured(), samples=np.int64(64), ess=np.float32(20)).trust.ess > 0  # type: ignore[arg-type]


def test_arguments_of_other_names_than_the_parameters_are_refused() -> None:
    refused(cal.SimulatorMistake, ["signature (a, c)", "a, b by name"], simulator=lambda a, c: a)


def test_what_neck_growth_and_predictions_are_given_is_checked() -> None:
    given = {"c1": 2e-4, "tau_s": 0.07, "delta_c": 1.5e-7}
    for more, words in [({"powder": "ps"}, "powder: found 'ps'"), ({"powder": cal.PS, "tolerance": 0}, "tolerance: found 0")]:
        with pytest.raises(cal.InputMistake, match=words):
            cal.neck_growth([0.01], **given, **more)  # type: ignore[arg-type]
    assert np.array_equal(cal.neck_growth([0.01], **given, powder=cal.material("ps")), cal.neck_growth([0.01], **given, powder=cal.PS))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"of": 3}, "of: found 3"),
        ({"of": "ps-r3"}, "ps-r3"),
        ({"pulse_energy": "much"}, "pulse_energy: found 'much'"),
        ({"pulse_energy": -1}, "pulse-energy: found -1"),
        ({"energy_for": 1, "probability": 2}, "probability: found 2"),
        ({"energy_for": 1}, "no pulse whose amplitude goes with its energy"),
        ({"heat": "not-there.toml"}, "not-there.toml"),
    ],
)
def test_predictions_name_what_is_asked_wrongly(asked: dict[str, object], words: str, pair_run: cal.Run) -> None:
    with pytest.raises(cal.InputMistake, match=words):
        pair_run.predict(**asked)  # type: ignore[arg-type]


def test_a_figure_outlives_its_run() -> None:
    import copy
    import gc

    figure = cal.calibrate(line, LINE, measured(), samples=64).plot_corner()
    gc.collect()
    assert figure._repr_png_().startswith(b"\x89PNG")
    other = copy.copy(cal.calibrate(line, LINE, measured(), samples=64))
    gc.collect()
    assert other.plot_fit().svg.is_file()
    folder = other.folder
    del other
    gc.collect()
    assert not folder.exists()
