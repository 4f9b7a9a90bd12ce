"""What the strand meets on its way: its speed, the line it follows, mould and rolls."""

from castfem.physics.machine.machine import Machine
from castfem.physics.machine.travel import Changing, Steady, Travel

__all__ = ["Changing", "Machine", "Steady", "Travel"]
