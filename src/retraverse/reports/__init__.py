"""Tables and figures from records only; nothing here computes a metric."""

from retraverse.reports.comparison_report import write_comparison_report
from retraverse.reports.study_report import write_study_report

__all__ = ["write_comparison_report", "write_study_report"]
