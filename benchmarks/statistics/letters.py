"""Letters for a leaderboard: names that share one cannot be distinguished (a compact letter display)."""

from __future__ import annotations

import string
from collections.abc import Sequence


def letters(names: Sequence[str], apart: Sequence[tuple[str, str]]) -> dict[str, str]:
    """Letters by name: two names share one exactly when they are not ``apart`` (Piepho 2004, insert and absorb).

    >>> letters(["ekf", "grid", "particle"], [("ekf", "particle")])
    {'ekf': 'a', 'grid': 'ab', 'particle': 'b'}
    """
    groups = {frozenset(names)} if names else set()
    for pair in apart:
        split = {part for group in groups for part in _without(group, frozenset(pair))}
        groups = {group for group in split if not any(group < other for other in split)}
    ordered = sorted(groups, key=lambda group: [place for place, name in enumerate(names) if name in group])
    return {name: "".join(_letter(i) for i, group in enumerate(ordered) if name in group) for name in names}


def _without(group: frozenset[str], pair: frozenset[str]) -> tuple[frozenset[str], ...]:
    return tuple(group - {name} for name in pair) if pair <= group else (group,)


def _letter(place: int) -> str:
    """From a to z, then aa, bb ..."""
    times, letter = divmod(place, len(string.ascii_lowercase))
    return string.ascii_lowercase[letter] * (times + 1)
