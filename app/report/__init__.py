"""Reports of a discovery's result: a page, a JSON file and lines in a terminal."""

from app.report.page import write_report
from app.report.terminal import show_case
from app.report.verdict_json import verdict_json

__all__ = ["show_case", "verdict_json", "write_report"]
