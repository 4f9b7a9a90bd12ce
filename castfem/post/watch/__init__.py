"""Runs at work: how far they have come, by the files they write anyway."""
