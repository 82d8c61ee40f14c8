"""Who beats whom, and in which run: each number leads to the cell it comes from."""

from __future__ import annotations

import numpy as np

from benchmarks.report.cell_links import link, nearest
from benchmarks.report.report_data import Material
from benchmarks.runner.leaderboard import sheet
from benchmarks.runner.results import Result, by_contestant, by_run, score_matrix
from benchmarks.statistics.paired_tests import log_ratios
from benchmarks.statistics.verdict import Comparison, Verdict
from fusion.output.tables import Sheet


def run_by_run(material: Material) -> Sheet:
    """What every contestant scored in every run: what the verdicts are made of."""
    grouped = by_contestant(material.results)
    rows = []
    for run_id in by_run(grouped[material.contestants[0]]):
        cells = [by_run(grouped[name])[run_id] for name in material.contestants]
        scores = [float(np.median(score_matrix(own, material.metric))) for own in cells]
        told = [
            link(material, material.unit.number(score), nearest(own, material.metric, score))
            for own, score in zip(cells, scores, strict=True)
        ]
        rows.append((run_id, *told))
    over = ", median over seeds" if material.suite.seeds > 1 else ""
    unit = f" [{material.unit.name}]" if material.unit.name else ""
    title = f"Run by run: {material.metric}{unit} without faults{over}"
    return Sheet(title, ("run", *material.contestants), tuple(rows))


def pairs(material: Material, comparison: Comparison) -> Sheet:
    """Every pair as one row; the ratio leads to the cell that decided most."""
    told = sheet(comparison)
    rows = [
        (pair, link(material, ratio, deciding(material, verdict)), *rest)
        for verdict, (pair, ratio, *rest) in zip(comparison.verdicts, told.rows, strict=True)
    ]
    return told._replace(rows=tuple(rows))


def deciding(material: Material, verdict: Verdict) -> Result:
    """Of a pair, the cell in which the worse of the two lost most."""
    grouped = by_contestant(material.results)
    first, second = (
        np.median(score_matrix(grouped[n], material.metric), axis=1) for n in (verdict.first, verdict.second)
    )
    apart = log_ratios(first, second)
    first_is_better = np.sum(np.sign(apart)) <= 0.0 if verdict.winner is None else verdict.winner == verdict.first
    loser, scores = (verdict.second, second) if first_is_better else (verdict.first, first)
    row = int(np.argmin(apart) if first_is_better else np.argmax(apart))
    return nearest(list(by_run(grouped[loser]).values())[row], material.metric, scores[row])
