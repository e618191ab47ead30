"""How far a calibration is, in a terminal and in a notebook; nothing where neither shows it."""

from __future__ import annotations

import sys
import time
import warnings
from importlib import import_module
from typing import Any


class CalibrationWarning(UserWarning):
    """Something that may put a result in doubt."""


def in_notebook() -> bool:
    """Whether this is a kernel of Jupyter."""
    shell = sys.modules.get("IPython")
    get = getattr(shell, "get_ipython", None)
    return get is not None and type(get()).__name__ == "ZMQInteractiveShell"


class Progress:
    """Shows the work that is told of: a bar of tqdm where that is installed, a line on stderr otherwise.

    Silent where stderr is no terminal and this is no notebook, or where ``wanted`` is False.
    """

    def __init__(self, wanted: bool | None = None) -> None:
        shown = in_notebook() or sys.stderr.isatty()
        self.wanted = shown if wanted is None else wanted
        self.done, self.total, self.what = 0, 0, ""
        self._bar: Any = None
        self._line = False
        self._last = 0.0

    def show(self, done: int, total: int, what: str) -> None:
        """So many pieces of so many are done."""
        if (total, what) != (self.total, self.what):
            self.close()
            self.done, self.total, self.what = 0, total, what
        # Simulations are counted here too, within the batches that are counted there.
        self.done = max(self.done, done)
        if self.wanted and what:
            self._draw()

    def _draw(self) -> None:
        if self._bar is None and not self._line:
            self._bar = _tqdm(self.total, self.what)
        if self._bar is not None:
            self._bar.update(self.done - self._bar.n)
        elif time.monotonic() - self._last > 0.2:
            self._last, self._line = time.monotonic(), True
            count = f" {self.done} of {self.total}" if self.total else ""
            print(f"\r\033[K{self.what}{count}", end="", file=sys.stderr, flush=True)

    def advance(self, done: int = 1) -> None:
        """So many more pieces are done."""
        self.show(self.done + done, self.total, self.what)

    def note(self, text: str) -> None:
        """Something worth knowing."""
        if self.wanted:
            self.close()
            print(text, file=sys.stderr)

    def warn(self, text: str) -> None:
        """Something that may put the result in doubt."""
        self.close()
        warnings.warn(text, CalibrationWarning, stacklevel=2)

    def close(self) -> None:
        """Takes the bar away."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None
        if self._line:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
            self._line = False


def _tqdm(total: int, what: str) -> Any:
    try:
        tqdm = import_module("tqdm.auto").tqdm
    except ImportError:
        return None
    with warnings.catch_warnings():
        # tqdm says so where the widgets of a notebook are not installed: its plain bar does.
        warnings.simplefilter("ignore")
        return tqdm(total=total or None, desc=what, leave=False)
