"""Pictures of the maps, drawn without pyplot and without a display."""
