"""The shared core: robot model, kinematics, collision checks, motions, planning."""
