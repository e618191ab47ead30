"""Simulators that are Python functions: called one by one, in batches, or in processes."""

from __future__ import annotations

import functools
import inspect
import multiprocessing
import signal
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import numpy as np

from ._errors import SimulatorMistake, mistake
from ._priors import FloatArray, doubles, numbers
from ._progress import Progress

Function = Callable[..., Any]

#: What a simulation may end by: all but Ctrl-C. Programs that were made for a shell end by ``sys.exit``.
ENDS = (Exception, SystemExit, GeneratorExit)
#: Longest text of an exception that is passed on.
LONGEST = 500


class StoredRuns:
    """Simulations that were made before, as a simulator: given parameter sets with what was simulated for each.

    Parameters
    ----------
    parameters : mapping of name to array of shape (n,)
        The parameter sets.
    outputs : array of shape (n, m)
        What was simulated, one row for each set; a row with NaN is a simulation that failed.
    """

    def __init__(self, parameters: Mapping[str, Any], outputs: Any) -> None:
        self.parameters = {name: numbers(f"StoredRuns {name}", values) for name, values in parameters.items()}
        try:
            self.outputs: FloatArray = doubles(outputs)
        except (TypeError, ValueError) as error:
            raise mistake("StoredRuns outputs", f"{type(outputs).__name__}, which is no array of numbers ({error})", "(n, m): a row for each parameter set") from None
        if self.outputs.ndim != 2:
            raise mistake("StoredRuns outputs", f"an array of shape {self.outputs.shape}", "(n, m): a row for each parameter set")
        for name, values in self.parameters.items():
            if values.shape != self.outputs.shape[:1]:
                raise mistake(f"StoredRuns {name}", f"an array of shape {values.shape}", f"({len(self.outputs)},), one number for each row of outputs")

    def __len__(self) -> int:
        return len(self.outputs)


def name_of(function: Any) -> str:
    """What a simulator is called in tables."""
    if isinstance(function, StoredRuns):
        return "stored-runs"
    while isinstance(function, functools.partial):
        function = function.func
    name = getattr(function, "__name__", type(function).__name__)
    return "function" if name == "<lambda>" else str(name)


def takes_names(function: Function, names: Sequence[str]) -> bool:
    """Whether a simulator takes its parameters by name; otherwise it takes one mapping of all of them."""
    try:
        own = inspect.signature(function).parameters
    except (TypeError, ValueError):
        return True
    kinds = [p.kind for p in own.values()]
    if inspect.Parameter.VAR_KEYWORD in kinds or any(name in own for name in names):
        try:
            inspect.signature(function).bind(**dict.fromkeys(names))
        except TypeError as error:
            found = f"the signature {inspect.signature(function)} ({error})"
            raise mistake(f"simulator {name_of(function)}", found, f"one that takes {', '.join(names)} by name", "give parameters and arguments the same names", SimulatorMistake) from None
        return True
    required = [p for p in own.values() if p.default is p.empty and p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    if len(required) == 1:
        return False
    raise mistake(
        f"simulator {name_of(function)}",
        f"the signature {inspect.signature(function)}",
        f"one that takes {', '.join(names)} by name, or one mapping of them",
        f"def {name_of(function)}({', '.join(names)}): ...",
        SimulatorMistake,
    )


class Called:
    """A function with the names of its parameters and of what it gives; it can be sent to another process."""

    def __init__(self, function: Function, names: Sequence[str], widths: Mapping[str, int]) -> None:
        self.function, self.names, self.widths = function, list(names), dict(widths)
        self.by_name = takes_names(function, names)
        self.width = sum(widths.values())

    def __call__(self, values: Sequence[Any]) -> Any:
        given = dict(zip(self.names, values))
        return self.function(**given) if self.by_name else self.function(given)

    def checked(self, place: str, returned: Any, rows: int | None = None) -> FloatArray:
        """What was returned for one set, or for ``rows`` of them, as doubles of the right shape."""
        if isinstance(returned, Mapping):
            missing = [name for name in self.widths if name not in returned]
            if missing:
                raise mistake(place, f"a mapping of {', '.join(map(str, returned))}", f"one with {', '.join(missing)} too", None, SimulatorMistake)
            parts = [self._shaped(f"{place}, {name}", returned[name], width, rows) for name, width in self.widths.items()]
            return np.concatenate(parts, axis=-1)
        return self._shaped(place, returned, self.width, rows)

    def _shaped(self, place: str, returned: Any, width: int, rows: int | None) -> FloatArray:
        wanted = (width,) if rows is None else (rows, width)
        what = "one value for each observation" if rows is None else "a row for each parameter set, a column for each observation"
        try:
            # Nothing would become NaN.
            array = doubles(() if returned is None else returned)
            if returned is None:
                raise TypeError("nothing was returned")
        except (TypeError, ValueError) as error:
            found = f"{type(returned).__name__}, which is no array of numbers ({error})"
            raise mistake(place, found, f"{wanted}: {what}", None, SimulatorMistake) from None
        if array.shape == () and wanted == (1,):
            array = array.reshape(1)
        if array.shape != wanted:
            remedy = "return the values at the x of the observations, in their order"
            raise mistake(place, f"an array of shape {array.shape}", f"{wanted}: {what}", remedy, SimulatorMistake)
        return array


def cause_of(error: BaseException) -> str:
    """Kind and place of an exception: the same words for the same kind of failure."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename != __file__]
    place = f" in {frames[-1].name}, line {frames[-1].lineno}" if frames else ""
    return f"{type(error).__name__}{place}"


class Failed:
    """Why a simulation gave no values, in words that a process can send."""

    def __init__(self, cause: str, text: str) -> None:
        self.cause, self.text = cause, text

    @classmethod
    def by(cls, error: BaseException) -> Failed:
        """By an exception."""
        try:
            text = str(error)
        except Exception:
            text = "(its text cannot be had)"
        shown = text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
        return cls(cause_of(error), f"{type(error).__name__}: {shown}")


class Unusable:
    """What a function returned that is no array of the right shape: the words after its place."""

    def __init__(self, text: str) -> None:
        self.text = text


_of_process: Called | None = None


def _begin(called: Called) -> None:
    global _of_process
    _of_process = called
    # Ctrl-C in a terminal reaches all its processes: the one that began these ends them.
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _ready() -> None:
    """Nothing: its process is there."""


def _one(values: list[float]) -> Any:
    assert _of_process is not None
    try:
        returned = _of_process(values)
    except ENDS as error:
        return Failed.by(error)
    # Only numbers are sent: what else a function returns need not be fit for that.
    try:
        return _of_process.checked("", returned)
    except SimulatorMistake as error:
        return Unusable(str(error))


def _alone(called: Called, values: list[float], answer: Any) -> None:
    _begin(called)
    answer.send(_one(values))


class Processes:
    """A pool of processes; a parameter set that kills its process is found by running it alone."""

    def __init__(self, called: Called, number: int) -> None:
        # Where processes are forked, a function of a notebook need not be importable.
        method = "fork" if "fork" in multiprocessing.get_all_start_methods() else None
        self.context = multiprocessing.get_context(method)
        self.called, self.number = called, number
        self.pool: ProcessPoolExecutor | None = None
        # Forked before the library has threads.
        for future in [self._begun().submit(_ready) for _ in range(number)]:
            future.result()

    def _begun(self) -> ProcessPoolExecutor:
        if self.pool is None:
            self.pool = ProcessPoolExecutor(self.number, mp_context=self.context, initializer=_begin, initargs=(self.called,))
        return self.pool

    def run(self, sets: FloatArray, progress: Progress) -> list[Any]:
        """What the function returned for each set, or why it did not."""
        found: dict[int, Any] = {}
        left = list(range(len(sets)))
        try:
            self._together(sets, found, progress)
        except BrokenProcessPool:
            self.close()
            left = [row for row in left if row not in found]
            for row in left:
                found[row] = self._by_itself(sets[row])
                progress.advance()
        return [found[row] for row in range(len(sets))]

    def _together(self, sets: FloatArray, found: dict[int, Any], progress: Progress) -> None:
        pool = self._begun()
        asked: dict[Future[Any], int] = {pool.submit(_one, values.tolist()): row for row, values in enumerate(sets)}
        open_ones = set(asked)
        broken: BrokenProcessPool | None = None
        while open_ones:
            ended, open_ones = wait(open_ones, timeout=0.5, return_when=FIRST_COMPLETED)
            for future in ended:
                try:
                    found[asked[future]] = future.result()
                    progress.advance()
                except BrokenProcessPool as error:
                    broken = error
        if broken is not None:
            raise broken

    def _by_itself(self, values: FloatArray) -> Any:
        receive, send = self.context.Pipe(duplex=False)
        process: Any = getattr(self.context, "Process")(target=_alone, args=(self.called, values.tolist(), send))
        process.start()
        send.close()
        try:
            return receive.recv()
        except EOFError:
            process.join()
            code = process.exitcode
            how = f"by signal {-code}" if code is not None and code < 0 else f"with exit code {code}"
            cause = f"its process ended {how}"
            return Failed(cause, cause)
        finally:
            if process.is_alive():
                process.join(1.0)
            if process.is_alive():
                process.terminate()
            receive.close()

    def close(self, wait_for_it: bool = True) -> None:
        """Ends the processes."""
        if self.pool is None:
            return
        pool, self.pool = self.pool, None
        processes = list((getattr(pool, "_processes", None) or {}).values())
        pool.shutdown(wait=wait_for_it, cancel_futures=True)
        if not wait_for_it:
            for process in processes:
                process.terminate()


class Simulator:
    """What the sampler asks for values: ``(number of the first sample, parameters as bytes) -> (values as bytes, failures)``."""

    def __init__(self, function: Any, names: Sequence[str], widths: Mapping[str, int], progress: Progress) -> None:
        self.function, self.names, self.progress = function, list(names), progress
        self.width = sum(widths.values())
        self.stored = function if isinstance(function, StoredRuns) else None
        self.called = None if self.stored else Called(function, names, widths)
        self.vectorized = False
        self.processes: Processes | None = None
        #: The first exception of each cause, with its place.
        self.first_failures: dict[str, str] = {}
        self.first_error: BaseException | None = None

    def __call__(self, first: int, thetas: bytes) -> tuple[bytes, list[tuple[int, str]]]:
        sets = np.frombuffer(thetas, dtype=np.float64).reshape(-1, len(self.names))
        values = np.full((len(sets), self.width), np.nan)
        failures: list[tuple[int, str]] = []
        if self.stored is not None:
            values[:] = self.stored.outputs[first : first + len(sets)]
        elif self.vectorized:
            self._batch(first, sets, values, failures)
        elif self.processes is not None:
            self._each(first, sets, self.processes.run(sets, self.progress), values, failures)
        else:
            self._each(first, sets, (self._call(theta) for theta in sets), values, failures)
        failed = {row for row, _ in failures}
        for row in np.flatnonzero(~np.all(np.isfinite(values), axis=1)):
            if row not in failed:
                self._note(first, int(row), sets, "a value that is not finite", "a value that is not finite", failures)
        return values.tobytes(), failures

    def _call(self, theta: FloatArray) -> Any:
        assert self.called is not None
        try:
            return self.called(theta.tolist())
        except ENDS as error:
            self.first_error = self.first_error or error
            return Failed.by(error)
        finally:
            self.progress.advance()

    def _each(self, first: int, sets: FloatArray, returned: Any, values: FloatArray, failures: list[tuple[int, str]]) -> None:
        assert self.called is not None
        for row, one in enumerate(returned):
            if isinstance(one, Failed):
                self._note(first, row, sets, one.cause, one.text, failures)
            elif isinstance(one, Unusable):
                raise SimulatorMistake(f"{self._place(first, row, sets)}{one.text}")
            else:
                values[row] = self.called.checked(self._place(first, row, sets), one)

    def _batch(self, first: int, sets: FloatArray, values: FloatArray, failures: list[tuple[int, str]]) -> None:
        assert self.called is not None
        try:
            returned = self.called(list(np.ascontiguousarray(sets.T)))
        except ENDS as error:
            self.first_error = self.first_error or error
            if len(sets) == 1:
                self.progress.advance()
                failed = Failed.by(error)
                self._note(first, 0, sets, failed.cause, failed.text, failures)
                return
            # Which sets of the batch cannot be simulated is found one by one.
            for row in range(len(sets)):
                alone: list[tuple[int, str]] = []
                self._batch(first + row, sets[row : row + 1], values[row : row + 1], alone)
                failures.extend((row, cause) for _, cause in alone)
            return
        self.progress.advance(len(sets))
        place = f"simulator {name_of(self.function)}, samples {first} to {first + len(sets) - 1}"
        values[:] = self.called.checked(place, returned, len(sets))

    def _place(self, first: int, row: int, sets: FloatArray) -> str:
        given = ", ".join(f"{name}={value:.6g}" for name, value in zip(self.names, sets[row]))
        return f"simulator {name_of(self.function)}, sample {first + row} ({given})"

    def _note(self, first: int, row: int, sets: FloatArray, cause: str, text: str, failures: list[tuple[int, str]]) -> None:
        failures.append((row, cause))
        if cause not in self.first_failures:
            self.first_failures[cause] = f"{self._place(first, row, sets)}: {text}"
            self.progress.note(f"{self.first_failures[cause]}; counted among the failures")
