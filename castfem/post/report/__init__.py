"""Texts of `castfem show` and the reports on a run: headline, remarks, hot spots, errors."""
