"""What data sets say of stiffness: of the whole rig, and of the joints."""
