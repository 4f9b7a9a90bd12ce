"""Calibration: keys of a case fitted to measurements."""
