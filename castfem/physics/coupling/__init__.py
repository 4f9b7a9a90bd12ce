"""Temperature and mechanics in turn: the coupling windows, their iterations and their sub-steps."""
