"""What is read off a slice, and what of it is reported."""
