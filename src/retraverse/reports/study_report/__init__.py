"""The report of a study: one folder of pages, drawn from records alone.

`report` writes it; `chapters` says what each page holds; `artefacts` are its tables and figures,
`panels` and `figures` draw them, `run_files` and `picture_files` are what a click opens, `exports`
the files beside the pages, and `published` the thesis' own numbers.
"""

from retraverse.reports.study_report.report import write_study_report

__all__ = ["write_study_report"]
