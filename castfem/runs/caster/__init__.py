"""The whole caster at any time: many slices in one process, each with its own history."""
