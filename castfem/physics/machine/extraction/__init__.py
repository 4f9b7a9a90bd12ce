"""Withdrawal of the strand: resistance of the rolls, drive forces, axial force in the strand."""
