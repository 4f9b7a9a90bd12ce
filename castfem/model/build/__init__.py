"""From a case to the objects that compute it."""
