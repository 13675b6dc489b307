"""Numbers in, numbers out: stiffness, kinematics, joints, coupling, gap. No files, no devices."""
