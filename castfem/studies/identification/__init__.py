"""Parameters of a flow law from measured tensile curves."""
