"""The progress bar of the commands that carry out many runs."""

from __future__ import annotations

import rich.console
import rich.progress


def progress_bar(console: rich.console.Console) -> rich.progress.Progress:
    """A bar with counts and time left, gone when it is finished."""
    return rich.progress.Progress(
        *rich.progress.Progress.get_default_columns(),
        rich.progress.MofNCompleteColumn(),
        console=console,
        transient=True,
        disable=console.quiet,
    )
