"""Tables and figures from records only; nothing here computes a metric."""

from retraverse.reports.comparison_report import write_comparison_report

__all__ = ["write_comparison_report"]
