"""What the simulation says, and how the rig is read: springs, gains, datum and noise of all
channels, operators with memory over the load's path, and the pool of columns of effects."""
