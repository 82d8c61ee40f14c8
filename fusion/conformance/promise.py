"""A promise of a contract, of estimators or of drivers: what must hold, why, and of whom it is asked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

from fusion.errors import ConformanceError
from fusion.estimator import Tag

Test: TypeAlias = Callable[[type[Any]], None]
"""A search for a counter-example in a class; an estimator is built with the world alone."""


class Promise(NamedTuple):
    """A promise: ``test`` raises `ConformanceError` with a counter-example.

    ``id`` stays the same, so that a promise can be excused by name; ``reason`` is a sentence that states why it
    matters. ``unless`` excuses estimators with any of these tags, ``needs`` those without any of these, ``offers``
    those that are not of this kind.
    """

    id: str
    reason: str
    test: Test
    unless: frozenset[Tag]
    needs: frozenset[Tag]
    offers: type[Any]

    def excuse(self, made: type[Any]) -> str:
        """The reason why the promise does not apply to the class ``made``; "" where it does."""
        tags: frozenset[Tag] = getattr(made, "tags", frozenset())
        if not issubclass(made, self.offers):
            return f"asked only of a {self.offers.__name__}"
        if barred := self.unless & tags:
            return f"not asked of an estimator tagged {', '.join(sorted(tag.value for tag in barred))}"
        if self.needs and not self.needs & tags:
            return f"asked only of an estimator tagged {', '.join(sorted(tag.value for tag in self.needs))}"
        return ""


def promise(
    promises: list[Promise],
    promise_id: str,
    reason: str,
    *,
    unless: Sequence[Tag] = (),
    needs: Sequence[Tag] = (),
    offers: type[Any] = object,
) -> Callable[[Test], Test]:
    """A decorator that adds its function to ``promises``."""

    def add(test: Test) -> Test:
        promises.append(Promise(promise_id, reason, test, frozenset(unless), frozenset(needs), offers))
        return test

    return add


def require(condition: object, counter_example: str) -> None:
    """Raises `ConformanceError` with the counter-example where the condition is false."""
    if not condition:
        raise ConformanceError(counter_example)
