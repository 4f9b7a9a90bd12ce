"""A run, or several beside one another, as one HTML file that opens offline and prints."""
