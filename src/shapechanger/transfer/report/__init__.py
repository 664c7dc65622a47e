"""The report of a transfer study: rows of text for a terminal, and one page that holds everything.

The rows and the verdict need no matplotlib; `write_report` does, which the extra `report` installs.
"""

from shapechanger.transfer.report.arms import ArmRow, arm_rows
from shapechanger.transfer.report.page import write_report
from shapechanger.transfer.report.table import Row, measure_rows
from shapechanger.transfer.report.verdict import caveats, verdict

__all__ = ["ArmRow", "Row", "arm_rows", "caveats", "measure_rows", "verdict", "write_report"]
