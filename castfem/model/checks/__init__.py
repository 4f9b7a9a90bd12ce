"""Checks of a case, by the table they look at; `castfem.model.load` enters and runs them."""
