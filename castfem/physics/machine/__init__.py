"""The caster: casting speed, strand line, rolls, sprays, bulging and extraction."""

from castfem.physics.machine.machine import Machine
from castfem.physics.machine.travel import Changing, Steady, Travel

__all__ = ["Changing", "Machine", "Steady", "Travel"]
