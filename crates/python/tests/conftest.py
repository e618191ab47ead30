"""The command beside the module, and models with known answers."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import calibrate as cal

ROOT = Path(__file__).resolve().parents[3]

T = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
Y = np.array([0.31, 0.79, 1.32, 1.78, 2.33])
LINE = {"a": cal.Normal(0.0, 1.0), "b": cal.Uniform(-4.0, 4.0)}


def line(a: float, b: float) -> np.ndarray:
    """A line at the times of the measurements."""
    return a + b * T


def measured(**options: object) -> cal.Observations:
    """Measurements of the line."""
    given = {"noise": cal.Fixed(0.05), "x_name": "t", "name": "y", **options}
    return cal.Observations(T, Y, **given)  # type: ignore[arg-type]


@pytest.fixture(scope="session")
def command() -> Path:
    """The command that the wheel has put beside this Python."""
    beside = Path(sys.executable).with_name("calibrate")
    assert beside.is_file(), f"the wheel has put no calibrate beside {sys.executable}"
    return beside


@pytest.fixture(scope="session")
def run_command(command: Path):
    """Runs the command in a folder, with a PATH that has no Rust."""

    def run(*arguments: object, cwd: Path) -> str:
        environment = {"PATH": "/usr/bin:/bin", "HOME": str(cwd)}
        done = subprocess.run([str(command), *map(str, arguments)], cwd=cwd, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def same_files(one: Path, other: Path, names: list[str]) -> None:
    """Holds files of two runs against each other, byte by byte."""
    for name in names:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name


@pytest.fixture(scope="session")
def line_run() -> cal.Run:
    """A calibration of the line."""
    return cal.calibrate(line, LINE, measured(), samples=300, seed=3)


@pytest.fixture(scope="session")
def pair_run() -> cal.Run:
    """A calibration of a pair."""
    return cal.material("ps").calibrate(samples=64, other_kinetics=False)


def copied(source: Path, folder: Path) -> Path:
    """A copy of a folder of the project."""
    shutil.copytree(source, folder)
    return folder
