"""Numbers and lists as running text."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from evaluation.results.tables import fixed


def listed(parts: Iterable[object]) -> str:
    """`a`, `a and b`, `a, b and c`; numbers without needless digits."""
    texts = [f"{part:g}" if isinstance(part, float) else str(part) for part in parts]
    if len(texts) < 2:
        return "".join(texts)
    return f"{', '.join(texts[:-1])} and {texts[-1]}"


def span(values: Sequence[float], digits: int) -> str:
    """`a to b`, or one number if they are the same in print.

    Raises:
        ValueError: there are no values.
    """
    low, high = (fixed(value, digits) for value in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def counted(count: int, of: int) -> str:
    """`3 of 24`, `all 24`, `none of 24`."""
    return f"all {of}" if count == of and of else f"{count or 'none'} of {of}"
