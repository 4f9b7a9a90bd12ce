"""Numbers with units, and tables of them."""
