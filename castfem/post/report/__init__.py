"""What `castfem show` and the reports say about a run: headline, remarks, hot spots, errors."""
