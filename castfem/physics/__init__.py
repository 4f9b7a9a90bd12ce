"""The problems: steels, laws, heat, mechanics, the machine and the mould."""
