"""Withdrawal of the strand: what its rolls resist, what its drives take, what is left in it."""
