"""The uncertainty report: figures, `report.html` and `summary.json`."""

from bayeshaptic.report.summary import summary, summary_json
from bayeshaptic.report.write import write_report

__all__ = ["summary", "summary_json", "write_report"]
