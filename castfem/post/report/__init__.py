"""What is shown of a run: headline, remarks, hot spots, errors."""
