"""One or several runs as an HTML file that opens offline and can be printed."""
