"""What the strand meets on its way: its speed, the line it follows, mould and rolls."""

from castfem.machine.machine import Machine
from castfem.machine.travel import Changing, Steady, Travel

__all__ = ["Changing", "Machine", "Steady", "Travel"]
