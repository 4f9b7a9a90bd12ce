"""Tensile tests of a constitutive law: a case without a slice."""
