"""The whole caster at any moment: many slices in one process, each with what it has met."""
