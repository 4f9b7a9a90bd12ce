"""Common tools: units, tables, files, log, progress, stopwatch, errors."""
