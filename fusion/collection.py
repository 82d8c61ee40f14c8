"""Garbage collection in programs of ours, which hold many values that cannot form cycles."""

import gc


def collect_seldom() -> None:
    """Look for cycles less often than Python does by itself, which costs a fifth of a bench."""
    gc.set_threshold(100_000, 50, 100)
