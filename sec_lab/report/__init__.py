"""The report: every notebook executed, and shown as linked pages that need nothing from the network."""

from sec_lab.report.build import ReportPage as ReportPage
from sec_lab.report.build import ReportSummary as ReportSummary
from sec_lab.report.build import build_report as build_report
