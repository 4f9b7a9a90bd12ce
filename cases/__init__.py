"""castfem."""
