"""The command line that opens a review at a moment, for tables of moments."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence


def review_command(
    run: Sequence[str], estimator: str, at_s: float | None, *, params: Mapping[str, object] | None = None, seed: int = 0
) -> str:
    """``fusion review`` of one estimator, the time cursor ``at_s`` after the start of the run (None: where it opens);
    quoted for a shell. ``run``: the words that name it, a path or more.
    """
    words = ["fusion", "review", *run, "--estimators", estimator]
    words += [] if at_s is None else ["--at", f"{at_s:.2f}"]
    for key, value in (params or {}).items():
        words += ["--set", f"{estimator}.{key}={json.dumps(value)}"]
    return shlex.join(words + (["--seed", str(seed)] if seed else []))
