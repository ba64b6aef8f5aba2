"""How the command line words what the tools return."""
