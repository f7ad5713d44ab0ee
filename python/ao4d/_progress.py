"""How far work is: a bar in notebooks and on terminals, or a function of the caller's."""

from __future__ import annotations

import contextlib
import sys
import time
from typing import Any, Callable, Iterator, Optional

Watch = Callable[[str, int, int], None]

#: Work that ends sooner shows nothing.
PATIENCE = 0.5


@contextlib.contextmanager
def watching(progress: Any) -> Iterator[Optional[Watch]]:
    """What is told of progress: `True` shows a bar, `None` does where there is somebody to see it, `False` doesn't."""
    if callable(progress):
        yield progress
        return
    notebook = _in_notebook()
    if progress is False or (progress is None and not (notebook or sys.stderr.isatty())):
        yield None
        return
    bar = NotebookBar() if notebook else TerminalBar()
    try:
        yield bar
    finally:
        bar.close()


def _in_notebook() -> bool:
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return shell is not None and hasattr(shell, "kernel")


class Bar:
    """A bar that appears when work takes longer than a moment."""

    def __init__(self) -> None:
        self.began = time.monotonic()
        self.shown = False

    def __call__(self, stage: str, done: int, total: int) -> None:
        if time.monotonic() - self.began >= PATIENCE:
            self.show(stage, min(done / total, 1.0) if total else None)
            self.shown = True

    def show(self, stage: str, share: Optional[float]) -> None:
        raise NotImplementedError

    def close(self) -> None:
        """Takes the bar away."""


class TerminalBar(Bar):
    """One line on stderr, written over and over."""

    def show(self, stage: str, share: Optional[float]) -> None:
        bar = "" if share is None else f" [{'=' * round(30 * share):30}] {share:4.0%}"
        sys.stderr.write(f"\r\x1b[K{stage}{bar}")
        sys.stderr.flush()

    def close(self) -> None:
        if self.shown:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()


class NotebookBar(Bar):
    """An element of the cell's output, replaced in place."""

    handle: Any = None

    def show(self, stage: str, share: Optional[float]) -> None:
        from html import escape

        from IPython.display import HTML, display

        value = "" if share is None else f' value="{share:.3f}"'
        element = HTML(f"<progress{value} style='width: 20em'></progress> {escape(stage)}")
        if self.handle is None:
            self.handle = display(element, display_id=True)
        else:
            self.handle.update(element)

    def close(self) -> None:
        if self.handle is not None:
            from IPython.display import HTML

            self.handle.update(HTML(""))
