"""Universal Robots UR10e over RTDE (ur-rtde) and the Dashboard server."""
