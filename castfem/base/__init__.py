"""What every part uses: log, progress, stopwatch, messages, files written whole."""
