"""Mechanical contact of the slice with a rigid wall (thesis III.4; docs/contact.md)."""
