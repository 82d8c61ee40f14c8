"""Verdicts on pairs, and scores run by run: each number leads to the cell it comes from."""

from __future__ import annotations

import numpy as np

from benchmarks.report.cell_links import link, nearest
from benchmarks.report.report_data import ReportData
from benchmarks.runner.leaderboard import pair_table
from benchmarks.runner.results import Result, by_estimator, by_run, score_matrix
from benchmarks.statistics.paired_tests import log_ratios
from benchmarks.statistics.verdict import Comparison, Verdict
from fusion.output.tables import Table


def run_by_run(data: ReportData) -> Table:
    """Scores of every estimator in every run, which the verdicts rest on."""
    grouped = by_estimator(data.results)
    rows = []
    for run_id in by_run(grouped[data.estimators[0]]):
        cells = [by_run(grouped[name])[run_id] for name in data.estimators]
        scores = [float(np.median(score_matrix(own, data.metric))) for own in cells]
        linked = [
            link(data, data.unit.number(score), nearest(own, data.metric, score))
            for own, score in zip(cells, scores, strict=True)
        ]
        rows.append((run_id, *linked))
    over = ", median over seeds" if data.suite.seeds > 1 else ""
    unit = f" [{data.unit.name}]" if data.unit.name else ""
    title = f"Run by run: {data.metric}{unit} without faults{over}"
    return Table(title, ("run", *data.estimators), tuple(rows))


def pairs(data: ReportData, comparison: Comparison) -> Table:
    """Every pair as one row; the ratio leads to the cell that decided most."""
    table = pair_table(comparison)
    rows = [
        (pair, link(data, ratio, deciding(data, verdict)), *rest)
        for verdict, (pair, ratio, *rest) in zip(comparison.verdicts, table.rows, strict=True)
    ]
    return table._replace(rows=tuple(rows))


def deciding(data: ReportData, verdict: Verdict) -> Result:
    """Of a pair, the cell in which the worse of the two lost most."""
    grouped = by_estimator(data.results)
    first, second = (np.median(score_matrix(grouped[n], data.metric), axis=1) for n in (verdict.first, verdict.second))
    apart = log_ratios(first, second)
    first_is_better = np.sum(np.sign(apart)) <= 0.0 if verdict.winner is None else verdict.winner == verdict.first
    loser, scores = (verdict.second, second) if first_is_better else (verdict.first, first)
    row = int(np.argmin(apart) if first_is_better else np.argmax(apart))
    return nearest(list(by_run(grouped[loser]).values())[row], data.metric, scores[row])
