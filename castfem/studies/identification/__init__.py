"""Identification of the parameters of a flow law from measured tensile curves."""
