"""The time loop of a run: committed states, recording, interruption, restart."""
