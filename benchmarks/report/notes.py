"""What a reader must know to read a table or a figure of a report: definitions, what is in a number and what is not."""

from __future__ import annotations

from collections.abc import Mapping

NOTES: Mapping[str, str] = {
    "leaderboard": (
        "Estimators that share a letter under `alike` cannot be told apart. Over runs: geometric mean with its 95 % t "
        "interval. Worst run: the highest score of all. All other numbers are medians over cells. p75: three quarters "
        "of the instants err less. Quantiles count every instant; RMSE, mean and max only those with a valid answer, "
        "so read them with the availability, the share of such instants; heading errors only those whose true heading "
        "is known (`head_n` of the exported numbers)."
    ),
    "pairs": (
        "Ratio of the first to the second: geometric mean over runs with its 95 % t interval, below 1 where the first "
        "is better. `p, Holm` decides, at 5 %; it is the p of that mean, or of the signed ranks where one of the two "
        "was lost in a run, corrected for the number of pairs. Intervals and `p, signed ranks` are of each pair alone. "
        "The runs that a verdict says are needed, and the differences that it says so many runs show, are those that "
        "four of five such suites would find."
    ),
    "innovations": (
        "NIS: squared innovation of a reading over its predicted variance; refused readings count too. Inside 95 %: "
        "share of readings below the 95 % point of chi-square, median over cells. Bold lies outside its band."
    ),
    "faults": (
        "Every estimator meets the same damage. ∞: no finite score in at least half of the runs. Below 1 is no "
        "mistake: a reading that is missing cannot mislead, and what is drawn anew may fall better."
    ),
    "outages": (
        "Growth: slope of the error over time. Below 1 m again: from the end of the window until the error stays below "
        "1 m for 5 s; ∞ where the run ends before that, in at least half of the cells."
    ),
    "credibility": (
        "nci: mean of 10 |log₁₀(ν / ν*)|, incl the same without the bars; ν is the squared error over the claimed "
        "covariance, ν* over the actual mean square of the seeds' errors (Li & Zhao 2006)."
    ),
    "accuracy": (
        "Curves: of all instants of the shown runs the share that errs less; they end at the availability, for an "
        "instant without a valid answer is below no error. Verdicts rest on what happens along the grey lines, one per "
        "run."
    ),
    "consistency": (
        "A dot lies inside its grey band, a cross outside; an honest filter's mean lies inside with 95 %. The band "
        "takes as many independent samples as those of the mean are worth, which correlate in time; it is "
        "approximate. ANEES: squared error of the pose over its claimed covariance, per dimension, in every cell "
        "without faults. An estimator that claims no covariance, or predicts no readings, has no row. At 10 errors "
        "are about three times what was claimed, at 0.1 a third of it."
    ),
    "over_time": (
        "Lines are named below the first panel, and below any where they are pointed at. Gaps are instants without a "
        "valid answer; errors below 1 cm are not shown, unless all are small. Where a line has more points than can "
        "be drawn, the greatest of neighbours stands for all of them."
    ),
    "maps": (
        "The best estimator's track, coloured by its error, over the true path; triangles are anchors, contours the "
        "least error of a fix from one reading of each (Cramér-Rao)."
    ),
    "parameters": (
        "Below 1 is better than the default. A grey line is a run, dashed where it is for tuning; bars are the 95 % "
        "interval over the test runs."
    ),
    "cost": "Measured alone on one machine by `fusion bench time`. Lower left is better.",
}
