"""The kinematic model of the arm between base and TCP, and its limits."""
